"""The keys of metrics.json with their types and ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Optional

import msgspec

from fivebar_sim.errors import unknown
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import LIMIT_KEYS, MEASURED, Metric

LARGEST = 1e100
"""No metric is larger: what is done with one cannot overflow."""

Number = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)] | None
"""None where it is undefined."""
Amount = Annotated[float, msgspec.Meta(ge=0, le=LARGEST)] | None
Part = Annotated[float, msgspec.Meta(ge=0, le=1)] | None
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Sign = Annotated[int, msgspec.Meta(ge=-1, le=1)]


class Table(msgspec.Struct, forbid_unknown_fields=True):
    """A table whose keys are all known."""


class Motors(Table):
    """An amount of either motor."""

    A: Amount
    E: Amount


class Parts(Table):
    """A part of the steps of either motor."""

    A: Part
    E: Part


class Work(Table):
    """What a motor did [J]."""

    positive: Number
    negative: Number
    net: Number


class Works(Table):
    """What both motors did."""

    A: Work
    E: Work


class Opposing(Table):
    """One motor against the other."""

    fraction: Part
    first: Amount
    energy: Amount


class Share(Table):
    """The load over some of the steps; see `load.measure`."""

    torque_rms: Motors
    torque_peak: Motors
    share_A: Part
    thermal_share_A: Part
    peak_ratio: Amount
    rms_ratio: Amount
    work: Works
    opposing: Opposing


class Bins(Table):
    """Of either motor, an amount in every bin."""

    A: list[Amount]
    E: list[Amount]


class Phase(Table):
    """The load over the gait's cycle."""

    share_A: list[Part]
    torque_rms: Bins

    def __post_init__(self) -> None:
        if not len(self.share_A) == len(self.torque_rms.A) == len(self.torque_rms.E):
            raise ValueError("the lists must be of one length")


class Load(Share):
    """The load over the measured time."""

    saturated: Parts
    stance: Share | msgspec.UnsetType = msgspec.UNSET
    phase: Phase | msgspec.UnsetType = msgspec.UNSET


class Energy(Table):
    """See `energy.measure` [J]."""

    motor: Number
    force: Number
    ground: Number
    constraints: Number
    step: Number
    kinetic: Number
    potential: Number
    turnover: Amount
    imbalance: Amount


class Branch(Table):
    """Which way the leg is folded, and when it first left that [s]."""

    working_mode: tuple[Sign, Sign]
    assembly: Sign
    flips: Count
    first_flip: Amount


class Guard(Table):
    """See `guards.Guard`."""

    name: str
    value: Number
    high: Annotated[float, msgspec.Meta(ge=0, le=LARGEST)]
    time: Amount
    ok: bool

    def __post_init__(self) -> None:
        if self.name not in guards.ROWS:
            raise ValueError(unknown("guard", self.name, guards.ROWS))
        if self.ok != (self.time is None):
            raise ValueError(f"ok must be {str(not self.ok).lower()} with time {self.time}")


class Limit(Table):
    """See `metrics.Limit`."""

    key: str
    low: Number
    high: Number
    value: Number
    ok: bool

    def __post_init__(self) -> None:
        if self.key not in LIMIT_KEYS:
            raise ValueError(unknown("metric", self.key, LIMIT_KEYS))


class Force(Table):
    """Largest forces of the ground [N]."""

    x: Number
    z: Number


class Ground(Table):
    """See `ground.measure`."""

    force_max: Force
    stance_share: Part
    slip: Amount
    foot_height_max: Number
    flight_max: Amount


class Whole(Table):
    """What metrics.json has besides the metrics with a function of their own."""

    load: Load
    energy: Energy
    branch: Branch
    guards: list[Guard]
    warnings: Count
    verdict: Literal["pass", "fail"]
    limits: list[Limit]
    provenance: dict[str, str | int | float | None]
    ground: Ground | msgspec.UnsetType = msgspec.UNSET


def _with_rows(rows: Sequence[Metric]) -> type[msgspec.Struct]:
    """Return the type of metrics.json: `Whole`, and the metrics that the catalogue has besides."""
    tables: dict[str, list[tuple[str, Any]]] = {}
    for row in rows:
        table, _, name = row.key.partition(".")
        low = max(row.low, -LARGEST)
        number = Optional[Annotated[float, msgspec.Meta(ge=low, le=LARGEST)]]  # noqa: UP045
        tables.setdefault(table, []).append((name, number))

    own = {"load": Load, "energy": Energy, "branch": Branch, "ground": Ground}
    fields: list[Any] = []
    for table, names in tables.items():
        base = own.get(table, Table)
        kind: Any = msgspec.defstruct(table, names, bases=(base,), kw_only=True)
        if base is Ground:
            fields.append((table, kind | msgspec.UnsetType, msgspec.UNSET))
        else:
            fields.append((table, kind))
    return msgspec.defstruct("Metrics", fields, bases=(Whole,), kw_only=True)


Metrics = _with_rows(MEASURED)
"""All of metrics.json."""
