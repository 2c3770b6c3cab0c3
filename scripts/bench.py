"""How fast everything is, as a part of what a plain C loop over mj_step is on the same model.

.venv/bin/python scripts/bench.py [--short]

Steps a second of processor time, all threads together; medians of pairs that are timed by turns,
imports aside. The loop is scripts/bench_loop.c, built with the system's C compiler; without one it
is mujoco.rollout. --short takes some seconds, and fails if a goal that is met is missed by 30 %.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import mujoco.rollout
import numpy as np

from fivebar_sim import rollout, tasks
from fivebar_sim.arrays import Array
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.steps import Legs, simulate
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

Steps = Callable[[], int]
"""Takes some steps, and returns how many."""

HERE = Path(__file__).parent
SLACK = 0.7
"""Part of a goal that the short form fails below: other programs on a machine cost some speed."""


class Row(NamedTuple):
    """What is compared.

    Attributes:
        name: What takes the steps.
        goal: Part of the loop's speed that it should have.
        met: Whether it has had it; others are only printed.
        ours: Takes them.
        plain: Takes steps of the same model without anything else.
    """

    name: str
    goal: float
    met: bool
    ours: Steps
    plain: Steps


def built(folder: Path) -> ctypes.CDLL | None:
    """Return the C loop; None without a compiler, or where MuJoCo's library is not found."""
    compiler = shutil.which("cc")
    package = Path(mujoco.__file__).parent
    library = next(package.glob("libmujoco.so*"), None)
    if compiler is None or library is None:
        return None
    target = folder / "loop.so"
    options = ["-O2", "-shared", "-fPIC", f"-I{package / 'include'}", f"-Wl,-rpath,{package}"]
    source = HERE / "bench_loop.c"
    subprocess.run([compiler, *options, source, library, "-o", target], check=True)
    loop = ctypes.CDLL(str(target))
    loop.steps.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
    return loop


def looped(loop: ctypes.CDLL | None, planned: rollout.AnyPlan, ctrl: Array) -> Steps:
    """Return what takes a plan's steps and nothing else."""
    model = planned.model
    table = np.ascontiguousarray(ctrl)
    data = mujoco.MjData(model)

    def steps() -> int:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = planned.start
        if loop is not None:
            loop.steps(model._address, data._address, table.ctypes.data, len(table))
            return len(table)
        state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.rollout.rollout(model, data, state[None], table[None])
        return len(table)

    return steps


def runs(loop: ctypes.CDLL | None, name: str, seconds: float, folder: Path) -> Iterator[Row]:
    """Yield the physics of a scenario, its record and verdict, and the run with all its files."""
    settings = [f"duration={seconds}"]
    scenario = Scenario.load(name, settings)
    planned = rollout.plan(scenario)
    ctrl = planned.ctrl
    plain = looped(loop, planned, ctrl)

    def physics() -> int:
        return Legs(planned.model, planned.start[None]).advance(ctrl[None]).time.shape[1]

    def execute() -> int:
        return rollout.execute(planned).scenario.steps

    def whole() -> int:
        rollout.run(Scenario.load(name, settings)).write(folder / "run")
        return scenario.steps

    # On a ground the solver takes most of the time, with or without the rest.
    yield Row(f"physics, {name}", 1.15, name == "classic-ellipse", physics, plain)
    yield Row(f"record and verdict, {name}", 0.9, False, execute, plain)
    yield Row(f"run with all files, {name}", 0.55, False, whole, plain)


def robot(loop: ctypes.CDLL | None, name: str, settings: list[str]) -> Iterator[Row]:
    """Yield a robot's steps, all recorded; the record's columns and falls; and its verdict."""
    scenario = Scenario.load(name, settings)
    assert isinstance(scenario, RobotScenario)
    planned = plan_scenario(scenario)
    assert planned.setpoints is not None
    ctrl = np.concatenate([planned.besides, planned.setpoints], axis=1)
    plain = looped(loop, planned, ctrl)

    def physics() -> int:
        return simulate(planned.model, planned.start[None], ctrl[None]).time.shape[1]

    def recorded() -> int:
        return len(walk(planned).record["time"])

    def execute() -> int:
        return rollout.execute(planned).scenario.steps

    of = f"{name} {' '.join(settings[1:])}".strip()
    yield Row(f"robot's steps, {of}", 0.9, False, physics, plain)
    yield Row(f"and its record, {of}", 0.9, False, recorded, plain)
    yield Row(f"and its verdict, {of}", 0.9, False, execute, plain)


def asked(loop: ctypes.CDLL | None, legs: int, seconds: float, goal: float) -> Row:
    """Return legs with a controller that is asked in every step, on one thread."""
    settings = ["controller.name=pd", "limits={}", f"duration={seconds}"]
    plans = [
        rollout.plan(Scenario.load("classic-ellipse", [*settings, f"sim.seed={i}"]))
        for i in range(legs)
    ]
    record = rollout.execute(plans[0]).record
    ctrl = np.stack([record["ctrl_A"], record["ctrl_E"]], axis=-1)

    def ours() -> int:
        for _ in rollout._simulated(plans, 1):
            pass
        return legs * len(ctrl)

    who = "one leg" if legs == 1 else f"{legs} legs, one thread"
    return Row(f"pd asked every step, {who}", goal, True, ours, looped(loop, plans[0], ctrl))


def environment(legs: int, threads: int) -> Row:
    """Return the vector environment beside `Batch.step` with the same commands."""
    import bench_vector

    task = tasks.task("track", spread=0.0, duration=100.0).resolved()
    step = bench_vector.vector(task, legs, threads)
    plain = bench_vector.alone(task, legs, threads)
    name = f"environment, {legs} legs, {threads} threads, to Batch.step"
    return Row(name, 0.85, True, lambda: many(step), lambda: many(plain))


def many(step: Steps) -> int:
    """Take so many control steps that they can be timed."""
    return sum(step() for _ in range(30))


def rate(steps: Steps) -> float:
    """Return steps a second of processor time."""
    begun = time.process_time()
    count = steps()
    return count / (time.process_time() - begun)


def ratios(row: Row, rounds: int) -> list[float]:
    """Return ours over plain of every pair; the first pair, which warms both up, is thrown away."""
    return [rate(row.ours) / rate(row.plain) for _ in range(rounds + 1)][1:]


def main() -> int:
    """Print the table; return 1 if the short form finds a goal missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="some seconds, and a verdict")
    short = parser.parse_args().short
    rounds = 3 if short else 11
    seconds = 10.0
    missed = []

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        loop = built(folder)
        rows = [
            *runs(loop, "classic-ellipse", seconds, folder),
            *runs(loop, "treadmill-trot", seconds, folder),
            *robot(loop, "robot-q8bot-trot", ["duration=3"]),
            *robot(loop, "robot-q8bot-trot", ["duration=3", "robot.servo=ideal"]),
            asked(loop, 1, 2.0, 0.15),
            asked(loop, 64, 0.8, 0.9),
            environment(64, 2),
        ]
        print(
            f"to {'a C loop over mj_step' if loop else 'mujoco.rollout'}: median, least, most, goal"
        )
        for row in rows:
            found = ratios(row, rounds)
            median = statistics.median(found)
            low = short and row.met and median < SLACK * row.goal
            missed += [row.name] if low else []
            spread = f"{min(found):.2f} {max(found):.2f}"
            mark = "  MISSED" if low else ""
            print(f"{row.name:58} {median:.2f}   {spread}   {row.goal:.2f}{mark}", flush=True)

    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
