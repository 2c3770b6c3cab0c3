"""A leg that was understood, as a table to read and as a preset to run."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fivebar_sim import units
from fivebar_sim.formats.incoming.loop import CLOSING, hinge_name
from fivebar_sim.formats.incoming.understood import Understood
from fivebar_sim.formats.incoming.weigh import JOINTS
from fivebar_sim.formats.urdf import NO_LIMIT

HINGES = "ABCDE"

KEYS = (
    *("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt", "mode", "assembly"),
    *("mass", "com", "com_across", "inertia", "armature", "gravity", "radius", "foot_radius"),
)
"""The keys of a preset, in their order."""

UNITS = {
    **dict.fromkeys(("L1", "com", "com_across", "radius", "foot_radius"), "m"),
    **dict.fromkeys(("bend", "tilt"), "rad"),
    **dict.fromkeys(("inertia", "armature"), "kg m^2"),
    "mass": "kg",
    "gravity": "m/s^2",
}

REACH = 6.28
"""Range from which on a joint's limits are a whole turn, and no limits [rad]."""


def rows(seen: Understood) -> Iterator[tuple[str, str, str]]:
    """Yield what each part of the leg is in the file, and what it was understood as."""
    leg = seen.leg
    model = seen.source.model
    for k, letter in enumerate(HINGES):
        kind = "closure" if seen.loop.hinges[k] == CLOSING else "joint"
        yield letter, f"{kind} {hinge_name(seen.source, seen.loop, k)}", _hinge(seen, k)
    for k, link in enumerate(leg.links):
        bodies = [model.body(body).name or f"body {body}" for body in seen.loop.links[k + 1]]
        ends = "-".join(HINGES[each] for each in JOINTS[k + 1])
        length = units.text(1e3 * getattr(leg, f"L{k + 1}"), "mm", 6)
        along, across = (1e3 * each for each in link.com)
        # Of the links a gram is the size; the table of units has no ladder of it.
        weight = f"{1e3 * link.mass:.6g} g at ({along:.5g}, {across:.4g}) mm"
        yield f"L{k + 1}", f"body {', '.join(bodies)}", f"{ends} {length}, {weight}"
    ground = model.body(seen.ground).name or "world"
    base = f"A-E {units.text(1e3 * leg.L5, 'mm', 6)}, tilt {math.degrees(leg.tilt):.6g} deg"
    yield "L5", f"body {ground}", base
    beyond = f"{units.text(1e3 * leg.L6, 'mm', 6)} beyond C, bend {math.degrees(leg.bend):.6g} deg"
    yield "foot", seen.foot.name, beyond if leg.L6 else "at C"
    yield "mode", "from a pose that closes", f"{leg.mode}, assembly {leg.assembly}"
    total = sum(link.mass for link in leg.links)
    yield "mass", "L1 to L4", f"{1e3 * total:.6g} g"


def _hinge(seen: Understood, k: int) -> str:
    """Return what the angle of a hinge is, and its limits."""
    joint = seen.loop.hinges[k]
    if joint == CLOSING or HINGES[k] == "C":
        return "passive"
    sign, offset = seen.reading(k)
    driven = HINGES[k] in "AE"

    shift = f" {offset:+.6g} rad" if offset else ""
    parts = [f"theta_{HINGES[k]} = {'' if sign > 0 else '-'}q{shift}" if driven else "passive"]
    ends = ends_of(seen, k)
    if ends is not None:
        which = "" if driven else f"theta_{HINGES[k]} "
        parts.append(f"{which}in [{ends[0]:.4g}, {ends[1]:.4g}] rad")
    torque = _torque(seen, joint) if driven else None
    if torque is not None:
        parts.append(f"up to {units.text(torque, 'N m')}")
    return ", ".join(parts)


def ends_of(seen: Understood, k: int) -> tuple[float, float] | None:
    """Return the ends of a joint's range as an angle of the leg [rad]; None if it has none.

    Args:
        seen: The leg.
        k: As in `Understood.reading`.
    """
    joint = seen.loop.hinges[k]
    if joint == CLOSING or not seen.source.model.jnt_limited[joint]:
        return None
    sign, offset = seen.reading(k)
    low, high = sorted(sign * each + offset for each in seen.source.model.jnt_range[joint].tolist())
    return (low, high) if high - low < REACH else None


def notes(seen: Understood) -> Iterator[str]:
    """Yield a line for everything that was not taken over; of ranges every digit."""
    yield from seen.notes
    for k in (0, 1, 3, 4):
        ends = ends_of(seen, k)
        if ends is not None:
            name = hinge_name(seen.source, seen.loop, k)
            yield (
                f"{name}: its range, theta_{HINGES[k]} in [{ends[0]!r}, {ends[1]!r}] rad, is not "
                "of a leg, and no run keeps it"
            )


def _torque(seen: Understood, joint: int) -> float | None:
    """Return a motor's greatest torque [N m], or None if there is no limit."""
    model = seen.source.model
    for k in np.flatnonzero(model.actuator_trnid[:, 0] == joint):
        if model.actuator_forcelimited[k]:
            return float(np.abs(model.actuator_forcerange[k]).max())
    greatest = float(np.abs(model.jnt_actfrcrange[joint]).max())
    return greatest if model.jnt_actfrclimited[joint] and greatest < NO_LIMIT else None


def text(seen: Understood) -> str:
    """Return the TOML of a leg's preset; its numbers read back as they are."""
    lines = [f"# Understood from {seen.source.path.name} by fivebar import:"]
    lines += [f"#   {what:4}  {there}: {is_}" for what, there, is_ in rows(seen)]
    left = list(notes(seen))
    if left:
        lines.append("# Not taken over:")
        lines += [f"#   {note}" for note in left]
    for key in KEYS:
        value = getattr(seen.leg, key)
        if value is None or (key in ("L6", "bend", "tilt") and value == 0.0):
            continue
        shown = list(value) if isinstance(value, tuple) else value
        unit = f" # [{UNITS[key]}]" if key in UNITS else ""
        lines.append(f"{key} = {shown!r}{unit}")

    # A comment is one line, whatever names a file has.
    return "".join("".join(c for c in line if c.isprintable()) + "\n" for line in lines)
