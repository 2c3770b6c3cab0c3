"""A run against its limits and its baseline, metric by metric."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import ABSOLUTE, LESS_IS_BETTER, SHOWN, shown
from fivebar_sim.metrics.limits import Limit, bounds, has, look_up
from fivebar_sim.regression.baseline import Baseline, Recorded

if TYPE_CHECKING:
    from fivebar_sim.rollout import Result

PASS = "pass"
FAIL = "FAIL"
BETTER = "better"
NEW = "new"


class Compared(NamedTuple):
    """One metric.

    Attributes:
        key: Its dotted key.
        limit: Its limit, if the scenario sets one.
        recorded: Its value in the baseline, if it has one.
        now: The measured value; None where it is undefined.
        verdict: `PASS`, `FAIL`, `BETTER` or `NEW`; the last was changed on purpose, see `accept`.
        why: What is wrong or changed; "" where it passes.
    """

    key: str
    limit: Limit | None
    recorded: Recorded | None
    now: float | None
    verdict: str
    why: str

    @property
    def change(self) -> str:
        """The change since the baseline in percent of it; "" if one of the two is missing."""
        if self.recorded is None or self.recorded.value is None or self.now is None:
            return ""
        return _change(self.recorded.value, self.now, self.key)

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """Name, limit, baseline, value and change in the units that people read."""
        limit = bounds(self.limit) if self.limit else ""
        then = shown(self.key, self.recorded.value) if self.recorded else ""
        return SHOWN[self.key][0], limit, then, shown(self.key, self.now), self.change


class Checked(NamedTuple):
    """The result of checking one scenario.

    Attributes:
        name: The scenario's name.
        rows: Its metrics that have a limit or a baseline.
        broke: Why the run itself failed: it diverged, or a guard tripped; "" if it did not.
        notes: Remarks that are not failures: a foot that does not follow its path, no baseline, or
            one of another platform or version, or one that lacks metrics.
    """

    name: str
    rows: list[Compared]
    broke: str
    notes: list[str]

    @property
    def judged(self) -> bool:
        """Whether anything decided: a limit, a baseline, or a guard that tripped."""
        return bool(self.rows or self.broke)

    @property
    def failures(self) -> list[str]:
        """What is wrong, one line each."""
        whys = [row.why for row in self.rows if row.verdict == FAIL]
        return [self.broke, *whys] if self.broke else whys

    @property
    def remarks(self) -> list[str]:
        """Remarks that are not failures: the notes, and which metrics got better."""
        better = [SHOWN[row.key][0] for row in self.rows if row.verdict == BETTER]
        line = f"better than its baseline: {', '.join(better)}; --update records it"
        return [line, *self.notes] if better else self.notes

    def _repr_html_(self) -> str:
        """Return what a notebook shows: every metric beside its limit and its baseline."""
        from fivebar_sim.report import notebook

        said = html.escape("; ".join([*self.failures, *self.remarks]) or PASS)
        head = ("metric", "limit", "baseline", "now", "change", "verdict")
        rows = [(*row.cells, row.verdict) for row in self.rows]
        return f"<div><p>{html.escape(self.name)}: {said}</p>{notebook.table(head, rows)}</div>"


def compare(result: Result, baseline: Baseline | None, remarks: Sequence[str] = ()) -> Checked:
    """Compare a run with its limits and its baseline.

    Args:
        result: The run.
        baseline: Its baseline, if it has one.
        remarks: What else is to be said about it: `Result.remarks`, which takes further runs.
    """
    metrics = result.metrics
    limits = {limit.key: limit for limit in result.limits}
    recorded = baseline.metrics if baseline else {}
    # In the order of the catalogue, so that every table shows metrics alike.
    rows = [
        _row(key, limits.get(key), recorded.get(key), metrics)
        for key in SHOWN
        if key in limits or key in recorded
    ]
    broke = _broke(result)
    # Of a run that broke, a missing baseline is the least of its problems.
    notes = [] if broke else [*remarks, *_notes(baseline, metrics)]
    return Checked(result.scenario.name, rows, broke, notes)


def accept(checked: Checked) -> Checked:
    """Return the checked scenario with every difference to the baseline accepted."""
    rows = [row if row.verdict == PASS else row._replace(verdict=NEW) for row in checked.rows]
    return checked._replace(rows=rows, notes=[])


def _broke(result: Result) -> str:
    """Return why a run failed, if not by its limits."""
    return "; ".join(guards.tripped(result.measured.guards))


def _notes(baseline: Baseline | None, metrics: Mapping[str, Any]) -> Iterator[str]:
    """Yield remarks on a baseline: that it or a part of it is missing, or was made otherwise."""
    if baseline is None:
        yield "no baseline: judged by its limits alone; --update records one"
        return
    differences = baseline.differences(metrics["provenance"])
    if differences:
        yield f"its baseline was made with {'; '.join(differences)}"

    # Of a run that has no such number, nothing is missed.
    lacking = [
        key
        for key in ABSOLUTE
        if key not in baseline.metrics and has(metrics, key) and look_up(metrics, key) is not None
    ]
    if lacking:
        yield (
            f"its baseline lacks {len(lacking)} of this run's metrics, which it judges by limits "
            f"alone: {', '.join(lacking)}; --update records them"
        )


def _row(
    key: str, limit: Limit | None, recorded: Recorded | None, metrics: Mapping[str, Any]
) -> Compared:
    """Return one metric; a broken limit outranks any difference to the baseline."""
    # A baseline may still name metrics of a ground that the scene no longer has.
    now = look_up(metrics, key) if has(metrics, key) else None
    label = SHOWN[key][0]
    verdict = PASS
    why = ""
    if recorded is not None:
        verdict, why = _against(key, recorded, now)
    if limit is not None and not limit.ok:
        verdict = FAIL
        why = f"{shown(key, now)}, limit {bounds(limit)}"
    return Compared(key, limit, recorded, now, verdict, why and f"{label}: {why}")


def _against(key: str, recorded: Recorded, now: float | None) -> tuple[str, str]:
    """Return the verdict of a metric against its recorded value, and why."""
    then = recorded.value
    # Undefined on one side only: there is no number to hold against a tolerance.
    if then is None or now is None:
        same = then is now
        return (PASS, "") if same else (FAIL, f"{shown(key, now)}, baseline {shown(key, then)}")
    if abs(now - then) <= recorded.tolerance:
        return PASS, ""
    less = key in LESS_IS_BETTER and now < then
    tolerance = f"{shown(key, recorded.tolerance)} allowed"
    moved = f"{shown(key, now)}, baseline {shown(key, then)} ({_change(then, now, key)}; "
    return (BETTER if less else FAIL), f"{moved}{tolerance})"


def _change(then: float, now: float, key: str) -> str:
    """Return a change in percent, or in the metric's unit where it was zero."""
    if now == then:
        return "0.0 %"
    if then == 0.0:
        return f"{'+' if now > 0.0 else ''}{shown(key, now)}"
    # Rounding must not show a sign where nothing changed.
    percent = f"{100.0 * (now - then) / abs(then):+.1f} %"
    return "0.0 %" if percent in ("+0.0 %", "-0.0 %") else percent
