"""Print how fast legs are on a device, and how far from the independent reference.

.venv/bin/python scripts/bench_gpu.py [--device cuda:0] [--legs 1024 8192 32768 131072]

The bars of docs/validation.md on the device: torque, its share, energy, loop gap and foot, against
tests/oracle.py. Then physics steps a second of all legs, in the air (`track`) and on the treadmill
(`gait`): physics alone, and the vector environment with actions that lie on the device; beside them
the processor's vector environment. Needs the extra `gpu`; kernels are compiled first, for minutes.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import validation_air as air
import validation_stance as stance
from validation_air import Key

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim import tasks
from fivebar_sim.rollout import plan, run_all
from fivebar_sim.scenario import Scenario
from fivebar_sim.tasks.legs import model_of, starts
from fivebar_sim.warp import device as devices
from fivebar_sim.warp.memory import data_of
from fivebar_sim.warp.models import lean_models, put
from fivebar_sim.warp.stepping import take_step

KINDS = {"air": "track", "treadmill": "gait"}
ROWS = 16
"""Different actions, by turns."""
GRAPH = 50
"""Steps of physics alone that are launched together."""
BESIDE = 64
"""Legs of the processor's environment."""


def rate(step: Callable[[], int], wait: Callable[[], Any], seconds: float) -> float:
    """Return steps a second; the device is waited for at the beginning and at the end."""
    step()
    wait()
    done = 0
    start = time.perf_counter()
    while time.perf_counter() < start + seconds:
        # Some calls at once, so that the clock is not asked too often, nor the queue too long.
        done += sum(step() for _ in range(4))
        wait()
    return done / (time.perf_counter() - start)


def alone(kind: str, n: int, device: Any) -> Callable[[], int]:
    """Return what steps the physics of n legs at rest, with setpoints that hold them."""
    task = tasks.task(kind).resolved()
    shorts = lean_models([model_of(task)], forces=False) * n
    wp = devices.warp()
    with devices.on(device):
        model = put(shorts, device)
        data = data_of(shorts[0], n)
        pose = starts(task)[0].astype(np.float32)
        data.qpos.assign(np.tile(pose, (n, 1)))
        data.ctrl.assign(np.tile(pose[-4::2], (n, 1)))
        take_step(model, data)
        with wp.ScopedCapture() as capture:
            for _ in range(GRAPH):
                take_step(model, data)

    def step() -> int:
        with devices.on(device):
            wp.capture_launch(capture.graph)
        return GRAPH * n

    return step


def actions(task: tasks.Task, n: int) -> Any:
    """Return setpoints that keep each leg moving, (ROWS, n, 2)."""
    low, high = task.bounds
    shake = np.random.default_rng(0).uniform(-0.1, 0.1, (ROWS, n, 2))
    return (0.5 * (low + high) + 0.5 * (high - low) * shake).astype(np.float32)


def episodes(kind: str, n: int, name: str | None) -> Callable[[], int]:
    """Return what steps a vector environment with actions that lie where it is."""
    where: dict[str, Any] = {"nthread": 0} if name is None else {"device": name}
    envs: Any = gymnasium.make_vec(f"fivebar/{kind.capitalize()}-v0", num_envs=n, **where)
    task = envs.unwrapped.task
    rows = list(actions(task, n))
    if name is not None:
        with devices.on(devices.opened(name)):
            rows = [devices.warp().array(row) for row in rows]
    envs.reset(seed=0)
    count = 0

    def step() -> int:
        nonlocal count
        envs.step(rows[count % ROWS])
        count += 1
        return task.every * n

    return step


def show_rates(name: str, legs: list[int], seconds: float) -> None:
    """Print steps a second."""
    device = devices.opened(name)
    wp = devices.warp()

    def wait() -> None:
        wp.synchronize_device(device)

    print(f"steps/s of all legs on {device.name} ({name})")
    print(f"{'scene':10}{'legs':>8}{'physics':>14}{'make_vec':>14}{'part':>7}")
    for scene, kind in KINDS.items():
        for n in legs:
            physics = rate(alone(kind, n, device), wait, seconds)
            whole = rate(episodes(kind, n, name), wait, seconds)
            print(
                f"{scene:10}{n:8,}{physics:14,.0f}{whole:14,.0f}{whole / physics:7.2f}", flush=True
            )

        beside = rate(episodes(kind, BESIDE, None), lambda: None, seconds)
        print(f"{scene:10}{BESIDE:8,}{'':14}{beside:14,.0f}   processor, {os.cpu_count()} threads")


def show_validation(name: str, presets: list[str]) -> None:
    """Print how far the device is from the reference, `discrete` at 1 ms, velocity feedforward."""
    print("\noff the independent reference at 1 ms; worse of A and E")
    print(f"{'run':22}{'on':>10}{'torque RMS':>12}{'late':>9}{'share':>10}{'foot':>10}{'gap':>9}")
    for preset in presets:
        key = Key(preset, "discrete", "velocity", 1e-3)
        for where in (name, None):
            e = air.measure([key], device=where)[key]
            show_row(f"{preset}, air", where, e.rms, e.late, e.share, e.foot, e.gap)
        if preset in stance.HANGING:
            for where in (name, None):
                s = stance.measure(key, device=where)
                show_row(f"{preset}, squat", where, s.rms, s.late, None, s.hip, s.gap)


def show_row(
    run: str,
    where: str | None,
    rms: float,
    late: float,
    share: float | None,
    foot: float,
    gap: float,
) -> None:
    """Print a row of the validation; a squat's foot is its hip's height."""
    part = "" if share is None else f"{100 * share:.3f} pp"
    print(
        f"{run:22}{where or 'processor':>10}{100 * rms:10.4f} %{100 * late:7.3f} %"
        f"{part:>10}{1e6 * foot:7.2f} um{1e6 * gap:6.2f} um",
        flush=True,
    )


def show_energy(name: str) -> None:
    """Print the energy that the motors gave in a scenario, on the device and on the processor."""
    planned = plan(Scenario.load("classic-ellipse"))
    there = run_all([planned], device=name)[0].metrics["energy"]
    here = run_all([planned])[0].metrics["energy"]
    print("\nenergy of classic-ellipse, device / processor")
    for key, value in here.items():
        if isinstance(value, float) and value:
            print(f"  {key:30}{there[key]:14.6g}{value:14.6g}{there[key] / value - 1.0:10.1e}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cuda:0", help='"cuda:0" or "cpu-warp"')
    parser.add_argument("--legs", type=int, nargs="+", default=[1024, 8192, 32768, 131072])
    parser.add_argument("--seconds", type=float, default=3.0, help="of each rate")
    parser.add_argument("--presets", nargs="+", default=list(air.PRESETS))
    chosen = parser.parse_args()
    start = time.perf_counter()
    devices.opened(chosen.device)

    show_validation(chosen.device, chosen.presets)
    show_energy(chosen.device)
    show_rates(chosen.device, chosen.legs, chosen.seconds)
    print(f"\nin {time.perf_counter() - start:.0f} s, kernels compiled and all")


if __name__ == "__main__":
    main()
