"""Scenes: what the leg hangs on and stands on. Each kind is a file in models/scenes/.

`scene = "rail"` in a scenario is short for a table [scene] with that kind and its defaults.
"""

from __future__ import annotations

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.geometry import HEAVIEST, LONGEST

FASTEST = 1e3
"""Upper end of a belt's speed [m/s]."""

LANDING = 1e-3
"""A drop from this height on is a landing [m]: a foot that falls less far, 14 ms, just stands."""


class Scene(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """A scene; the base of every kind."""

    @property
    def kind(self) -> str:
        """The name of its file in models/scenes/; of a robot's scene in models/robots/."""
        return str(self.__struct_config__.tag)


class Air(Scene, frozen=True, tag="air"):
    """The hip fixed above the floor, out of the foot's reach."""


class Payload(Scene, frozen=True, tag="payload"):
    """The hip fixed in the air, and the foot loaded by a mass, a force profile, or both.

    Attributes:
        mass: Point mass at the foot F [kg].
    """

    mass: float = 0.0

    def __post_init__(self) -> None:
        check_number("mass", self.mass, "kg", low=0.0, high=HEAVIEST)


class Ground(Scene, frozen=True):
    """The hip on a vertical slide above a floor that the foot meets.

    Attributes:
        mass: Mass of the trunk on the hip [kg].
        drop: Height of the foot above the floor at the start [m]; 0 starts standing, that is, a
            nanometre above it.
        friction: Coulomb's coefficient between foot and floor; 0 is practically frictionless.
        stop: Lowest height of the hip above the floor [m]: there the rail ends. If its end carries
            the trunk, the guard "rail" fails the run. None: no end.
    """

    mass: float = 0.5
    drop: float = 0.0
    friction: float = 1.0
    stop: float | None = None

    @property
    def lands(self) -> bool:
        """Whether the run begins with a landing."""
        return self.drop >= LANDING

    def __post_init__(self) -> None:
        check_number("mass", self.mass, "kg", low=0.0, high=HEAVIEST, strict=True)
        check_number("drop", self.drop, "m", low=0.0, high=LONGEST)
        check_number("friction", self.friction, "", low=0.0, high=100.0)
        if self.stop is not None:
            check_number("stop", self.stop, "m", low=0.0, high=LONGEST)


class Rail(Ground, frozen=True, tag="rail"):
    """A floor that stands still: stand, squat, hop, land."""


class Treadmill(Ground, frozen=True, tag="treadmill"):
    """A floor that runs backwards, towards -x: stance and swing of a leg that walks.

    Attributes:
        speed: Speed of the belt [m/s]. With None a scenario takes its path's stance speed, and a
            model built without a scenario has a belt that stands still.
    """

    speed: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.speed is not None:
            check_number("speed", self.speed, "m/s", low=-FASTEST, high=FASTEST)


KINDS: dict[str, type[Scene]] = {
    str(kind.__struct_config__.tag): kind for kind in (Air, Payload, Rail, Treadmill)
}


def named(kind: str) -> Scene:
    """Return a scene of the given kind with its defaults.

    Raises:
        ArgumentError: Unknown kind.
    """
    if kind not in KINDS:
        raise ArgumentError(unknown("scene", str(kind), KINDS))
    return KINDS[kind]()
