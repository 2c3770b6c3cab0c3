"""How many legs fit into a device's memory."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from typing import Any

import mujoco

from fivebar_sim.errors import ConfigError
from fivebar_sim.warp.device import mujoco_warp, on, warp
from fivebar_sim.warp.models import most_rows

SCRATCH = 3.0
"""What a step takes while it lasts, beside the legs' data that stays, with it: in its size."""

FLOAT = 4
"""Bytes of a number."""


def data_of(model: mujoco.MjModel, n: int) -> Any:
    """Return the state of some legs on the present device, with room for what can act on one."""
    rows = most_rows(model)
    # One contact: only the foot touches anything, a floor.
    return mujoco_warp().make_data(model, nworld=n, nconmax=1, njmax=rows)


def check_fits(model: mujoco.MjModel, n: int, numbers: int, device: Any) -> None:
    """Raise unless legs fit into what is free of a device's memory.

    Args:
        model: A leg's model.
        n: The number of legs.
        numbers: Numbers that are sent and recorded at once, of a leg.
        device: Warp's device.

    Raises:
        ConfigError: They do not fit; says how many do.
    """
    one = SCRATCH * bytes_of_leg(model) + FLOAT * numbers
    free = free_bytes(device)
    if n * one > free:
        raise ConfigError(
            f"{n} legs need {n * one / 1e9:.3g} GB on device {device.alias}, which has "
            f"{free / 1e9:.3g} GB free: {int(free // one)} legs fit"
        )


def bytes_of_leg(model: mujoco.MjModel) -> int:
    """Return what a leg's state takes on a device [bytes]."""
    # Made on the processor: there is room for two legs.
    with on("cpu"):
        one, two = (sum(each.capacity for each in _arrays(data_of(model, n))) for n in (1, 2))
    return two - one


def free_bytes(device: Any) -> int:
    """Return how much of a device's memory is free [bytes]."""
    if device.is_cuda:
        return int(device.free_memory)
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            (line,) = (line for line in file if line.startswith("MemAvailable:"))
        return 1024 * int(line.split()[1])
    # Another system than Linux: all of the memory that it has, or no limit that is known.
    except OSError:
        pages = getattr(os, "sysconf", lambda name: 2**62)("SC_PHYS_PAGES")
        return int(pages) * 4096


def _arrays(owner: Any) -> Iterator[Any]:
    """Yield Warp's arrays of a dataclass, and of those within it."""
    for field in dataclasses.fields(owner):
        value = getattr(owner, field.name)
        if dataclasses.is_dataclass(value):
            yield from _arrays(value)
        elif isinstance(value, warp().array):
            yield value
