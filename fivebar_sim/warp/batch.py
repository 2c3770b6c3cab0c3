"""Plans on a device: checked first, then simulated together where they are alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States
from fivebar_sim.walking.plan import RobotPlan
from fivebar_sim.warp import device as devices
from fivebar_sim.warp import possible
from fivebar_sim.warp.legs import DeviceLegs
from fivebar_sim.warp.models import lean_models, structure


def simulated_on(
    device: str, plans: Sequence[Plan | RobotPlan]
) -> Iterator[tuple[list[int], States]]:
    """Yield the states of some steps of some plans after the other, with the plans' indices.

    Args:
        device: "cuda:0", "cpu-warp".
        plans: The plans.

    Raises:
        ArgumentError: Not the name of a device.
        ConfigError: A plan that no device can run, no such device, or too little memory on it.
        ExtraError: MuJoCo Warp is not installed.
    """
    devices.check_name(device)
    legs = [possible.checked(planned) for planned in plans]
    there = devices.opened(device)
    for rows in _groups(legs):
        for states in simulated([legs[i] for i in rows], there):
            yield rows, states


def simulated(plans: Sequence[Plan], device: Any) -> Iterator[States]:
    """Yield the states of some steps after the other of plans that are alike.

    Args:
        plans: Plans of one structure, length and timestep, without feedback.
        device: Warp's device.
    """
    start = np.stack([planned.start for planned in plans])
    legs = DeviceLegs([planned.model for planned in plans], start, device)
    steps = plans[0].scenario.steps
    for begin in range(0, steps, legs.length):
        rows = slice(begin, min(begin + legs.length, steps))
        yield legs.advance(np.stack([each.commands(rows) for each in plans]), begin)


def _groups(plans: Sequence[Plan]) -> list[list[int]]:
    """Return the indices of plans that are alike."""
    shorts = lean_models([planned.model for planned in plans])
    groups: dict[tuple[Any, ...], list[int]] = {}
    for i, (planned, short) in enumerate(zip(plans, shorts, strict=True)):
        alike = (planned.scenario.steps, planned.motion.timestep, structure(short))
        groups.setdefault(alike, []).append(i)
    return list(groups.values())
