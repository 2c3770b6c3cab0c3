"""What a robot stands on. Each kind is a file in models/robots/."""

from __future__ import annotations

import math

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.geometry import HEAVIEST, LONGEST
from fivebar_sim.robots.ground import AnyGround, Flat
from fivebar_sim.scenario import scenes

Vector = tuple[float, float, float]

STEEPEST = math.pi / 4.0
"""Of a slope, up and down [rad]."""


class Payload(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a robot carries: a point mass that is fixed to the trunk.

    Attributes:
        mass: [kg], on top of the robot's own.
        at: Where it is in the trunk's frame [m].
    """

    mass: float = 0.0
    at: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_number("mass", self.mass, "kg", low=0.0, high=HEAVIEST)
        for value in self.at:
            check_number("at", value, "m", low=-LONGEST, high=LONGEST)


class Air(scenes.Scene, frozen=True, tag="air"):
    """The trunk held still above the floor, out of the feet's reach, as on a stand."""


class Floor(scenes.Scene, frozen=True, tag="floor"):
    """The trunk free above a floor, which the feet meet, with what lies on it.

    The world's axes are those of the floor: on a slope it is gravity that leans. What a controller
    feeds forward for the legs' own weight knows of no slope.

    Attributes:
        friction: Coulomb's coefficient between feet and floor.
        slope: Angle by which the floor rises towards +x [rad], where the robot faces at the start.
        ground: What lies on it: nothing, steps, or points of random heights.
        payload: What the trunk carries.
    """

    friction: float = 1.0
    slope: float = 0.0
    ground: AnyGround = Flat()
    payload: Payload = Payload()

    def __post_init__(self) -> None:
        check_number("friction", self.friction, "", low=0.0, high=100.0)
        check_number("slope", self.slope, "rad", low=-STEEPEST, high=STEEPEST)


Scene = Air | Floor
"""What a robot may stand on; `Rail` and the others are for a leg alone."""


def load(scene: Scene) -> float:
    """Return the mass of what a robot carries [kg]."""
    return scene.payload.mass if isinstance(scene, Floor) else 0.0


KINDS: dict[str, type[Scene]] = {str(kind.__struct_config__.tag): kind for kind in (Air, Floor)}
