"""The servos of many designs as columns, seen through a gear between servo and joint.

A gear of ratio g multiplies torques by g and divides rates by it, so that the joint sees

    limit g,   speed / g,   friction g,   kt g,   armature g^2
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import Friction
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.evaluation.legs import Rows


class Motors(NamedTuple):
    """The servos of n designs at their joints, each (n, 1); NaN where the servo's table has none.

    Attributes:
        limit: Torque at stall [N m].
        speed: Rate without load [rad/s]; inf where no line falls from the limit.
        friction: Coulomb friction [N m].
        kt: Torque per current [N m/A].
        resistance: Of the winding [ohm].
        armature: Rotor inertia [kg m^2].
    """

    limit: Array
    speed: Array
    friction: Array
    kt: Array
    resistance: Array
    armature: Array

    @classmethod
    def of(
        cls, servos: Sequence[Servo], which: NDArray[np.int_], gear: Array, armature: float
    ) -> Motors:
        """Return the motors of designs.

        Args:
            servos: The servos to choose from.
            which: Index of each design's servo, (n,).
            gear: Ratio between its servo and the joint, (n,).
            armature: Rotor inertia where a servo's table has none [kg m^2]; the gear is in it.
        """

        def column(name: str, missing: float) -> Array:
            found = [getattr(servo, name) for servo in servos]
            numbers = np.array([missing if each is None else each for each in found])
            return numbers[which][:, None]

        g = gear[:, None]
        own = column("armature", math.nan)
        return cls(
            limit=column("limit", math.nan) * g,
            speed=column("speed", math.inf) / g,
            friction=column("dry", 0.0) * g,
            kt=column("kt", math.nan) * g,
            resistance=column("resistance", math.nan),
            armature=np.where(np.isnan(own), armature, own * g**2),
        )

    def take(self, rows: Rows) -> Motors:
        """Return the motors of some of the designs."""
        return Motors(*(each[rows] for each in self))


def through(servo: Servo, gear: float) -> Servo:
    """Return a servo as the joint sees it through a gear of some ratio.

    Gains are those at the joint too: an angle error there is `gear` times as large at the servo.
    """
    factors = {
        "kp": gear**2,
        "kd": gear**2,
        "limit": gear,
        "speed": 1.0 / gear,
        "friction": gear,
        "resolution": 1.0 / gear,
        "armature": gear**2,
        "kt": gear,
    }

    if isinstance(servo.friction, Friction):
        del factors["friction"]
        servo = msgspec.structs.replace(servo, friction=servo.friction.geared(gear))

    given = {key: getattr(servo, key) for key in factors}
    changed = {key: factors[key] * value for key, value in given.items() if value is not None}
    return servo if gear == 1.0 else msgspec.structs.replace(servo, **changed)
