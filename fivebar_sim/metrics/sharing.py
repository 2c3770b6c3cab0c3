"""The types of the table "load" in metrics.json; see `load`."""

from __future__ import annotations

import msgspec

from fivebar_sim.metrics.json_types import Amount, Motors, Number, Part, Parts, Table


class Work(Table, frozen=True):
    """Work of a motor [J]."""

    positive: Number
    negative: Number
    net: Number


class Works(Table, frozen=True):
    """Work of both motors."""

    A: Work
    E: Work


class Opposing(Table, frozen=True):
    """How one motor worked against the other."""

    fraction: Part
    first: Amount
    energy: Amount


class Share(Table, frozen=True):
    """The load over some of the steps; see `load.measure`."""

    torque_rms: Motors
    torque_peak: Motors
    share_A: Part
    thermal_share_A: Part
    peak_ratio: Amount
    rms_ratio: Amount
    work: Works
    opposing: Opposing


UNDEFINED = Share(
    torque_rms=Motors(A=None, E=None),
    torque_peak=Motors(A=None, E=None),
    share_A=None,
    thermal_share_A=None,
    peak_ratio=None,
    rms_ratio=None,
    work=Works(
        A=Work(positive=None, negative=None, net=None),
        E=Work(positive=None, negative=None, net=None),
    ),
    opposing=Opposing(fraction=None, first=None, energy=None),
)
"""The load over no steps at all."""


class Bins(Table, frozen=True):
    """An amount for each motor in every bin."""

    A: list[Amount]
    E: list[Amount]


class Phase(Table, frozen=True):
    """The load over the gait's cycle."""

    share_A: list[Part]
    torque_rms: Bins

    def __post_init__(self) -> None:
        if not len(self.share_A) == len(self.torque_rms.A) == len(self.torque_rms.E):
            raise ValueError("the lists must be of one length")


class Sharing(Share, frozen=True):
    """The load over a window, and over parts of it where they are known."""

    stance: Share | msgspec.UnsetType = msgspec.UNSET
    phase: Phase | msgspec.UnsetType = msgspec.UNSET


class Temperatures(Table, frozen=True):
    """A temperature of each motor [deg C]."""

    A: Number
    E: Number


class Load(Sharing, frozen=True, kw_only=True):
    """The load over the measured window.

    Attributes:
        heat: Mean copper heat of each motor [W]; see `heat.heating`. Unset where the servo's table
            does not describe the winding.
        temperature: What each winding gets to if this goes on for good [deg C]; unset where the
            servo's table does not say how the winding cools.
        continuous: RMS torque of each motor as a part of its continuous torque; unset as above.
        survives: Heat of the hotter motor as a part of what it bears for good; unset as above.
        line: How near each motor comes to its torque-speed line, on it is 1; unset for a servo
            without one.
        saturated: Part of the steps in which the torque limit clipped each motor.
    """

    heat: Motors | msgspec.UnsetType = msgspec.UNSET
    temperature: Temperatures | msgspec.UnsetType = msgspec.UNSET
    continuous: Motors | msgspec.UnsetType = msgspec.UNSET
    survives: Amount | msgspec.UnsetType = msgspec.UNSET
    line: Motors | msgspec.UnsetType = msgspec.UNSET
    saturated: Parts
