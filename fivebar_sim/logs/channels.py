"""What a log may hold, and the units that its columns may be written in.

A channel has a name, such as theta_A, and an SI unit, in which the reader returns it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from fivebar_sim.errors import ConfigError
from fivebar_sim.files.quantities import SIZES as QUANTITIES
from fivebar_sim.files.quantities import TURN

Channels = Mapping[str, str]
"""SI units by the names of channels."""

LEG: Channels = {
    "time": "s",
    "theta_A": "rad",
    "theta_E": "rad",
    "theta_dot_A": "rad/s",
    "theta_dot_E": "rad/s",
    "torque_A": "N m",
    "torque_E": "N m",
    "current_A": "A",
    "current_E": "A",
    "ctrl_A": "rad",
    "ctrl_E": "rad",
    "foot_x": "m",
    "foot_z": "m",
    "voltage": "V",
}
"""What a leg's log may hold. ctrl is what the motors were sent: the commanded angles."""

PATH: Channels = {"time": "s", "x": "m", "z": "m"}
"""What a foot path needs."""

FORCE: Channels = {"time": "s", "x": "N", "z": "N"}
"""What a force on the foot needs."""

SIZES: dict[str, dict[str, float]] = {
    **QUANTITIES,
    "s": {**QUANTITIES["s"], "ns": 1e-9, "min": 60.0},
    "rad": {**QUANTITIES["rad"], "rev": TURN},
    "rad/s": {**QUANTITIES["rad/s"], "turn/s": TURN, "rev/s": TURN},
    "A": {"uA": 1e-6, "mA": 1e-3, "A": 1.0},
    "V": {"mV": 1e-3, "V": 1.0},
}
"""The units of each SI unit, with their sizes in it."""

UNIT = re.compile(r"(?:(?P<times>\d+\.?\d*(?:[eE][+-]?\d+)?)\s+)?(?P<name>\S.*?)(?:/(?P<by>\d+))?")
"""A unit, perhaps with a number in front or a whole number to divide by behind."""

UNITS_SAID = 'a number may stand in front ("0.229 rpm"), a divisor behind ("turn/4096")'


def size(text: str, unit: str, what: str) -> float:
    """Return how large a unit is in an SI unit.

    Args:
        text: "deg", "turn/4096" for counts of an encoder, "0.229 rpm"; "" for the SI unit itself.
        unit: The SI unit.
        what: What has the unit, for messages.

    Raises:
        ConfigError: Another unit.
    """
    found = UNIT.fullmatch(" ".join(text.replace("µ", "u").replace("°", "deg").split()))
    sizes = SIZES[unit]
    if not text:
        return 1.0
    if found is None or found["name"] not in sizes or found["by"] == "0":
        legal = ", ".join(sizes)
        raise ConfigError(f"{what}: unit must be one of {legal}; {UNITS_SAID}; got {text!r}")
    times = float(found["times"] or 1.0)
    return times * sizes[found["name"]] / float(found["by"] or 1.0)
