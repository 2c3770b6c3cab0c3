"""The text of a recording: the verdict of each run, its limits, and all metrics side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import SHOWN, shown
from fivebar_sim.metrics.limits import Limit, bounds, judge, look_up


def summary(
    labels: Sequence[str],
    metrics: Sequence[Mapping[str, Any]],
    limits: Sequence[Mapping[str, tuple[float, float]]],
) -> str:
    """Return Markdown: verdict, tripped guards and limits of every run; then the metrics.

    Args:
        labels: Name of each run.
        metrics: Contents of each run's metrics.json.
        limits: Limits (low, high) of each run by the metric's dotted key.
    """
    lines: list[str] = []
    for label, measured, own in zip(labels, metrics, limits, strict=True):
        lines += [f"## {_cell(label)}: {measured['verdict'].upper()}", ""]
        tripped = [f"- {line}" for line in guards.tripped(measured.get("guards", []))]
        lines += [*tripped, ""] if tripped else []
        lines += [*_limits(_judge_all(measured, own)), ""]

    names = [_cell(label) for label in labels] if len(labels) > 1 else ["value"]
    lines += [f"| metric | {' | '.join(names)} |", f"|:--|{'--:|' * len(names)}"]
    for key, (name, _, _) in SHOWN.items():
        values = [_value(measured, key) for measured in metrics]
        # A metric that no run has, as a ground's in the air, gets no row.
        if any(values):
            lines.append(f"| {name} | {' | '.join(values)} |")

    for label, measured in zip(labels, metrics, strict=True):
        facts = ", ".join(
            f"{key} {_cell(value)}" for key, value in _flat(measured.get("provenance", {}))
        )
        lines += ["", f"*{_cell(label)}: {facts}*"]
    return "\n".join(lines) + "\n"


def _judge_all(
    measured: Mapping[str, Any], limits: Mapping[str, tuple[float, float]]
) -> list[Limit]:
    """Return every limit with its value; a limit on a metric that was not measured is broken."""
    # Sorted out first, since `judge` refuses a metric that the run lacks.
    known = {key: limit for key, limit in limits.items() if _value(measured, key)}
    return [
        *judge(measured, known),
        *(Limit(key, *limits[key], None, False) for key in limits if key not in known),
    ]


def _limits(judged: Sequence[Limit]) -> Iterator[str]:
    """Yield a table of limits, each with its value."""
    if not judged:
        yield "No limits set."
        return
    yield "| limit | allowed | value | verdict |"
    yield "|:--|--:|--:|:--|"
    for limit in judged:
        verdict = "pass" if limit.ok else "**FAIL**"
        name = SHOWN[limit.key][0]
        value = shown(limit.key, limit.value)
        yield f"| {name} | {bounds(limit)} | {value} | {verdict} |"


def _value(measured: Mapping[str, Any], key: str) -> str:
    """Return a metric as people read it, "" if the run does not have it."""
    try:
        return shown(key, look_up(measured, key))
    except KeyError:
        return ""


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables by dotted keys."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _cell(value: Any) -> str:
    """Return a value for one cell of a Markdown table."""
    # A bar or a line break would end the cell.
    return " ".join(str(value).replace("|", "\\|").split())
