"""What a robot stands on. Each kind is a file in models/robots/."""

from __future__ import annotations

import msgspec

from fivebar_sim.checks import check_number


class Scene(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """A scene for a robot; the base of every kind."""

    @property
    def kind(self) -> str:
        """The name of its file in models/robots/."""
        return str(self.__struct_config__.tag)


class Air(Scene, frozen=True, tag="air"):
    """The trunk held still above the floor, out of the feet's reach, as on a stand."""


class Floor(Scene, frozen=True, tag="floor"):
    """The trunk free above a flat, level floor, which the feet meet.

    Attributes:
        friction: Coulomb's coefficient between feet and floor.
    """

    friction: float = 1.0

    def __post_init__(self) -> None:
        check_number("friction", self.friction, "", low=0.0, high=100.0)
