"""The text of a recording: the verdict of each run, its limits, and all metrics side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import LISTED, SHOWN, shown
from fivebar_sim.metrics.limits import Limit, bounds, judge, look_up
from fivebar_sim.metrics.measured import Judged
from fivebar_sim.render import palette

MEANINGS = (
    ("motor A and L1", "A"),
    ("L2 and angle B", "B"),
    ("motor E and L4", "E"),
    ("L3 and angle D", "D"),
    ("target", "target"),
    ("foot and its error", "foot"),
    ("the ground's force", "force"),
    ("torque limits, and what the motors are sent", "muted"),
)
"""What has which colour of the palette."""


def summary(
    labels: Sequence[str],
    found: Sequence[Judged],
    limits: Sequence[Mapping[str, tuple[float, float]]],
    legs: Sequence[str] = (),
) -> str:
    """Return Markdown: verdict, tripped guards and limits of every run; then the metrics.

    What the colours mean comes last: a legend would lie over the curves.

    Args:
        labels: What each run is called.
        found: What was measured and judged of each.
        limits: (low, high) of each by the metric's dotted key.
        legs: What the leg of each is in words; by default nothing.
    """
    lines: list[str] = []
    about = dict(zip(labels, legs, strict=False))
    for label, measured, own in zip(labels, found, limits, strict=True):
        lines += [f"## {_cell(label)}: {measured.verdict.upper()}", ""]
        lines += [_cell(about[label]), ""] if label in about else []
        tripped = [f"- {said}" for said in guards.tripped(measured.guards)]
        lines += [*tripped, ""] if tripped else []
        lines += [*_limits(_judge_all(measured.table, own)), ""]

    names = [_cell(label) for label in labels] if len(labels) > 1 else ["value"]
    lines += [f"| metric | {' | '.join(names)} |", f"|:--|{'--:|' * len(names)}"]
    for key in LISTED:
        name = SHOWN[key][0]
        values = [_value(measured.table, key) for measured in found]
        if any(values):
            lines.append(f"| {name} | {' | '.join(values)} |")

    for label, measured in zip(labels, found, strict=True):
        facts = ", ".join(f"{key} {_cell(value)}" for key, value in measured.provenance.items())
        lines += ["", f"*{_cell(label)}: {facts}*"]
    lines += ["", colours(labels)]
    return "\n".join(lines) + "\n"


def colours(labels: Sequence[str]) -> str:
    """Return one line of Markdown: what the colours of leg and plots mean, or those of the runs."""
    if len(labels) > 1:
        words = [palette.RUNS[k % len(palette.RUNS)].word for k in range(len(labels))]
        named = zip(labels, words, strict=True)
        return f"**Colours**: {', '.join(f'{_cell(label)} {word}' for label, word in named)}."
    said = [f"{what} {palette.COLOURS[name].word}" for what, name in MEANINGS]
    return f"**Colours**: {', '.join(said)}."


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
        yield "No limits set: guards alone can fail the run."
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


def _cell(value: Any) -> str:
    """Return a value for one cell of a Markdown table."""
    # A bar or a line break would end the cell.
    return " ".join(str(value).replace("|", "\\|").split())
