"""./.venv/bin/python scripts/bench_rollout.py: a whole run against raw mujoco.rollout of its steps.

Prints the time of a 10 s run at 1 ms with all its files, imports aside, as a multiple of
mujoco.rollout of the same steps in the same process; the median of several, and the peak memory.
"""

from __future__ import annotations

import resource
import statistics
import tempfile
import time
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

from fivebar_sim import rollout
from fivebar_sim.scenario import Scenario

RUNS = 7


def raw(planned: rollout.Plan) -> float:
    """Return the seconds that mujoco.rollout takes for the steps of a plan."""
    data = mujoco.MjData(planned.model)
    data.qpos[:] = planned.motion.q[0]
    state = np.empty(mujoco.mj_stateSize(planned.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(planned.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = time.perf_counter()
    mujoco.rollout.rollout(planned.model, data, state[None], planned.ctrl[None])
    return time.perf_counter() - start


def whole(scenario: Scenario, folder: Path) -> float:
    """Return the seconds of a run with all its files."""
    start = time.perf_counter()
    rollout.run(scenario).write(folder / "run")
    return time.perf_counter() - start


def ratio() -> tuple[float, float, float]:
    """Return the median seconds of the whole run and of the raw steps, and the median ratio."""
    scenario = Scenario.load("classic-ellipse", ["duration=10.0"])
    planned = rollout.plan(scenario)
    pairs = []
    with tempfile.TemporaryDirectory() as folder:
        whole(scenario, Path(folder))  # the imports
        for _ in range(RUNS):
            pairs.append((whole(scenario, Path(folder)), raw(planned)))

    wholes, raws = zip(*pairs, strict=True)
    return (
        statistics.median(wholes),
        statistics.median(raws),
        statistics.median(w / r for w, r in pairs),
    )


if __name__ == "__main__":
    run_time, raw_time, times = ratio()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"10 s run, all files: {run_time:.3f} s; raw mujoco.rollout: {raw_time:.3f} s")
    print(f"ratio {times:.1f} (bar: 10); peak memory {peak:.0f} MB (bar: 500)")
