"""What can be identified: numbers of leg, servo and scene by their dotted keys, and offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import msgspec

from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import NUMBERS, Friction
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.files.quantities import units_of
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Payload

DEFAULT = (
    *("leg.L1", "leg.L2", "leg.L3", "leg.L4", "leg.armature"),
    *("servo.kp", "servo.delay", "servo.friction.base"),
)
"""What is identified unless something else is asked for."""

GEAR = "servo.friction."

OFFSETS = tuple(f"offset.{motor}" for motor in MOTORS)
"""What has to be added to a log's angles and commands [rad]."""

SHARES: dict[str, float] = {
    **dict.fromkeys(("leg.L1", "leg.L2", "leg.L3", "leg.L4", "leg.L5", "leg.L6"), 0.03),
    **dict.fromkeys(("leg.armature", "servo.kp", "servo.kd", "servo.limit", "servo.speed"), 0.3),
    **dict.fromkeys(("servo.kt", "scene.mass"), 0.3),
}
"""How much of a number is in doubt beforehand, as a part of it."""

MOST_DELAY = 0.1
"""Longest delay that is looked for [s]."""


class Parameter(NamedTuple):
    """A number to be identified.

    Attributes:
        key: Its dotted key.
        unit: Its SI unit.
        start: What the scenario says.
        doubt: How far off that may well be: the scale on which it is looked for.
        low, high: Its range.
    """

    key: str
    unit: str
    start: float
    doubt: float
    low: float
    high: float


class Case(NamedTuple):
    """A scenario with numbers put in, and the offsets of the log's angles [rad]."""

    scenario: Scenario
    offset: tuple[float, float]


def parameters(scenario: Scenario, keys: Sequence[str]) -> list[Parameter]:
    """Return what is to be identified.

    Args:
        scenario: Where the numbers start.
        keys: Dotted keys; none for `DEFAULT`.

    Raises:
        ConfigError: A key that names no number, or twice the same; a scene that is not hung up.
    """
    if scenario.scene.kind not in ("air", "payload"):
        raise ConfigError(
            "identify needs a leg that hangs, scene 'air' or 'payload', got "
            f"{scenario.scene.kind!r}: what a floor does to a foot is not known well enough"
        )
    if scenario.force is not None:
        raise ConfigError("identify needs a leg that nothing pushes: leave [force] out")

    wanted = list(keys) or list(DEFAULT)
    twice = {key for key in wanted if wanted.count(key) > 1}
    if twice:
        raise ConfigError(f"{sorted(twice)[0]} is to be identified twice")
    return [_parameter(scenario, key) for key in wanted]


def _parameter(scenario: Scenario, key: str) -> Parameter:
    """Return one of them."""
    start = _value(scenario, key)
    kp = scenario.servo.kp
    if key in SHARES:
        if not start > 0.0 and key != "servo.kd":
            raise ConfigError(f"{key} must start above 0 to be identified, got {start:g}")
        doubt = max(SHARES[key] * start, 1e-3 * kp if key == "servo.kd" else 0.0)
        lowest = 0.0 if key == "servo.kd" else 0.2 * start
        # Beyond half and double a length another leg is meant.
        highest = max(5.0 * start, 100.0 * doubt)
        if key.startswith("leg.L"):
            lowest = 0.7 * start
            highest = 1.4 * start
        return Parameter(key, _unit(key), start, doubt, lowest, highest)

    if key == "servo.delay":
        return Parameter(key, "s", start, 4e-3, 0.0, max(MOST_DELAY, 2.0 * start))
    if key in OFFSETS:
        return Parameter(key, "rad", start, 0.02, -0.5, 0.5)
    if key in (f"{GEAR}base", f"{GEAR}stribeck"):
        return Parameter(key, "N m", start, max(0.5 * start, 0.01 * kp), 0.0, 10.0 * kp)
    if key == f"{GEAR}viscous":
        return Parameter(key, "N m s/rad", start, max(0.5 * start, 2e-3 * kp), 0.0, kp)
    if key == f"{GEAR}rate_stribeck":
        return Parameter(key, "rad/s", start, 0.5 * start, 0.01, 50.0)
    return Parameter(key, _unit(key), start, 0.1, 0.0, 0.99)


def _value(scenario: Scenario, key: str) -> float:
    """Return what a scenario says.

    Raises:
        ConfigError: It is not there, or no number that can be identified.
    """
    legal = (*SHARES, "servo.delay", *OFFSETS, *(f"{GEAR}{name}" for name in NUMBERS))
    if key not in legal or key == f"{GEAR}alpha":
        known = ", ".join(each for each in legal if each != f"{GEAR}alpha")
        raise ConfigError(f"{key!r} cannot be identified; known: {known}")
    if key in OFFSETS:
        return 0.0

    found: Any = scenario
    for part in key.removeprefix(GEAR).split(".") if not key.startswith(GEAR) else ():
        found = getattr(found, part, None)
    if key.startswith(GEAR):
        found = getattr(scenario.servo.gear, key.removeprefix(GEAR))
    if not isinstance(found, (int, float)):
        raise ConfigError(f"{key} has no number in this scenario to start from")
    return float(found)


def _unit(key: str) -> str:
    """Return the SI unit of a key."""
    table, name = key.rsplit(".", 1)
    kinds: dict[str, type[Any]] = {"leg": FiveBar, "servo": Servo, "scene": Payload}
    return units_of(kinds.get(table, Friction)).get(name, "")


def put(scenario: Scenario, chosen: Sequence[Parameter], values: Array) -> Case:
    """Return a scenario with the numbers at these values.

    Raises:
        ConfigError: The numbers do not go together, such as a key of another friction model.
    """
    named = dict(zip((each.key for each in chosen), values.tolist(), strict=True))
    offset = tuple(named.pop(key, 0.0) for key in OFFSETS)
    tables: dict[str, dict[str, float]] = {"leg": {}, "servo": {}, "scene": {}, "gear": {}}
    for key, value in named.items():
        if key.startswith(GEAR):
            tables["gear"][key.removeprefix(GEAR)] = value
        else:
            table, name = key.split(".")
            tables[table][name] = value

    servo = scenario.servo
    try:
        own: dict[str, Any] = dict(tables["servo"])
        if tables["gear"]:
            own["friction"] = msgspec.structs.replace(servo.gear, **tables["gear"])
        return Case(
            msgspec.structs.replace(
                scenario,
                leg=replace(scenario.leg, **tables["leg"]),
                servo=msgspec.structs.replace(servo, **own),
                scene=msgspec.structs.replace(scenario.scene, **tables["scene"]),
            ),
            (offset[0], offset[1]),
        )
    except ArgumentError as error:
        raise ConfigError(f"the numbers to identify do not go together: {error}") from None
