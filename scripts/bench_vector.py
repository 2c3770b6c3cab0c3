"""Print how fast legs are as environments, beside what steps their physics.

.venv/bin/python scripts/bench_vector.py [--legs 64] [--robots 16] [--threads 2] [--resets 100000]

Physics steps a second: `Batch.step` alone with the same commands, the vector environment, one
Gymnasium and one dm_control environment, by turns in one run, medians. With --resets, resets of one
environment, and what memory they took. Of robots that learn to walk: the vector environment beside
Gymnasium's of single ones, one after the other, and beside plain `mj_step`s of all of them.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
import warnings
from collections.abc import Callable
from itertools import cycle
from typing import Any

import mujoco
import numpy as np
from gymnasium.vector import SyncVectorEnv
from mujoco.batch import Batch

from fivebar_sim import model, tasks
from fivebar_sim.arrays import Array
from fivebar_sim.gym import LegEnv
from fivebar_sim.robots import Floor
from fivebar_sim.tasks import legs as leg_group
from fivebar_sim.vector import LegVectorEnv
from fivebar_sim.walking.env import WalkEnv
from fivebar_sim.walking.episodes.vector import WalkVectorEnv

with warnings.catch_warnings():  # glfw's, where there is no screen
    warnings.simplefilter("ignore")
    from fivebar_sim import environment

Stepper = Callable[[], int]
ROWS = 64


def table(task: tasks.Task, legs: int) -> Array:
    """Return setpoints that keep each leg moving, (ROWS, legs, 2)."""
    low, high = task.bounds
    shake = np.random.default_rng(0).uniform(-0.1, 0.1, (ROWS, legs, 2))
    return 0.5 * (low + high) + 0.5 * (high - low) * shake


def alone(task: tasks.Task, legs: int, threads: int) -> Stepper:
    """Return what steps the physics of a control period, and says how many steps that is."""
    batch = Batch(leg_group.model_of(task), legs, threads)
    batch.qpos = leg_group.starts(task)[0]
    ctrl = batch.bind("ctrl")
    rows = cycle(table(task, legs))

    def step() -> int:
        ctrl[:] = next(rows)
        batch.step(nstep=task.every)
        return legs * task.every

    return step


def vector(task: tasks.Task, legs: int, threads: int) -> Stepper:
    """Return what steps a vector environment."""
    env = LegVectorEnv(task, legs, threads)
    rows = cycle(table(task, legs))
    env.reset(seed=0)

    def step() -> int:
        env.step(next(rows))
        return legs * task.every

    return step


def single(task: tasks.Task) -> Stepper:
    """Return what steps one Gymnasium environment."""
    env = LegEnv(task)
    rows = cycle(table(task, 1)[:, 0])
    env.reset(seed=0)

    def step() -> int:
        *_, terminated, truncated, _ = env.step(next(rows))
        if terminated or truncated:
            env.reset()
        return task.every

    return step


def dm_control(task: tasks.Task) -> Stepper:
    """Return what steps one dm_control environment."""
    env = environment.load(task, seed=0)
    rows = cycle(table(task, 1)[:, 0])
    env.reset()

    def step() -> int:
        env.step(next(rows))
        return task.every

    return step


def rate(step: Stepper, seconds: float = 0.15) -> float:
    """Return steps a second over a short time."""
    done = 0
    start = time.perf_counter()
    while time.perf_counter() < start + seconds:
        done += step()
    return done / (time.perf_counter() - start)


def show(kind: str, legs: int, threads: int, rounds: int = 15) -> None:
    """Print the rates of a task."""
    task = tasks.task(kind, spread=0.0, duration=100.0).resolved()  # one episode
    steppers = {
        "Batch.step alone": alone(task, legs, threads),
        "vector environment": vector(task, legs, threads),
        "one Gymnasium environment": single(task),
        "one dm_control environment": dm_control(task),
    }
    print(f"{kind}: {legs} legs, {threads} threads, {task.every} physics steps a control step")
    compare(steppers, rounds)


def compare(steppers: dict[str, Stepper], rounds: int) -> None:
    """Print the median rate of each by turns, and that of the vector environment over it."""
    rates: dict[str, list[float]] = {name: [] for name in steppers}
    for _ in range(rounds):
        for name, step in steppers.items():
            rates[name].append(rate(step))

    ours = rates["vector environment"]
    for name, found in rates.items():
        part = statistics.median(a / b for a, b in zip(ours, found, strict=True))
        print(f"  {name:28} {statistics.median(found):9,.0f} steps/s   vector / it: {part:.2f}")


def walking(robots: int, threads: int) -> dict[str, Stepper]:
    """Return what steps robots: our vector environment, Gymnasium's, and MuJoCo alone."""
    options: dict[str, Any] = {"span": 0.1, "duration": 100.0}
    ours = WalkVectorEnv("q8bot", robots, threads, **options)
    theirs = SyncVectorEnv([lambda: WalkEnv("q8bot", **options)] * robots)
    ours.reset(seed=0)
    theirs.reset(seed=0)
    task = ours.task
    shake = np.random.default_rng(0).uniform(-1.0, 1.0, (ROWS, robots, 8))
    built = model.build_robot(task.robot, Floor(), timestep=task.timestep)
    data = [mujoco.MjData(built) for _ in range(robots)]
    for each in data:
        mujoco.mj_resetDataKeyframe(built, each, built.key("stand").id)
    standing = data[0].ctrl.copy()

    def plain() -> int:
        row = next(rows)
        for each, own in zip(data, row, strict=True):
            each.ctrl[:] = standing + task.span * own
            mujoco.mj_step(built, each, task.every)
        return robots * task.every

    def of(env: Any) -> Stepper:
        actions = cycle(shake)

        def step() -> int:
            env.step(next(actions))
            return robots * task.every

        return step

    rows = cycle(shake)
    return {
        "vector environment": of(ours),
        "Gymnasium's SyncVectorEnv": of(theirs),
        "plain mj_step, one thread": plain,
    }


def show_resets(count: int) -> None:
    """Print how long resets take, and how the memory grew over them."""
    env = LegEnv("track")
    for _ in range(count // 10):
        env.reset()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    for _ in range(count):
        env.reset()
    seconds = time.perf_counter() - start
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(f"{count:,} resets: {1e6 * seconds / count:.0f} us each, peak memory +{grown} kB")


def main() -> None:
    """Print every task's rates, and the resets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--legs", type=int, default=64)
    parser.add_argument("--robots", type=int, default=16)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--resets", type=int, default=0)
    chosen = parser.parse_args()
    for kind in tasks.KINDS if chosen.legs else ():
        show(kind, chosen.legs, chosen.threads)
    if chosen.robots:
        print(f"walk: {chosen.robots} robots, {chosen.threads} threads")
        compare(walking(chosen.robots, chosen.threads), rounds=15)
    if chosen.resets:
        show_resets(chosen.resets)


if __name__ == "__main__":
    main()
