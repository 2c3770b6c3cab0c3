"""The columns of a robot's record: the trunk's, and those of each leg with its name in front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import COLUMNS, FRICTION_COLUMNS, Record, side_by_side
from fivebar_sim.robots.floor import Floor, Scene
from fivebar_sim.robots.hips.motors import QUANTITIES, HipMotor, column
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.robot import LEGS

POSITION_COLUMNS = ("trunk_x", "trunk_y", "trunk_z")
"""Where the trunk's origin is in the world [m]."""

QUATERNION_COLUMNS = ("trunk_qw", "trunk_qx", "trunk_qy", "trunk_qz")
"""How the trunk is turned."""

VELOCITY_COLUMNS = ("trunk_dot_x", "trunk_dot_y", "trunk_dot_z")
"""Velocity of the trunk's origin in the world [m/s]."""

TURNING_COLUMNS = ("trunk_wx", "trunk_wy", "trunk_wz")
"""Rates of the trunk about its own axes, as a gyroscope on it has them [rad/s]."""

TRUNK_COLUMNS = (*POSITION_COLUMNS, *QUATERNION_COLUMNS, *VELOCITY_COLUMNS, *TURNING_COLUMNS)
"""All of a trunk that moves, in the order of qpos, then of qvel."""

FORCE_COLUMNS = ("ground_x", "ground_y", "ground_z")
"""The floor's force on a foot, along the world's axes [N]."""


def columns(scene: Scene, *, motors: Sequence[HipMotor] = (), rubbed: bool = False) -> list[str]:
    """Return the columns of a robot's record in a scene, in their order.

    Args:
        scene: What it stands on.
        motors: Those of its hips.
        rubbed: Whether they say what the gears take, see `Servo.records_friction`.
    """
    free = isinstance(scene, Floor)
    own = [
        *COLUMNS[1:],
        *(FRICTION_COLUMNS if rubbed else ()),
        *(column(quantity, motor) for motor in motors for quantity in QUANTITIES),
        *(FORCE_COLUMNS if free else ()),
    ]
    legs = [f"{leg}_{name}" for leg in LEGS for name in own]
    return ["time", *(TRUNK_COLUMNS if free else ()), *legs]


def of_leg(record: Mapping[str, Array], leg: str) -> Record:
    """Return the columns of one leg without its name, and the time: as a leg alone has them."""
    front = f"{leg}_"
    own = {name.removeprefix(front): record[name] for name in record if name.startswith(front)}
    return {"time": record["time"], **own}


def trunk(record: Mapping[str, Array]) -> Trunk | None:
    """Return the trunk after each step; None where it is held."""
    if POSITION_COLUMNS[0] not in record:
        return None
    return Trunk(
        time=record["time"],
        position=side_by_side(record, POSITION_COLUMNS),
        quaternion=side_by_side(record, QUATERNION_COLUMNS),
        turning=side_by_side(record, TURNING_COLUMNS),
    )
