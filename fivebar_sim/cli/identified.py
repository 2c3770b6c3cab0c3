"""What `fivebar identify` prints."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.table import Table

from fivebar_sim import units
from fivebar_sim.identify import findings

if TYPE_CHECKING:
    from rich.console import Console

    from fivebar_sim.identify.fit import Fit
    from fivebar_sim.identify.motions import Suggestion


class Told(NamedTuple):
    """What is printed.

    Attributes:
        found: What was identified.
        names: The logs' names.
        held_out: RMS of the angles' residuals before and after in the others, by name [rad].
        better: Motions, the best first.
    """

    found: Fit
    names: list[str]
    held_out: dict[str, tuple[float, float]]
    better: list[Suggestion]


def print_told(told: Told, console: Console) -> None:
    """Print all of it for people."""
    found = told.found
    _print_numbers(found, console)
    _print_logs(told, console)
    for one, other, rho in findings.correlated(found):
        console.print(f"{one.key} and {other.key} move together: correlation {rho:.2f}")
    for each in findings.untold(found):
        console.print(f"the motion does not tell {each.words}")
    if told.better:
        console.print(_advice(found, told.better[0]))


def _print_numbers(found: Fit, console: Console) -> None:
    """Print what was identified."""
    table = Table(box=None)
    for name in ("number", "before", "identified", "95 %", "unit", ""):
        table.add_column(name, justify="left" if name in ("number", "unit", "") else "right")
    words = findings.remarks(found)
    rows: list[Any] = list(
        zip(found.parameters, found.values, found.half_widths, words, strict=True)
    )
    for each, value, half, word in rows:
        numbers = (f"{each.start:.5g}", f"{value:.5g}", f"+- {half:.2g}")
        table.add_row(each.key, *numbers, each.unit, word)
    console.print(table)


def _print_logs(told: Told, console: Console) -> None:
    """Print how far the simulated angles are from those of each log."""

    def line(name: str, before: float, after: float, note: str) -> str:
        texts = [units.text(1e3 * each, "mrad", 3) for each in (before, after)]
        return f"{name}: angles off by {texts[0]} RMS before, {texts[1]} now{note}"

    for row in zip(told.names, told.found.rms_before, told.found.rms, strict=True):
        console.print(line(*row, ""))
    for name, (before, after) in told.held_out.items():
        note = " (held out)" if after <= before else " (held out): FAIL, worse than before"
        console.print(line(name, before, after, note))


def _advice(found: Fit, best: Suggestion) -> str:
    """Return a line on the motion that would tell most."""
    doubt = [each.doubt for each in found.parameters]
    ratio = best.half_widths / doubt
    worst = int(ratio.argmax())
    key = found.parameters[worst]

    if not np.isfinite(ratio[worst]):
        return f"none of the motions that were tried tells {key.key}"
    if ratio[worst] >= (found.half_widths / doubt).max() and not findings.untold(found):
        return "none of the motions that were tried would tell more"
    return (
        f"a motion that would tell more: {best.name!r}, swings of {best.swing:g} rad; of it "
        f"{key.key} would be the least known, to +- {best.half_widths[worst]:.2g} {key.unit}"
    )


def print_json(told: Told) -> None:
    """Print all of it as JSON."""
    found = told.found
    words = findings.remarks(found)
    rows: list[Any] = list(
        zip(found.parameters, found.values, found.half_widths, words, strict=True)
    )

    said = {
        "numbers": {
            each.key: {
                "before": each.start,
                "value": float(value),
                "half_width": _number(half),
                "unit": each.unit,
                "remark": word,
            }
            for each, value, half, word in rows
        },
        "correlations": found.correlations.tolist(),
        "untold": [each._asdict() for each in findings.untold(found)],
        "rms": {"before": found.rms_before, "after": found.rms},
        "held_out": {name: {"before": b, "after": a} for name, (b, a) in told.held_out.items()},
        "motions": [
            {
                "name": each.name,
                "swing": each.swing,
                "half_widths": [_number(half) for half in each.half_widths],
            }
            for each in told.better
        ],
    }
    print(json.dumps(said, indent=2, allow_nan=False))  # noqa: T201


def _number(value: float) -> float | None:
    """Return a number as JSON has it: None of an interval without end."""
    return float(value) if np.isfinite(value) else None
