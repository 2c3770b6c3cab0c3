""".venv/bin/python scripts/bench_design.py  # designs evaluated a minute, and the memory it takes.

Searches a Sobol sample of a task with 64 samples of a gait in stance, its torques, and the
constraints reach, singularity, joint speed and torque (the torque-speed line). Prints designs a
minute, of evaluation alone and with all of them written to Parquet, and the peak memory after the
first tenth and at the end. The time of the processors is what the machine takes if nobody else
uses it.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

from fivebar_sim import design
from fivebar_sim.design.search.run import Progress, search
from fivebar_sim.files import resources

TASK = "classic-lengths"
SEARCH = '[search]\nmethod = "sobol"\ndesigns = {}\n'


def peak() -> float:
    """Return the most memory that this process has had so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def load(folder: Path, designs: int) -> design.Task:
    """Return the shipped task, with a Sobol sample for its search."""
    text = resources.shipped("designs")[TASK].read_text(encoding="utf-8")
    path = folder / "bench.toml"
    path.write_text(text.split("[search]")[0] + SEARCH.format(designs), encoding="utf-8")
    return design.load(path)


def main() -> None:
    """Print the rates and the memory."""
    parser = argparse.ArgumentParser(description="Time the evaluation of designs.")
    parser.add_argument("--designs", type=int, default=1_000_000, help="default: 10^6")
    parser.add_argument("--threads", type=int, default=2, help="default: 2")
    args = parser.parse_args()

    memory: list[float] = []

    def watch(progress: Progress) -> None:
        if not memory and progress.designs >= 0.1 * progress.total:
            memory.append(peak())

    with tempfile.TemporaryDirectory() as place:
        task = load(Path(place), args.designs)
        start = time.perf_counter()
        busy = time.process_time()
        found = search(task, Path(place) / "out", threads=args.threads, watch=watch)
        seconds = time.perf_counter() - start
        busy = time.process_time() - busy

    print(f"{found.designs} designs of {task.samples} samples, {found.feasible} feasible")
    print(f"evaluated: {found.rate:.3g} a minute with {args.threads} threads")
    print(f"searched and written: {60.0 * found.designs / seconds:.3g} a minute")
    print(f"in all: {60.0 * found.designs / busy:.3g} a minute of one processor's time")
    print(f"memory: {memory[0]:.0f} MB after a tenth, {peak():.0f} MB at the end")


if __name__ == "__main__":
    main()
