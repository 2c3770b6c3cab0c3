"""Metrics for people: the measured window's number, and the whole run's beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from fivebar_sim.metrics.catalogue import BESIDE, BY_KEY, EVERY, RUN, Metric, shown
from fivebar_sim.metrics.limits import Limit, bounds, has, look_up


class Row(NamedTuple):
    """A row of a table.

    Attributes:
        label: What was measured.
        window: The value over the measured window; "" for a metric of the whole run.
        run: The value over the whole run, with the time of a peak; "" where it is not measured.
        limit: The limit on one of the two; "" for none.
        ok: Whether the limit holds.
    """

    label: str
    window: str
    run: str
    limit: str
    ok: bool


def side_by_side(metrics: Mapping[str, Any], limits: Mapping[str, Limit]) -> Iterator[Row]:
    """Yield the rows of a run's metrics, in the order of the catalogue.

    Args:
        metrics: All of metrics.json.
        limits: The judged limits by key.
    """
    for metric in EVERY:
        limit = limits.get(metric.key)
        if not has(metrics, metric.key) or not (limit or _matters(metric, metrics)):
            continue

        # Its window's row has shown it, unless both have a limit: those need two rows.
        beside = BESIDE.get(metric.key)
        if beside is not None and (limit is None or beside not in limits):
            continue

        limit = limit or limits.get(metric.whole)
        own = shown(metric.key, look_up(metrics, metric.key))
        allowed = bounds(limit) if limit else ""
        ok = limit is None or limit.ok
        if metric.window == RUN:
            yield Row(metric.label, "", own + when(metrics, metric), allowed, ok)
            continue

        if limit is not None and limit.key == metric.whole:
            allowed = f"run {allowed}"
        yield Row(metric.label, own, _whole(metrics, metric, own), allowed, ok)


def when(metrics: Mapping[str, Any], metric: Metric) -> str:
    """Return " at 0.111 s" of a peak of the whole run, "" of other metrics."""
    time = look_up(metrics, metric.at) if metric.at else None
    return "" if time is None else f" at {time:.4g} s"


def _whole(metrics: Mapping[str, Any], metric: Metric, own: str) -> str:
    """Return what the whole run has instead of the window's value `own`, and when."""
    if not metric.whole:
        return ""
    value = shown(metric.whole, look_up(metrics, metric.whole))
    number, _, unit = value.partition(" ")
    # The same unit stands beside it.
    same = unit == own.partition(" ")[2]
    return (number if same else value) + when(metrics, BY_KEY[metric.whole])


def _matters(metric: Metric, metrics: Mapping[str, Any]) -> bool:
    """Return whether to show a metric that has no limit."""
    if metric.hidden_at_zero:
        return bool(look_up(metrics, metric.key))
    return not (metric.detail or metric.same_as)
