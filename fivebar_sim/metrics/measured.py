"""All of metrics.json, with types: what a run measured, and how it was judged.

`Measured.table` is the only way out to metrics.json, and `read` the only way in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, Optional, TypeVar

import msgspec

from fivebar_sim.metrics.branch import Branch
from fivebar_sim.metrics.catalogue import MEASURED, Metric
from fivebar_sim.metrics.energy import Energy
from fivebar_sim.metrics.ground import GroundForce, GroundMetrics
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.metrics.json_types import LARGEST, Amount, Count, Motors, Table
from fivebar_sim.metrics.limits import Limit, WrittenLimit
from fivebar_sim.metrics.peaks import Peaks, Whole, Window
from fivebar_sim.metrics.sharing import Load

Verdict = Literal["pass", "fail", "not judged"]
"""Of a run; "not judged": its guards hold, but no limits are set that it could break."""

NOT_JUDGED: Verdict = "not judged"


class Measured(Table, frozen=True, kw_only=True, dict=True):
    """What a run measured, before anyone judged it.

    The tables of metrics with a function of their own, such as `tracking`, are known from the
    catalogue alone: they are fields of the classes that `of` and `read` return.

    The peaks of `Peaks` are those of the measured window; `whole` has those of the whole run.
    """

    window: Window
    load: Load
    torque_peak: Motors
    speed_peak: Motors
    power_peak: Motors
    gap_peak: Amount
    ground_peak: GroundForce | msgspec.UnsetType = msgspec.UNSET
    whole: Whole
    energy: Energy
    branch: Branch
    guards: list[Guard]
    warnings: Count
    ground: GroundMetrics | msgspec.UnsetType = msgspec.UNSET

    @cached_property
    def table(self) -> dict[str, Any]:
        """The same as nested dictionaries, lists and numbers, in the order of metrics.json."""
        return msgspec.to_builtins(self)


class Judged(Measured, frozen=True, kw_only=True):
    """All of metrics.json."""

    verdict: Verdict
    limits: list[WrittenLimit]
    provenance: dict[str, str | int | float | None]


def of(
    rows: Mapping[str, Mapping[str, float | None]],
    *,
    window: Window,
    load: Load,
    peaks: Peaks,
    whole: Whole,
    energy: Energy,
    branch: Branch,
    guards: list[Guard],
    warnings: int,
    ground: GroundMetrics | msgspec.UnsetType,
) -> Measured:
    """Return what a run measured.

    Args:
        rows: What the functions of the catalogue gave, by table and name.
        window: What most of it was measured over.
        load: How the motors shared the load.
        peaks: The peaks of the window.
        whole: The peaks of the whole run.
        energy: Where the energy came from and went.
        branch: Which way the leg was folded.
        guards: Every guard of the run.
        warnings: Number of MuJoCo's warnings.
        ground: Metrics of the foot on the ground; unset where there is none.
    """
    tables: dict[str, Any] = {"load": load, "energy": energy, "branch": branch, "ground": ground}
    # A row of the catalogue may add to a table that is measured as a whole.
    for table, values in rows.items():
        own = msgspec.structs.asdict(tables[table]) if table in tables else {}
        tables[table] = KINDS[table](**own, **values)
    tables |= msgspec.structs.asdict(peaks)
    return MeasuredRows(**tables, window=window, whole=whole, guards=guards, warnings=warnings)


def with_verdict(
    measured: Measured, limits: Sequence[Limit], provenance: Mapping[str, str | int | float | None]
) -> Judged:
    """Return what was measured with its verdict; see `judgement`."""
    judged = judgement(measured, limits, provenance)
    return JudgedRows(**{**msgspec.structs.asdict(measured), **judged})


def judgement(
    measured: Measured, limits: Sequence[Limit], provenance: Mapping[str, str | int | float | None]
) -> dict[str, Any]:
    """Return what `Judged` has besides what was measured.

    The verdict is "fail" if a limit or a guard does not hold; else "pass", or "not judged" without
    limits.

    Args:
        measured: What was measured.
        limits: Every limit of the scenario with its value.
        provenance: What the numbers depend on besides the scenario.
    """
    good = all(limit.ok for limit in limits) and all(guard.ok for guard in measured.guards)
    # Guards only say that the physics can be trusted, not that the leg did what it should.
    passed = "pass" if limits else NOT_JUDGED
    return {
        "verdict": passed if good else "fail",
        "limits": [WrittenLimit.of(limit) for limit in limits],
        "provenance": dict(provenance),
    }


def read(table: Any) -> Judged:
    """Return all of metrics.json from its nested dictionaries.

    Raises:
        msgspec.ValidationError: A key is missing or unknown, or a value outside its range.
    """
    return msgspec.convert(table, JudgedRows)


Kind = TypeVar("Kind", bound=Table)


def kinds(rows: Sequence[Metric]) -> dict[str, type[Table]]:
    """Return the type of every table that has rows of the catalogue, by the table's name."""
    tables: dict[str, list[tuple[str, Any]]] = {}
    for row in rows:
        table, _, name = row.key.partition(".")
        # JSON has no infinity: a metric without a lower bound still has one.
        low = max(row.low, -LARGEST)
        number = Optional[Annotated[float, msgspec.Meta(ge=low, le=LARGEST)]]  # noqa: UP045
        tables.setdefault(table, []).append((name, number))

    own = {"load": Load, "energy": Energy, "branch": Branch, "ground": GroundMetrics}
    return {
        table: _defined(f"{table.capitalize()}Rows", names, own.get(table, Table), kw_only=True)
        for table, names in tables.items()
    }


def with_rows(name: str, base: type[Kind], tables: Mapping[str, type[Table]]) -> type[Kind]:
    """Return a type that has tables of the catalogue besides what its base has.

    Args:
        name: The name of the new type.
        base: `Measured` or `Judged`.
        tables: The types of the tables, as `kinds` returns them.
    """
    old: list[Any] = []
    new: list[Any] = []
    for table, kind in tables.items():
        if table == "ground":
            old.append((table, kind | msgspec.UnsetType, msgspec.UNSET))
        elif table in base.__struct_fields__:
            old.append((table, kind))
        else:
            new.append((table, kind))

    # fields by position come before those by keyword, so new tables come first in metrics.json
    extended = _defined(name, old, base, kw_only=True)
    return _defined(name, new, extended, kw_only=False)


def _defined(name: str, fields: Sequence[Any], base: type[Kind], *, kw_only: bool) -> type[Kind]:
    """Return a new type with some fields more than its base."""
    kind: Any = msgspec.defstruct(
        name, fields, bases=(base,), frozen=True, kw_only=kw_only, module=__name__
    )
    return kind


KINDS = kinds(MEASURED)
"""The types of tables with rows of the catalogue."""

# pickle looks a class up by its name in its module
globals().update({kind.__name__: kind for kind in KINDS.values()})

MeasuredRows = with_rows("MeasuredRows", Measured, KINDS)
"""`Measured` with the tables of the catalogue."""

JudgedRows = with_rows("JudgedRows", Judged, KINDS)
"""`Judged` with the tables of the catalogue."""
