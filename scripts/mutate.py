"""./.venv/bin/python scripts/mutate.py [ROOM ...]: mutates the core rooms in a copy, by mutmut.

Every mutant is one small change of one function; the tests of its room must fail for it. Prints
how many were killed (a timeout counts) and how many lived or met no test, and the changes of
those. Rooms: kinematics, dynamics, metrics; default all. docs/mutation.md explains what lives.

    --sample N      only N mutants of each room, drawn with --seed
    --work DIR      keeps the copies there, with the verdicts; run again it tests what lived
    --processes N   default 2

Exit status: 0 if every room's score is at least 0.9, else 1.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("fivebar_sim", "controllers", "tests", "models", "scenarios", "scripts")
GOAL = 0.9
VERDICTS = {1: "killed", 3: "killed", 36: "timeout", 24: "timeout", 152: "timeout", -24: "timeout"}
LIVED = {0: "survived", 33: "no test", 5: "no test"}
CONFIG = """
[tool.mutmut]
source_paths = ["fivebar_sim"]
only_mutate = {files}
also_copy = {copied}
pytest_add_cli_args = {options}
pytest_add_cli_args_test_selection = {tests}
timeout_constant = 3.0
timeout_multiplier = 2.0
"""
SLOW = (
    "tests/test_dynamics_motion.py::test_springs_keep_the_energy_for_seconds",
    "tests/test_dynamics_motion.py::test_motion_into_a_singular_pose_says_when",
    "tests/test_motion_refused.py::test_no_stop_of_the_model_acts_on_a_planned_path",
)
"""Tests that are not asked: those of more than some seconds."""


class Room(NamedTuple):
    """Files that are mutated, and those of the tests that must see it, without test_ and .py."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS = {
    "kinematics": Room(
        ("fivebar_sim/kinematics/[a-z]*.py",),
        (
            *("kinematics", "kinematics_rates", "kinematics_laws", "half_angle", "singular_laws"),
            *("hip", "two_link", "motion_refused", "tasks"),
        ),
    ),
    "dynamics": Room(
        ("fivebar_sim/dynamics/[a-z]*.py",),
        (
            *("dynamics", "dynamics_friction", "dynamics_motion", "dynamics_stepwise"),
            *("dynamics_laws", "leg_dynamics", "singular_laws"),
        ),
    ),
    "metrics": Room(
        (
            "fivebar_sim/simulation/measure.py",
            "fivebar_sim/metrics/tracking.py",
            "fivebar_sim/metrics/load.py",
            "fivebar_sim/metrics/ground.py",
        ),
        ("load", "ground", "metrics_laws"),
    ),
}


def copy(room: Room, folder: Path) -> None:
    """Lay a copy of the tree that mutmut is set up in."""
    for name in COPIED:
        shutil.copytree(
            ROOT / name,
            folder / name,
            ignore=shutil.ignore_patterns("__pycache__", "*.rrd"),
            dirs_exist_ok=True,
        )

    slow = [f"--deselect={test}" for test in SLOW]
    # mutmut runs pytest in its own process, which finds the plugin next to mutate_operators.py.
    options = ["-p", "no:cacheprovider", "-p", "mutate_cold", "-m", "not long and not site", *slow]
    config = CONFIG.format(
        files=json.dumps(room.files),
        copied=json.dumps([name for name in COPIED if name != "fivebar_sim"]),
        options=json.dumps(options),
        tests=json.dumps([f"tests/test_{name}.py" for name in room.tests]),
    )
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (folder / "pyproject.toml").write_text(project + config, encoding="utf-8")


def mutmut(folder: Path, *arguments: str) -> str:
    """Return what mutmut prints in a folder; what it says in an error goes to the screen."""
    command = [sys.executable, str(ROOT / "scripts" / "mutate_operators.py"), *arguments]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode:
        sys.exit(f"mutmut failed:\n{run.stdout[-4000:]}{run.stderr[-4000:]}")
    return run.stdout


def verdicts(folder: Path) -> dict[str, int | None]:
    """Return mutmut's verdict of every mutant, None where it was not tested."""
    found: dict[str, int | None] = {}
    for path in sorted((folder / "mutants").rglob("*.py.meta")):
        found |= json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"]
    return found


def keep(folder: Path, killed: dict[str, int | None]) -> None:
    """Let mutmut know of verdicts that it has not, so that it tests only the rest again."""
    for path in (folder / "mutants").rglob("*.py.meta"):
        meta = json.loads(path.read_text(encoding="utf-8"))
        codes = meta["exit_code_by_key"]
        meta["exit_code_by_key"] = {k: v if v in VERDICTS else killed[k] for k, v in codes.items()}
        path.write_text(json.dumps(meta), encoding="utf-8")


def change(folder: Path, name: str) -> str:
    """Return the changed lines of a mutant."""
    lines = mutmut(folder, "show", name).splitlines()
    return "\n".join(line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---"))


def test(name: str, folder: Path, sample: int | None, seed: int, processes: int) -> float:
    """Mutate a room, print what came, and return its score."""
    copy(ROOMS[name], folder)
    mutmut(folder, "make")
    killed = {k: v if v in VERDICTS else None for k, v in verdicts(folder).items()}
    names = sorted(killed)

    if sample is not None and sample < len(names):
        names = sorted(random.Random(seed).sample(names, sample))

    if left := [each for each in names if killed[each] is None]:
        mutmut(folder, "run", f"--max-children={processes}", *left)

    found = verdicts(folder)
    keep(folder, killed)
    came = {each: killed[each] or found[each] for each in names}
    counts: dict[str, int] = {}
    lived = []

    for each, code in came.items():
        word = VERDICTS.get(code or 0) or LIVED.get(code if code is not None else -1, "broken")
        counts[word] = counts.get(word, 0) + 1
        if word not in VERDICTS.values():
            lived.append((each, word))

    score = 1.0 - len(lived) / len(came)
    listed = ", ".join(f"{word} {count}" for word, count in sorted(counts.items()))
    print(f"{name}: {score:.1%} of {len(came)} mutants ({listed})")
    for each, word in lived:
        print(f"\n{each}: {word}\n{change(folder, each)}")

    sys.stdout.flush()
    return score


def main() -> int:
    """Mutate the rooms that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=", ".join(ROOMS))
    parser.add_argument("--sample", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()

    if unknown := set(options.rooms) - set(ROOMS):
        parser.error(f"no such room: {', '.join(sorted(unknown))}")

    with tempfile.TemporaryDirectory() as temporary:
        scores = []
        for name in options.rooms or ROOMS:
            folder = (options.work or Path(temporary)) / name
            folder.mkdir(parents=True, exist_ok=True)
            scores.append(
                test(name, folder.resolve(), options.sample, options.seed, options.processes)
            )
    return 0 if min(scores) >= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
