"""./.venv/bin/python scripts/limits.py [FILE ...]: sets limits anew from what is measured.

Runs scenarios, all that ship if none is named, and rewrites each limit that is not tight: one that
is broken, or that a result 10 % worse would keep. A new end stands 5 % from the value, a lower one
only where there was one; comments stay. Prints what it changes: read it, since a limit says what is
good enough. `fivebar check --update` then records the baselines.
"""

from __future__ import annotations

import math
import re
import sys
import tomllib
from pathlib import Path

from fivebar_sim import rollout
from fivebar_sim.files import resources, tables
from fivebar_sim.metrics import Limit
from fivebar_sim.scenario import Scenario

WORSE = 0.1
"""What no limit lets pass: a part of the value."""

ROOM = 0.05
"""How far a new end stands from the value: a part of it."""

LINE = re.compile(r"(?P<key>[\w.]+)(?P<equals>\s*=\s*)(?P<bounds>\[[^]]*\]|[^#\s]+)(?P<rest>.*)")


def is_tight(limit: Limit) -> bool:
    """Return whether a limit holds, and would break if the value were 10 % beyond it."""
    if limit.value is None or not limit.ok:
        return False
    room = WORSE * abs(limit.value)
    below = limit.low == -math.inf or limit.low >= limit.value - room
    return below and limit.high <= limit.value + room


def rewritten(text: str, limits: list[Limit]) -> str:
    """Return a scenario's file with those limits that are not tight set anew."""
    loose = {limit.key: limit for limit in limits if not is_tight(limit)}
    head, table, tail = text.partition("\n[limits]\n")
    lines = []
    for line in tail.split("\n"):
        found = LINE.fullmatch(line)
        if found and found["key"] in loose:
            old = found["bounds"]
            new = bounds(loose[found["key"]])
            print(f"  {found['key']}: {old} -> {new}")
            line = f"{found['key']}{found['equals']}{new}{found['rest']}"
        lines.append(line)

    return head + table + "\n".join(lines)


def bounds(limit: Limit) -> str:
    """Return what a file says of a new limit."""
    if limit.value is None:
        raise SystemExit(f"{limit.key} is undefined here: take its limit out")
    room = ROOM * abs(limit.value)
    high = number(limit.value + room)
    return high if limit.low == -math.inf else f"[{number(limit.value - room)}, {high}]"


def number(value: float) -> str:
    """Return three digits of a number, in thousandths or millionths where it is small."""
    value = float(f"{value:.3g}")
    if value == 0.0 or abs(value) >= 0.1:
        return f"{value:.3g}"
    power = 3 * math.floor(math.log10(abs(value)) / 3)
    return f"{value / 10.0**power:.3g}e{power}"


def main(sources: list[str]) -> None:
    """Set the limits of some scenarios."""
    shipped = resources.shipped("scenarios")
    for source in sources or list(shipped):
        file = shipped.get(source, Path(source))
        print(file.stem)
        limits = rollout.run(Scenario.load(file)).limits
        loose = {limit.key for limit in limits if not is_tight(limit)}
        text = rewritten(file.read_text(encoding="utf-8"), limits)
        left = loose - changed(text, limits)
        if left:
            raise SystemExit(f"{file}: set by hand, one a line under [limits]: {sorted(left)}")
        file.write_text(text, encoding="utf-8")


def changed(text: str, limits: list[Limit]) -> set[str]:
    """Return the keys whose limits a file has otherwise than they were judged."""
    now = dict(tables.flat(tomllib.loads(text)["limits"]))
    read = {
        key: value if isinstance(value, list) else [-math.inf, value] for key, value in now.items()
    }
    return {limit.key for limit in limits if read.get(limit.key) != [limit.low, limit.high]}


if __name__ == "__main__":
    main(sys.argv[1:])
