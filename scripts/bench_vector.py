"""Print how fast legs are as environments, beside what steps their physics.

.venv/bin/python scripts/bench_vector.py [--legs 64] [--threads 2] [--resets 100000]

Physics steps a second: `Batch.step` alone with the same commands, the vector environment, one
Gymnasium and one dm_control environment, by turns in one run, medians. With --resets, resets of one
environment, and what memory they took.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
import warnings
from collections.abc import Callable
from itertools import cycle

import numpy as np
from mujoco.batch import Batch

from fivebar_sim import tasks
from fivebar_sim.arrays import Array
from fivebar_sim.gym import LegEnv
from fivebar_sim.tasks import legs as leg_group
from fivebar_sim.vector import LegVectorEnv

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
    rates: dict[str, list[float]] = {name: [] for name in steppers}
    for _ in range(rounds):
        for name, step in steppers.items():
            rates[name].append(rate(step))

    print(f"{kind}: {legs} legs, {threads} threads, {task.every} physics steps a control step")
    ours = rates["vector environment"]
    for name, found in rates.items():
        part = statistics.median(a / b for a, b in zip(ours, found, strict=True))
        print(f"  {name:28} {statistics.median(found):9,.0f} steps/s   vector / it: {part:.2f}")


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
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--resets", type=int, default=0)
    chosen = parser.parse_args()
    for kind in tasks.KINDS:
        show(kind, chosen.legs, chosen.threads)
    if chosen.resets:
        show_resets(chosen.resets)


if __name__ == "__main__":
    main()
