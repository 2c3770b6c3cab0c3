"""What a robot stands on. Each kind is a file in models/robots/."""

from __future__ import annotations

import math

from fivebar_sim.checks import check_number
from fivebar_sim.robots.ground import AnyGround, Flat
from fivebar_sim.scenario import scenes

STEEPEST = math.pi / 4.0
"""Of a slope, up and down [rad]."""


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
    """

    friction: float = 1.0
    slope: float = 0.0
    ground: AnyGround = Flat()

    def __post_init__(self) -> None:
        check_number("friction", self.friction, "", low=0.0, high=100.0)
        check_number("slope", self.slope, "rad", low=-STEEPEST, high=STEEPEST)


Scene = Air | Floor
"""What a robot may stand on; `Rail` and the others are for a leg alone."""

KINDS: dict[str, type[Scene]] = {str(kind.__struct_config__.tag): kind for kind in (Air, Floor)}
