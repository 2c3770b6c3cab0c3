"""Guesses which column is what, by names, units in them, and ranges: to start a table from."""

from __future__ import annotations

import re
from typing import Any

from fivebar_sim.logs.channels import LEG, SIZES
from fivebar_sim.logs.raw import Raw
from fivebar_sim.logs.survey import Content, Survey

TIME = re.compile(r"(?<![a-z])(time|timestamp|stamp|t|zeit|unix|m?illis|micros|ms|us|sec|x_value)")
"""What columns of time are called."""

KINDS = {
    "ctrl": r"goal|cmd|command|setpoint|target|soll|(?<![a-z])ref|desired|input_pos|ctrl",
    "theta_dot": r"vel|speed|rate|rpm|_dot|drehzahl|(?<![a-z])qd|omega",
    "current": r"current|strom|amp|(?<![a-z])iq|(?<![a-z])i(?![a-z])",
    "torque": r"torque|effort|moment|(?<![a-z])tau",
    "theta": r"pos|angle|theta|winkel|(?<![a-z])q|encoder|raw|motor",
}
"""What columns of a quantity are called; the first that fits counts."""

SIDES = {
    "A": r"(?<![a-z])a(?![a-z])|left|(?<![a-z])l(?![a-z])|q_?a(?![a-z])",
    "E": r"(?<![a-z])e(?![a-z])|right|(?<![a-z])r(?![a-z])|q_?e(?![a-z])",
}
"""How columns name the motor; else the first of two is A's."""

OTHER = re.compile(r"state|mode|status|count|seq|error|note")
"""What columns of other things are called."""

MARK = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]|_(deg|rad|ms|us|ns|s|mA|A|rpm)$")
"""A unit in a name: "angle [deg]", "angle_deg"."""

Table = dict[str, Any]


def guess(raw: Raw, found: Survey) -> Table:
    """Return a table [log] that may fit a file: channels with column and unit.

    Without a column of time it has a rate, which nobody can guess: 0, to be filled in.
    """
    table: Table = {}
    time = _time(raw, found)
    if time is None:
        table["rate"] = 0.0
    else:
        table["time"] = _entry(time, "s", _time_unit(raw, time, found.columns[time]))

    grouped: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for name, content in found.columns.items():
        if name != time and content.kind == "numbers" and not OTHER.search(name.lower()):
            kind = next((k for k, words in KINDS.items() if re.search(words, name.lower())), None)
            if kind:
                grouped[kind].append(name)

    for kind in ("theta", "theta_dot", "torque", "current", "ctrl"):
        for motor, name in _sides(grouped[kind]).items():
            channel = f"{kind}_{motor}"
            unit = _unit(raw, name, LEG[channel], found.columns[name])
            table[channel] = _entry(name, LEG[channel], unit)
    return table


def _entry(column: str, si: str, unit: str) -> str | Table:
    return column if unit in ("", si) else {"column": column, "unit": unit}


def _time(raw: Raw, found: Survey) -> str | None:
    """Return the column of time: moments, or one that is called so."""
    for name, content in found.columns.items():
        if content.kind == "moments":
            return name
    called = [
        name
        for name, content in found.columns.items()
        if content.kind == "numbers" and TIME.search(name.lower()) and content.high > content.low
    ]
    # Of several the one with most rows: a header's stamp may be there now and then only.
    return max(called, key=lambda name: found.columns[name].there, default=None)


UNIX = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}
"""Today's Unix time in each unit is one to ten of these."""


def _time_unit(raw: Raw, name: str, content: Content) -> str:
    """Return the unit of a column of time, by its name, by Unix time's size, or by its steps."""
    if content.kind == "moments":
        return "s"
    named = _named_unit(raw, name, "s")
    if named:
        return named

    for word, unit in (("micros", "us"), ("millis", "ms"), ("nanosec", "ns")):
        if word in name.lower():
            return unit

    for unit, size in UNIX.items():
        if size <= content.first < 10.0 * size:
            return unit

    # A microcontroller counts whole milliseconds, or microseconds.
    step = (content.high - content.low) / max(content.there - 1, 1)
    if content.whole and step >= 0.5:
        return "ms" if step < 200.0 else "us"
    return "s"


def _named_unit(raw: Raw, name: str, si: str) -> str:
    """Return the unit that a file or a name gives, if it is one of an SI unit's; else ""."""
    sizes = SIZES[si]
    given = [raw.units.get(name, ""), *(part for found in MARK.findall(name) for part in found)]
    for each in given:
        unit = each.strip("[]() ").replace("°", "deg").replace("µ", "u")
        unit = {"msec": "ms", "sec": "s", "usec": "us", "second": "s"}.get(unit.lower(), unit)
        if unit in sizes:
            return unit
    return ""


def _unit(raw: Raw, name: str, si: str, content: Content) -> str:
    """Return the unit of a channel's column, by its name or by its range."""
    named = _named_unit(raw, name, si)
    if named or si not in ("rad", "A"):
        return named
    largest = max(abs(content.low), abs(content.high))
    if si == "A":
        return "mA" if largest > 50.0 else ""
    if content.whole and largest > 400.0:
        return "turn/4096"
    return "deg" if largest > 13.0 else ""


def _sides(names: list[str]) -> dict[str, str]:
    """Return the columns of the two motors."""
    found = {}
    for motor, words in SIDES.items():
        named = [name for name in names if re.search(words, name.lower())]
        if named:
            found[motor] = named[0]
    if found.get("A") != found.get("E") and len(found) == 2:
        return found
    if len(names) >= 2:
        return {"A": names[0], "E": names[1]}
    return found if len(found) == 1 else {}
