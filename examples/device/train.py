"""python train.py hop [--device cuda:0] [--legs 4096] [--generations 40]: see README.md."""
# ruff: noqa: T201 - it prints what it measured

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

import cma
import gymnasium
import numpy as np
import warp as wp

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim.control.servo import Servo

HARMONICS = 4
WEIGHTS = 2 * (2 * HARMONICS + 1)
SIGMA = 0.15  # [rad], the first policies' deviation
EXCESS = 1.0  # what a square radian beyond the bounds costs, per control step


@wp.kernel
def add(
    reward: wp.array[float],
    terminated: wp.array[bool],
    alive: wp.array[float],
    total: wp.array[float],
):
    """Add a step's rewards of the legs whose first episode goes on."""
    leg = wp.tid()
    total[leg] = total[leg] + alive[leg] * reward[leg]
    if terminated[leg]:
        alive[leg] = 0.0


def wished(weights: np.ndarray, phase: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return the setpoints of policies [rad], (steps, n, 2): Fourier series of the task's clock.

    Weights (n, WEIGHTS) are a_0, a_1.., b_1.. of A and E by turns, phase is (cos, sin), (steps, 2).
    """
    turns = (phase @ np.array([1.0, 1.0j]))[:, None] ** np.arange(HARMONICS + 1)
    waves = np.concatenate([turns.real, turns.imag[:, 1:]], axis=1)
    return middle + np.einsum("sf,nfk->snk", waves, weights.reshape(len(weights), -1, 2))


def tried(envs: Any, weights: np.ndarray, seed: int) -> np.ndarray:
    """Return the rewards of policies, a leg each, all from the start of one seed, (n,).

    The whole episode's setpoints go to the device at once, and one sum a leg comes back.
    """
    task = envs.unwrapped.task
    low, high = task.bounds
    phase = task.targets()["phase"][:-1]
    wish = wished(weights, phase, 0.5 * (low + high))
    seen, _ = envs.reset(seed=[seed] * len(weights))
    table = wp.array(np.clip(wish, low, high), dtype=float, device=seen.device)
    n = len(weights)
    alive = wp.ones(n, dtype=float, device=table.device)
    total = wp.zeros(n, dtype=float, device=table.device)

    for k in range(task.periods):
        _, reward, terminated, _, _ = envs.step(table[k])
        wp.launch(add, n, inputs=[reward, terminated, alive, total], device=table.device)

    beyond = wish - np.clip(wish, low, high)
    excess = (beyond**2).sum(axis=2).mean(axis=0)
    return total.numpy() / task.periods - EXCESS * excess


def main(given: Sequence[str] | None = None) -> None:
    """Train, and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=["track", "hop"])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--legs", type=int, default=4096)
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(given)

    servo = Servo(limit=1.0) if chosen.task == "hop" else Servo()
    envs = gymnasium.make_vec(
        f"fivebar/{chosen.task.capitalize()}-v0",
        num_envs=chosen.legs,
        device=chosen.device,
        duration=2.0,
        servo=servo,
    )
    options = {"popsize": chosen.legs, "seed": chosen.seed + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(WEIGHTS * [0.0], SIGMA, options)
    start = time.perf_counter()

    for age in range(1, chosen.generations + 1):
        weights = np.array(search.ask())
        rewards = tried(envs, weights, chosen.seed)
        search.tell(weights, -rewards)
        if age % 5 == 0 or age in (1, chosen.generations):
            best = rewards.max()
            print(f"{age:5d}  best {best:6.3f}  mean {rewards.mean():6.3f}", flush=True)

    steps = chosen.generations * chosen.legs * envs.unwrapped.task.periods
    seconds = time.perf_counter() - start
    print(f"{steps} control steps in {seconds:.0f} s")


if __name__ == "__main__":
    main()
