"""The device that MuJoCo Warp steps legs on: a CUDA card, or the processor."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from fivebar_sim.errors import ArgumentError, ConfigError, ExtraError

CPU = "cpu-warp"
"""Warp's own processor backend: what a card does, without one."""

NAMES = re.compile(r"cpu-warp|cuda:\d+")


def check_name(device: object) -> str:
    """Return a device's name, without a look at whether it is there.

    Raises:
        ArgumentError: Not the name of a device.
    """
    if not isinstance(device, str) or not NAMES.fullmatch(device):
        raise ArgumentError(
            f'device must be None (MuJoCo on the processor), "{CPU}" or "cuda:N" with the number '
            f"of a card, got {device!r}"
        )
    return device


def opened(name: str) -> Any:
    """Return Warp's device of that name.

    Raises:
        ArgumentError: Not the name of a device.
        ExtraError: Warp or MuJoCo Warp is not installed.
        ConfigError: There is no such device here.
    """
    check_name(name)
    wp = warp()
    if name == CPU:
        return wp.get_device("cpu")

    cards = [str(card.alias) for card in wp.get_cuda_devices()]
    if name not in cards:
        there = f"here are {', '.join(cards)}" if cards else "Warp finds no CUDA card here"
        raise ConfigError(f'no device "{name}": {there}; "{CPU}" needs none')
    return wp.get_device(name)


def warp() -> Any:
    """Return the module `warp`, initialised without its greeting.

    Raises:
        ExtraError: Warp is not installed.
    """
    wp = _imported("warp")
    # It would greet, and warn of a missing driver.
    with wp.ScopedLogLevel(wp.LOG_ERROR):
        wp.init()
    return wp


@contextmanager
def on(device: Any) -> Iterator[None]:
    """Make a device the present one, without a line for each of some 150 kernels."""
    wp = warp()
    with wp.ScopedDevice(device), wp.ScopedLogLevel(wp.LOG_ERROR):
        yield


def mujoco_warp() -> Any:
    """Return the module `mujoco_warp`.

    Raises:
        ExtraError: It is not installed.
    """
    warp()
    return _imported("mujoco_warp")


def kernels(name: str = "kernels") -> Any:
    """Return a module of our own kernels, which cannot be imported without Warp."""
    warp()
    return importlib.import_module(f"fivebar_sim.warp.{name}")


def _imported(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ExtraError(
            f"a device needs MuJoCo Warp ({error}): pip install 'fivebar-sim[gpu]'"
        ) from error
