"""Inputs nobody would write on purpose: mutated files, odd values, odd words; strategies."""

from __future__ import annotations

import functools
import json
import tomllib
from typing import Any

import tomli_w
from hypothesis import strategies as st

from fivebar_sim import control, geometry, paths
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.files import resources, tables
from fivebar_sim.metrics import LIMIT_KEYS
from fivebar_sim.scenario import forces, scenario, scenes

Strategy = st.SearchStrategy[Any]
Table = dict[str, Any]

SHORTENED: dict[str, dict[str, float]] = {
    "airhockey-gain-schedule": {"path.seconds": 0.25, "duration": 1.05},
    "airhockey-pd": {"path.seconds": 0.1, "duration": 0.45},
    "classic-ellipse": {"duration": 0.8},
    "classic-figure-eight": {"path.frequency": 2.0, "duration": 0.8},
    "payload-ellipse": {"duration": 0.8},
    "q8bot-trot": {"path.period": 0.8, "duration": 1.3},
    "rail-hop": {"duration": 1.0},
    "rail-landing": {"duration": 0.8},
    "treadmill-trot": {"duration": 0.7},
}
"""The shipped scenarios as short as they can be."""

SCALARS = [
    *(0, 1, -1, 2, 3, 0.0, -0.0, 0.5, 2.5, -0.07, 1e-3, 1e-6, 1e-9, 1e-12, 1e3, 1e6, 1e9, 1e15),
    *(5e-324, 1e-300, 1e-160, 1e160, 1e300, 1.7976931348623157e308, -1.7976931348623157e308),
    *(float("nan"), float("inf"), float("-inf"), 2**31, 2**63 - 1, 2**63, -(2**64), 10**30),
    *(
        True,
        False,
        "",
        "nan",
        "1",
        "é",
        "../x",
        "/dev/zero",
        "x\0y",
        "a" * 3000,
        "\x1b[31m",
        "\u202e",
    ),
    *([], {}, [[]], [0, 0], [0.0, -0.072], [1e308, 1e308], [1, "x"], [1, 2, 3], [[0, 0], [0, 0]]),
    *({"kind": "x"}, {"a": {"b": {}}}, [{}], {"preset": "classic"}),
]
"""Values that break things, and some that are nothing special."""

WORDS = [
    *("air", "rail", "treadmill", "payload", "discrete", "implicitfast", "nearest", "refuse"),
    *("leg.toml", "servo.toml", "foot.csv", "force.csv", "none", "torque", "velocity"),
    *(*control.known(), *paths.KINDS, *forces.KINDS),
    *(*resources.shipped("models/legs"), *resources.shipped("models/servos")),
]
TOKENS = [
    *("[", "]", "[[", "]]", "{", "}", '"', "'", "'''", '"""', "=", ".", ",", "\n", "\r", "#", "-"),
    *("nan", "inf", "1e999", "0x7f", "1_0", "1979-05-27T07:32:00Z", "true", "é", "\0", "\ufeff"),
    *(
        "[path]",
        "[[path]]",
        "[limits]",
        "e",
        "0",
        "9",
        "99999999999999999999",
        "  ",
        "\t",
        "\u202e",
        "\U0001d7d8",
    ),
    *("[" * 2000, "a." * 2000 + "a=1\n", "1" * 5000, ";", "time_s", "_"),
]


def _keys() -> list[str]:
    """Return the dotted keys that a scenario may have, of every kind."""
    parts: dict[str, list[type]] = {
        "path": list(paths.KINDS.values()),
        "force": list(forces.KINDS.values()),
        "scene": list(scenes.KINDS.values()),
        "controller": [control.find(name) for name in control.known()],
        "servo": [Servo],
        "sensors": [Sensors],
        "sim": [scenario.Sim],
    }
    dotted = {
        f"{top}.{key}" for top, kinds in parts.items() for k in kinds for key in tables.keys(k)
    }
    dotted |= {f"leg.{key}" for key in (*geometry.FiveBar.__slots__, "preset")}
    dotted |= {f"limits.{key}" for key in LIMIT_KEYS} | {"servo.preset", "controller.name"}
    return sorted({*dotted, *scenario.KEYS, "sim.timestep", "duration", "x", "path.x.y"})


KEYS = _keys()

PLAUSIBLE = {
    **{f"leg.{length}": (0.03, 0.08) for length in ("L1", "L2", "L3", "L4")},
    **{"leg.L5": (0.0, 0.06), "leg.L6": (0.0, 0.03), "leg.bend": (-1.0, 1.0), "leg.tilt": (-1, 1)},
    **{"leg.density": (1e2, 1e4), "leg.armature": (0.0, 1e-3), "leg.radius": (1e-3, 1e-2)},
    **{"servo.kp": (0.1, 100.0), "servo.kd": (0.0, 1.0), "servo.limit": (0.01, 2.0)},
    **{"servo.speed": (1.0, 100.0), "servo.friction": (0.0, 0.05), "servo.rate": (50.0, 1e3)},
    **{"servo.delay": (0.0, 0.02), "servo.resolution": (0.0, 0.02), "sim.seed": (0, 9)},
    **{"sim.timestep": (4e-4, 0.01), "duration": (0.3, 2.0), "path.ramp": (0.0, 0.3)},
    **{"path.frequency": (1.0, 10.0), "path.duty": (0.1, 0.9), "path.lift": (0.0, 0.03)},
    **{"path.seconds": (0.05, 0.3), "path.stride": (-0.06, 0.06), "path.radius": (1e-3, 0.02)},
    **{"scene.mass": (0.01, 2.0), "scene.drop": (0.0, 0.1), "scene.friction": (0.0, 2.0)},
    **{"sensors.noise": (0.0, 0.01), "sensors.delay": (0.0, 0.02), "controller.kp": (0.1, 500.0)},
    **{"controller.kd": (0.0, 5.0), "limits.tracking.rms": (1e-9, 1e-2), "scene.speed": (-1, 1)},
}
"""Keys whose values are numbers, and what is nothing special [SI]."""


def base(name: str) -> Table:
    """Return the table of a shipped scenario, as short as it can be."""
    table = tables.read(resources.shipped("scenarios")[name], "scenario")
    for key, value in SHORTENED[name].items():
        tables.put(table, key.split("."), value, name)
    return table


values: Strategy = st.one_of(
    st.sampled_from(SCALARS),
    st.sampled_from(WORDS),
    st.floats(width=64),
    st.floats(1e-4, 10.0),
    st.integers(-3, 3),
    st.lists(st.one_of(st.floats(-0.2, 0.2), st.sampled_from(SCALARS[:20])), max_size=4),
    st.text(max_size=8).filter(lambda text: not text.startswith("/") and ".." not in text),
)


def scaled(value: Any, factor: float) -> Any:
    """Return a value with all its numbers times a factor."""
    if isinstance(value, list):
        return [scaled(part, factor) for part in value]
    return value * factor if isinstance(value, float) else value


@st.composite
def changes(draw: st.DrawFn) -> tuple[str, Any]:
    """Return a key and its new value: mostly a number that may do, sometimes anything."""
    how = draw(st.sampled_from("plain plain plain size any".split()))
    if how == "any":
        return draw(st.sampled_from(KEYS)), draw(values)
    key = draw(st.sampled_from(list(PLAUSIBLE)))
    if how == "size":
        return key, 10.0 ** draw(st.integers(-15, 15))
    return key, draw(st.floats(*map(float, PLAUSIBLE[key])))


@st.composite
def changed(draw: st.DrawFn, table: Table) -> Table:
    """Return a table with some of its numbers a little different, and some keys at odds."""
    new = json.loads(json.dumps(table))
    numbers = [key for key, value in tables.flat(new) if not isinstance(value, (str, bool))]
    for key in draw(st.lists(st.sampled_from(numbers), max_size=3)) if numbers else []:
        parts = key.split(".")
        old: Any = functools.reduce(lambda t, part: t[part], parts, new)
        tables.put(new, parts, scaled(old, draw(st.floats(0.7, 1.4))), "")
    return new


def _toml(table: Table) -> bytes:
    return tomli_w.dumps(table).encode("utf-8", "backslashreplace")


@st.composite
def tomls(draw: st.DrawFn, text: str) -> bytes:
    """Return what may be a TOML file: one that is, with some numbers and values exchanged."""
    table = draw(changed(tomllib.loads(text)))
    for _ in range(draw(st.sampled_from((0, 0, 1, 2)))):
        flat = list(_branches(table))
        holder, key = flat[draw(st.integers(0, len(flat) - 1))]
        if draw(st.integers(0, 3)) == 0:
            del holder[key]
        else:
            holder[key] = draw(values)
        if not table:
            break
    return _toml(table)


def _put(table: Table, key: str, value: Any) -> None:
    """Set a dotted key, whatever was on the way."""
    *way, last = key.split(".")
    for part in way:
        if not isinstance(table.get(part), dict):
            preset = part in ("leg", "servo") and part in table
            table[part] = {"preset": table[part]} if preset else {}
        table = table[part]
    table[last] = value


@st.composite
def mutated(draw: st.DrawFn, content: bytes) -> bytes:
    """Return bytes with pieces cut, doubled, moved, inserted, or bits turned."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(data)))
        size = draw(st.sampled_from((1, 2, 5, 20, 100, 1000)))
        how = draw(st.sampled_from("cut double insert bit byte end".split()))
        if how == "cut":
            del data[at : at + size]
        elif how == "double":
            data[at:at] = data[at : at + size]
        elif how == "insert":
            data[at:at] = draw(st.sampled_from(TOKENS)).encode()
        elif how == "end":
            del data[at:]
        elif at < len(data):
            data[at] = (
                data[at] ^ (1 << draw(st.integers(0, 7)))
                if how == "bit"
                else draw(st.integers(0, 255))
            )
    return bytes(data)


@st.composite
def scenarios(draw: st.DrawFn) -> bytes:
    """Return what may be a scenario's file: a shipped one, changed by key, by text, or both."""
    table = draw(changed(base(draw(st.sampled_from(list(SHORTENED))))))
    for key, value in draw(st.lists(changes(), max_size=3)):
        _put(table, key, value)
    if draw(st.booleans()):
        table.pop("limits", None)
    text = _toml(table)
    return draw(mutated(text)) if draw(st.integers(0, 3)) == 0 else text


@st.composite
def settings(draw: st.DrawFn) -> list[str]:
    """Return some KEY=VALUE of --set."""
    words = []
    for key, value in draw(st.lists(changes(), min_size=1, max_size=4)):
        text = value if isinstance(value, str) else _toml({"v": value}).decode()[4:].strip()
        words.append(f"{key}={text}")
    return [*words, draw(st.text(max_size=6))] if draw(st.integers(0, 4)) == 0 else words


@st.composite
def parts(draw: st.DrawFn, folder: str, names: tuple[str, ...]) -> bytes:
    """Return what may be a leg's or a servo's file: one of some presets, changed."""
    name = draw(st.sampled_from(names))
    table = draw(changed(tables.read(resources.shipped(folder)[name], folder)))
    known = list(geometry.FiveBar.__slots__) if folder.endswith("legs") else tables.keys(Servo)
    for _ in range(draw(st.sampled_from((0, 0, 1, 2)))):
        table[draw(st.sampled_from(known))] = draw(values)
    text = _toml(table)
    return draw(mutated(text)) if draw(st.integers(0, 3)) == 0 else text


cells: Strategy = st.one_of(
    st.floats(-100.0, 100.0).map(repr),
    st.floats().map(repr),
    st.sampled_from(
        ["", " ", "nan", "inf", "1e999", "1_0", "0x1", "é", "-0", "1e-320", '"1"', "٣"]
    ),
)


@st.composite
def csvs(draw: st.DrawFn, header: str, content: bytes) -> bytes:
    """Return what may be a CSV of a path or of a force."""
    if draw(st.booleans()):
        return draw(mutated(content))
    rows = [header]
    time = 0.0
    for _ in range(draw(st.integers(0, 8))):
        time += draw(st.sampled_from((0.05, 0.2, 0.7, 1e-9, 1e-300, 0.0, 1e5, -0.1)))
        near = draw(st.integers(0, 3)) > 0
        pair = [f"{draw(st.floats(-8, 8))!r}", f"{draw(st.floats(-80, -60))!r}"]
        rows.append(",".join([repr(time), *(pair if near else draw(st.lists(cells, max_size=3)))]))
    if draw(st.booleans()):
        rows.append(f"{time + 2.0!r},0,-75")  # long enough for any run here
    return draw(st.sampled_from(("\n", "\r\n", "\r"))).join(rows).encode("utf-8", "replace")


@st.composite
def jsons(draw: st.DrawFn, content: bytes) -> bytes:
    """Return what may be a file of JSON: one that is, with values exchanged, or as bytes."""
    if draw(st.booleans()):
        return draw(mutated(content))
    table = json.loads(content)
    for _ in range(draw(st.integers(1, 3))):
        flat = list(_branches(table))
        holder, key = flat[draw(st.integers(0, len(flat) - 1))]
        how = draw(st.sampled_from("number number any none".split()))
        if how == "none":
            del holder[key]
        elif how == "any" or not isinstance(holder[key], (int, float)):
            holder[key] = draw(values)
        else:
            holder[key] = draw(st.floats(0.0, 1.0))
        if not table:
            break
    return json.dumps(table).encode()


def _branches(table: Any) -> Any:
    """Yield (table, key) of every value at any depth."""
    if isinstance(table, dict):
        for key, value in list(table.items()):
            yield table, key
            yield from _branches(value)
