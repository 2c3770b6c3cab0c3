"""A leg in words: its preset, and what differs from it."""

from __future__ import annotations

import dataclasses
import math

from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar

MM = (1e3, " mm")
DEGREES = (180.0 / math.pi, " deg")
UNITS = {
    **dict.fromkeys(("L1", "L2", "L3", "L4", "L5", "L6", "radius", "foot_radius"), MM),
    **dict.fromkeys(("bend", "tilt"), DEGREES),
    "mass": (1e3, " g"),
    "com": MM,
    "com_across": MM,
    "inertia": (1e9, " g mm2"),
    "density": (1.0, " kg/m3"),
    "armature": (1e9, " g mm2"),
    "gravity": (1.0, " m/s2"),
}
"""Factor from SI and unit in which people read a leg's numbers."""

MOST = 4
"""Most differences that are told; of more, the others are counted."""


def leg_words(leg: FiveBar, rotor: float | None = None) -> str:
    """Return "classic leg", or "classic leg, L2 = 70 mm" where it differs from its preset.

    A leg without a name of its own is compared with the defaults; a user's own leg is its name.

    Args:
        leg: The leg.
        rotor: The servo's armature [kg m^2]: a leg that has it is not told to differ.
    """
    named = f"{leg.name} leg"
    preset = FiveBar()
    if leg.name in resources.shipped("models/legs"):
        preset = FiveBar.load(leg.name)
    elif leg.name != preset.name:
        return named

    keys = [field.name for field in dataclasses.fields(FiveBar)]
    differing = [key for key in keys if getattr(leg, key) != getattr(preset, key)]
    if leg.armature == rotor and "armature" in differing:
        differing.remove("armature")
    told = [f"{key} = {_shown(key, getattr(leg, key))}" for key in differing[:MOST]]
    if len(differing) > MOST:
        told.append(f"and {len(differing) - MOST} more")
    return ", ".join([named, *told])


def _shown(key: str, value: object) -> str:
    """Return the value of a leg's key with its unit."""
    scale, unit = UNITS.get(key, (1.0, ""))
    if isinstance(value, (int, float)):
        return f"{scale * value:.6g}{unit}"
    if isinstance(value, tuple):
        return f"({', '.join(f'{scale * each:.6g}' for each in value)}){unit}"
    return "none" if value is None else str(value)
