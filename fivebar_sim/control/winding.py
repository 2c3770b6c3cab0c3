"""What a servo's table says about its motor's winding: which keys go together, in which range."""

from __future__ import annotations

from typing import Protocol

from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.heat import Cooling, Winding
from fivebar_sim.errors import ArgumentError

SMALLEST = 1e-6
LARGEST = 1e6
"""Ends of the range of every amount, so that no heat overflows."""

COLDEST = -273.15
"""Absolute zero [deg C]."""


class Motor(Protocol):
    """The keys of a servo that describe its winding; see `Servo`."""

    @property
    def kt(self) -> float | None:
        """Torque per current at the output [N m/A]."""
        ...

    @property
    def resistance(self) -> float | None:
        """Of the winding [ohm]."""
        ...

    @property
    def thermal_resistance(self) -> float | None:
        """From the winding to the air [K/W]."""
        ...

    @property
    def thermal_time(self) -> float | None:
        """Time constant of its temperature [s]."""
        ...

    @property
    def temperature_max(self) -> float | None:
        """What it bears for good [deg C]."""
        ...

    @property
    def ambient(self) -> float:
        """Temperature of the air [deg C]."""
        ...


ELECTRIC = {"kt": "N m/A", "resistance": "ohm"}
"""What the copper heat follows from, with units."""

THERMAL = {"thermal_resistance": "K/W", "thermal_time": "s", "temperature_max": "deg C"}
"""What the temperature follows from, with units."""


def check(motor: Motor) -> None:
    """Raise unless the keys of a winding are complete and in range.

    Raises:
        ArgumentError: A key without those that belong to it, or a value out of range.
    """
    _check_together(motor, ELECTRIC)
    _check_together(motor, THERMAL)
    if motor.thermal_resistance is not None and motor.kt is None:
        raise ArgumentError("thermal_resistance needs kt beside it: torque per current [N m/A]")

    check_number("ambient", motor.ambient, "deg C", low=COLDEST, high=LARGEST)
    for name, unit in (ELECTRIC | THERMAL).items():
        value = getattr(motor, name)
        if value is None:
            continue
        if name == "temperature_max":
            check_number(name, value, unit, low=motor.ambient, high=LARGEST, strict=True)
        else:
            check_number(name, value, unit, low=SMALLEST, high=LARGEST)


def _check_together(motor: Motor, names: dict[str, str]) -> None:
    """Raise if some of the keys are given and others are not."""
    missing = [name for name in names if getattr(motor, name) is None]
    given = [name for name in names if name not in missing]
    if given and missing:
        raise ArgumentError(f"{given[0]} needs {missing[0]} beside it [{names[missing[0]]}]")


def winding(motor: Motor) -> Winding | None:
    """Return the winding of a servo's motor; None where its table does not describe it."""
    if motor.kt is None or motor.resistance is None:
        return None
    return Winding(motor.kt, motor.resistance, _cooling(motor))


def _cooling(motor: Motor) -> Cooling | None:
    amounts = (motor.thermal_resistance, motor.thermal_time, motor.temperature_max)
    resistance, time, hottest = amounts
    if resistance is None or time is None or hottest is None:
        return None
    return Cooling(resistance, time, hottest, motor.ambient)
