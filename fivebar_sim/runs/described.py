"""The unit of each column of a record, and what it is: Parquet's fields say so too."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

AXES = {"x": "x, forward", "y": "y, to the left", "z": "z, up"}


class Described(NamedTuple):
    """What a column is.

    Attributes:
        unit: Its SI unit; "" for pure numbers.
        description: A sentence.
    """

    unit: str
    description: str


KINDS = (
    (r"time", "s", "time at the end of the step"),
    (r"target_([xz])", "m", "where the foot should be, hip frame, {axis}"),
    (r"foot_([xz])", "m", "where the foot is, hip frame, {axis}"),
    (r"theta_([AE])", "rad", "angle of motor {0}, anticlockwise from the hip frame's x"),
    (r"theta_([BD])", "rad", "angle of the knee {0} against the link before it"),
    (r"theta_S", "rad", "angle of the hip's motor S, which swings the foot to the left"),
    (r"theta_T", "rad", "angle of the hip's motor T, which steers the leg to the left"),
    (r"theta_dot_([ABEDST])", "rad/s", "rate of the joint {0}"),
    (r"ctrl_([ST])", "rad", "command to motor {0}"),
    (r"ctrl_([AE])", "rad or N m", "command to motor {0}: a setpoint, or a torque"),
    (r"torque_([AEST])", "N m", "torque that motor {0} gave in the step"),
    (r"friction_([AE])", "N m", "torque of motor {0}'s gear friction on its joint"),
    (r"gap", "m", "distance between the two ends that the loop joins at C"),
    (r"hip_z", "m", "height of the hip above the floor"),
    (r"hip_dot_z", "m/s", "rate of the hip's height"),
    (r"ground_([xyz])", "N", "force of the ground on the foot, {axis}"),
    (r"rail_end", "N", "force of the rail's lower end on the trunk, upwards"),
    (r"belt_x", "m", "how far the belt has run"),
    (r"trunk_([xyz])", "m", "where the trunk is, {axis}"),
    (r"trunk_q([wxyz])", "", "orientation of the trunk, component {0} of a unit quaternion"),
    (r"trunk_dot_([xyz])", "m/s", "velocity of the trunk, {axis}"),
    (r"trunk_w([xyz])", "rad/s", "turning rate of the trunk, about its own {0}"),
)
"""Patterns of names, with their units and what they are."""

LEGS = {
    "FL_": "front left leg: ",
    "FR_": "front right leg: ",
    "RL_": "rear left leg: ",
    "RR_": "rear right leg: ",
}
"""Prefixes of a robot's legs."""


def described(name: str) -> Described | None:
    """Return what a column is; None for one that records have not."""
    leg = LEGS.get(name[:3], "")
    own = name[3:] if leg else name
    for pattern, unit, text in KINDS:
        found = re.fullmatch(pattern, own)
        if found:
            letters = found.groups()
            axis = AXES.get(letters[0], "") if letters else ""
            return Described(unit, leg + text.format(*letters, axis=axis))
    return None


def metadata(names: Iterable[str]) -> dict[str, dict[bytes, bytes]]:
    """Return the metadata of Parquet's fields, by name: `unit` and `description`."""
    found = {name: described(name) for name in names}
    return {
        name: {b"unit": each.unit.encode(), b"description": each.description.encode()}
        for name, each in found.items()
        if each is not None
    }
