"""Setpoints in the unit that a controller sends: angles, counts, microseconds, whole degrees."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, first_index
from fivebar_sim.control import hobby
from fivebar_sim.errors import ArgumentError, ConfigError, UnreachableError, unknown
from fivebar_sim.geometry import FiveBar

UNITS = ("rad", "deg", "count", "us", "published-rounded", "published-truncated")
"""The units of a table.

rad, deg: the motor angles themselves. count, us: what a servo takes, by the servo table.
published-...: 90 deg + angle in whole degrees, as published hobby controllers send it; one rounds,
the other cuts the fraction off, towards 0.
"""

TURN_4096 = (0.0, hobby.TURN * 4095.0 / 4096.0)
"""Range of a bus servo with 4096 counts a turn [rad]."""

XL330 = hobby.ServoTable(
    hobby.HobbyServo(1.75 * math.pi, 1, TURN_4096, hobby.TURN / 4096.0),
    hobby.HobbyServo(1.25 * math.pi, 1, TURN_4096, hobby.TURN / 4096.0),
)
"""Count 2048, half a turn, where the cranks point 45 deg outwards and down."""

SERVOS = {"hanging": hobby.HANGING, "published": hobby.PUBLISHED, "xl330": XL330}
"""The servo tables by name."""

COUNTS = {"hanging": (0, 180), "published": (0, 180), "xl330": (0, 4095)}
"""First and last count of a servo's range: whole degrees, or 4096 a turn."""

PULSES = (500, 2500)
"""The usual pulses at the ends of a hobby servo's range [us]."""

SENT = ("count", "us")
"""The units that servos take."""

LARGEST = 1_000_000
"""Largest command."""

TIE = 1e-9
"""How far below a whole degree an angle still counts as that degree [deg]."""


class Commands(NamedTuple):
    """A table's numbers.

    Attributes:
        values: Of the servos at A and E, floats or whole numbers, (n, 2).
        unit: One of `UNITS`.
        said: What the numbers are, as a line.
    """

    values: Array | NDArray[np.int64]
    unit: str
    said: str


def commands(
    leg: FiveBar,
    theta: Array,
    unit: str,
    *,
    servos: str = "hanging",
    ends: tuple[int, int] | None = None,
) -> Commands:
    """Return motor angles in a unit.

    Args:
        leg: The leg; only its tilt is used.
        theta: (theta_A, theta_E) [rad], (n, 2).
        unit: One of `UNITS`.
        servos: One of `SERVOS`, for counts and microseconds.
        ends: First and last command of the servo's range; None: `COUNTS` or `PULSES`.

    Raises:
        ConfigError: An unknown unit or servo table, or commands that do not grow.
        UnreachableError: An angle that is out of a servo's range.
    """
    if unit not in UNITS:
        raise ConfigError(unknown("unit", unit, UNITS))
    if servos not in SERVOS:
        raise ConfigError(unknown("servo table", servos, SERVOS))

    if unit == "rad":
        return Commands(theta, unit, "motor angles [rad]")
    if unit == "deg":
        return Commands(np.degrees(theta), unit, "motor angles [deg]")
    if unit in SENT:
        usual = COUNTS[servos] if unit == "count" else PULSES
        return _servo(leg, theta, unit, servos, usual if ends is None else ends)
    return _published(leg, theta, unit)


def _servo(leg: FiveBar, theta: Array, unit: str, servos: str, ends: tuple[int, int]) -> Commands:
    """Return the whole commands of servos."""
    first, last = ends
    if not -LARGEST <= first < last <= LARGEST:
        raise ConfigError(
            f"--ends must be two whole numbers that grow, within {LARGEST} of 0, got {first} {last}"
        )
    table = SERVOS[servos]
    sides = {}
    for side in ("A", "E"):
        servo = getattr(table, side)
        width = servo.range[1] - servo.range[0]
        sides[side] = dataclasses.replace(servo, resolution=width / (last - first))

    low = np.array([servo.range[0] for servo in sides.values()])
    step = np.array([servo.resolution for servo in sides.values()])
    angles = hobby.servo_angles(leg, theta, hobby.ServoTable(**sides))
    values = first + np.rint((angles - low) / step).astype(np.int64)
    return Commands(values, unit, f"servo commands, {first} to {last}: servo table {servos!r}")


def _published(leg: FiveBar, theta: Array, unit: str) -> Commands:
    """Return 90 deg + angle in whole degrees, 0 to 180."""
    degrees = np.degrees(theta - leg.tilt)
    if unit == "published-truncated":
        # An angle that is meant to be a whole degree stays one, whatever its rounding.
        whole = np.trunc(degrees + np.copysign(TIE, degrees))
        how = "cut off towards 0"
    else:
        whole = np.floor(degrees + 0.5 + TIE)
        how = "rounded"

    values = 90 + whole.astype(np.int64)
    beyond = (values < 0) | (values > 180)
    if beyond.any():
        row, side = first_index(beyond)
        raise UnreachableError(
            f"90 deg + angle must be in [0, 180] deg at {'AE'[side]}, got {values[row, side]} deg "
            f"in row {row}: it fits legs that stand upright; others need unit count or us",
            (row,),
        )
    return Commands(values, unit, f"90 deg + angle in whole degrees, {how}")


def check_ends(unit: str, ends: tuple[int, int] | None) -> None:
    """Raise if a unit has no use for a range of commands."""
    if ends is not None and unit not in SENT:
        raise ArgumentError(f"--ends is for the units {' and '.join(SENT)}, got {unit}")
