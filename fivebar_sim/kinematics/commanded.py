"""Whether what motors were sent can be the commands of where they went: `check_commands`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError

FAR = 0.5
"""RMS from which on commands and angles are worth a guess [rad]."""

BETTER = 0.2
"""What part of that must be left of it with a mistake undone."""


def check_commands(theta: Array, ctrl: Array, where: str) -> None:
    """Raise if commands are far from the angles, and would be near with a mistake undone.

    Args:
        theta: (theta_A, theta_E) as measured [rad], (n, 2).
        ctrl: What was sent [rad], (n, 2).
        where: The log, for messages.

    Raises:
        ConfigError: Says how far, and guesses why: motors swapped, degrees read as radians, other
            signs or zeros than the angles'.
    """
    there = np.isfinite(theta).all(axis=-1) & np.isfinite(ctrl).all(axis=-1)
    theta = theta[there]
    ctrl = ctrl[there]
    if not len(theta):
        return
    apart = _rms(ctrl - theta)
    if apart <= FAR:
        return

    for said, undo in _mistakes():
        left = _rms(undo(ctrl, theta) - theta)
        if left < BETTER * apart:
            raise ConfigError(
                f"{where}: commands and angles are {_deg(apart)} apart (RMS), too far for a motor "
                f"that follows; a guess, since {_deg(left)} would then be left: {said}"
            )


def _mistakes() -> Iterator[tuple[str, Callable[[Array, Array], Array]]]:
    """Yield what commands are often read wrongly by, and what undoes it."""
    yield "A and E swapped: exchange ctrl_A and ctrl_E", lambda u, _: u[:, ::-1]
    yield (
        "commands in degrees read as radians, a factor of 57.3: unit = 'deg' for both",
        lambda u, _: np.radians(u),
    )
    yield (
        "commands in radians read as degrees, a factor of 57.3: unit = 'rad' for both",
        lambda u, _: np.degrees(u),
    )

    yield "commands that count clockwise: sign = -1 for both", lambda u, _: -u
    yield (
        "commands with other zeros than the angles: the same offset for both",
        lambda u, q: u - np.median(u - q, axis=0),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _deg(angle: float) -> str:
    return units.text(float(np.degrees(angle)), "deg", 3)
