"""What a robot stands on. Each kind is a file in models/robots/."""

from __future__ import annotations

from fivebar_sim.checks import check_number
from fivebar_sim.scenario import scenes


class Air(scenes.Scene, frozen=True, tag="air"):
    """The trunk held still above the floor, out of the feet's reach, as on a stand."""


class Floor(scenes.Scene, frozen=True, tag="floor"):
    """The trunk free above a flat, level floor, which the feet meet.

    Attributes:
        friction: Coulomb's coefficient between feet and floor.
    """

    friction: float = 1.0

    def __post_init__(self) -> None:
        check_number("friction", self.friction, "", low=0.0, high=100.0)


Scene = Air | Floor
"""What a robot may stand on; `Rail` and the others are for a leg alone."""

KINDS: dict[str, type[Scene]] = {str(kind.__struct_config__.tag): kind for kind in (Air, Floor)}
