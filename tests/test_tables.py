"""TOML tables: what comes in, what KEY=VALUE means, and refusals that name file and key."""

from __future__ import annotations

import math
import tomllib
from datetime import date
from pathlib import Path
from typing import Any, Literal

import msgspec
import pytest

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import tables


class Gains(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A controller's or servo's table."""

    mode: Literal["soft", "hard"]
    gain: float = 1.0
    count: int = 2
    pair: tuple[float, float] = (0.0, 1.0)
    limit: float | None = None

    def __post_init__(self) -> None:
        if not self.gain > 0.0:
            raise ValueError(f"gain must be > 0, got {self.gain!r}")


def refused(table: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        tables.convert(table, Gains, "servo", "run.toml")
    return str(caught.value)


# law


@pytest.mark.parametrize(
    ("setting", "parts", "value"),
    [
        ("duration=2", ["duration"], 2),
        ("path.radii=[0.01, 0.02]", ["path", "radii"], [0.01, 0.02]),
        ("sim.seed = 0x10 # hex", ["sim", "seed"], 16),
        ("scene=air", ["scene"], "air"),
        ('scene="air"', ["scene"], "air"),
        ("name=  two words ", ["name"], "two words"),
        ("a=b=c", ["a"], "b=c"),
        ("name=", ["name"], ""),
        ("quiet=true", ["quiet"], True),
        ("day=1979-05-27", ["day"], date(1979, 5, 27)),
        ("limits={tracking={rms=1}}", ["limits"], {"tracking": {"rms": 1}}),
        ("  sim . seed =1", ["sim", "seed"], 1),
        ('limits."tracking.rms"=1', ["limits", "tracking", "rms"], 1),
        ("'sim'.seed=1", ["sim", "seed"], 1),
        ('seed=1\nname="other"', ["seed"], '1\nname="other"'),  # one key a setting
        ("name=é", ["name"], "é"),
    ],
)
def test_setting_is_toml_or_a_bare_string(setting: str, parts: list[str], value: Any) -> None:
    assert tables.parse_setting(setting) == (parts, value)


def test_put_makes_tables_on_the_way_and_replaces_what_was_there() -> None:
    table: tables.Table = {"sim": {"seed": 1, "timestep": 0.001}}
    tables.put(table, ["sim", "seed"], 2, "run.toml")
    tables.put(table, ["a", "b", "c"], [1], "run.toml")
    tables.put(table, ["path"], {"kind": "line"}, "run.toml")
    assert table == {
        "sim": {"seed": 2, "timestep": 0.001},
        "a": {"b": {"c": [1]}},
        "path": {"kind": "line"},
    }


def test_flat_names_every_value() -> None:
    nested = {"a": {"b": {"c": 1}, "d": [2, 3]}, "e.f": 4, "empty": {}}
    assert dict(tables.flat(nested)) == {"a.b.c": 1, "a.d": [2, 3], "e.f": 4}


def test_convert_takes_what_is_written_and_defaults() -> None:
    assert tables.convert({"mode": "hard"}, Gains, "servo", "run.toml") == Gains(mode="hard")
    written = {"mode": "soft", "gain": 3, "count": 4, "pair": [1, 2.5], "limit": 0.5}
    gains = tables.convert(written, Gains, "servo", "run.toml")
    assert gains == Gains(mode="soft", gain=3.0, count=4, pair=(1.0, 2.5), limit=0.5)
    assert isinstance(gains.gain, float)
    assert tables.keys(Gains) == ["mode", "gain", "count", "pair", "limit"]


def test_bounds_are_low_and_high_by_dotted_key() -> None:
    table = {"tracking": {"rms": 1e-3, "max": [0, 2e-3]}, "load.share_A": [0.4, 0.6]}
    known = ["tracking.rms", "tracking.max", "load.share_A"]
    assert tables.bounds(table, known, "limits", "run.toml") == {
        "tracking.rms": (-math.inf, 1e-3),
        "tracking.max": (0.0, 2e-3),
        "load.share_A": (0.4, 0.6),
    }


@pytest.mark.parametrize("text", [b"a = 1\n", b"\xef\xbb\xbfa = 1\n", b"a = 1\r\n"])
def test_file_may_have_a_byte_order_mark_and_any_line_ends(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "x.toml").write_bytes(text)
    assert tables.read(tmp_path / "x.toml", "scenario") == {"a": 1}


# refusal


@pytest.mark.parametrize("setting", ["", "=", "a", "=1", ".=1", "a..b=1", "limits.=1", " =1"])
def test_setting_without_key_or_value_is_refused(setting: str) -> None:
    with pytest.raises(ConfigError) as caught:
        tables.parse_setting(setting)
    assert str(caught.value) == f"--set takes KEY=VALUE, got {setting!r}"


def test_setting_that_is_not_utf8_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"--set takes KEY=VALUE, got 'name=\\udcff'"):
        tables.parse_setting("name=\udcff")


@pytest.mark.parametrize("text", ["[" * 5000, "9" * 5000])
def test_what_the_parser_cannot_hold_is_a_string(text: str) -> None:
    assert tables.parse_setting(f"a={text}") == (["a"], text)


def test_key_inside_a_value_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"^run\.toml: sim is a value, so it has no sim\.seed$"):
        tables.put({"sim": 1}, ["sim", "seed"], 1, "run.toml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a = \n", "not TOML: Invalid value (at line 1, column 5)"),
        (b"a = 1\na = 2\n", "not TOML: Cannot overwrite a value"),
        (b"[a]\n[a]\n", "not TOML: Cannot declare ('a',) twice"),
        (b"\xff\xfea", "not TOML: 'utf-8' codec can't decode byte 0xff in position 0"),
        (b"a = " + b"[" * 5000, "not TOML: nested too deep"),
        (b"a = " + b"9" * 5000, "not TOML: Exceeds the limit"),
    ],
)
def test_file_that_is_not_toml_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        tables.read(file, "scenario")
    assert str(caught.value).startswith(f"{file}: {message}")


def test_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for name, why in {"no.toml": "No such file or directory", ".": "Is a directory"}.items():
        with pytest.raises(ConfigError, match=f"^cannot read scenario .*: {why}$"):
            tables.read(tmp_path / name, "scenario")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, "a.b must be finite, got nan"),
        (-math.inf, "a.b must be finite, got -inf"),
        ([1, math.nan], "a.b must be finite, got [1, nan]"),
        ([[1.0], [math.inf]], "a.b must be finite, got [[1.0], [inf]]"),
        ([{"c": math.nan}], "a.b must be finite, got [{'c': nan}]"),
        (2**63, "a.b must fit in 64 bits, has 64"),
        ([10**400], "a.b must fit in 64 bits, has 1329"),
    ],
)
def test_numbers_that_are_none_are_refused_at_any_depth(value: Any, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        tables.check_finite({"a": {"b": value}}, "run.toml")
    assert str(caught.value) == f"run.toml: {message}"
    tables.check_finite({"a": [1, -(2**63), 2**63 - 1, True, "nan", 1e308]}, "run.toml")


def test_unknown_key_is_refused_with_a_guess() -> None:
    assert refused({"mode": "soft", "gian": 1}) == (
        "run.toml: [servo]: unknown key 'gian'; known: count, gain, limit, mode, pair "
        "(did you mean 'gain'?)"
    )


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([], "servo must be a table, got []"),
        ("xl330", "servo must be a table, got 'xl330'"),
        ({}, "servo.mode is missing"),
        ({"mode": "sotf"}, "servo.mode must be one of 'soft', 'hard', got 'sotf'"),
        ({"mode": 1}, "servo.mode must be a string, got 1"),
        ({"mode": "soft", "gain": "8"}, "servo.gain must be a number, got '8'"),
        ({"mode": "soft", "gain": True}, "servo.gain must be a number, got True"),
        ({"mode": "soft", "gain": {"x": 1}}, "servo.gain must be a number, got {'x': 1}"),
        ({"mode": "soft", "gain": -1}, "servo.gain must be > 0, got -1.0"),
        ({"mode": "soft", "count": 1.5}, "servo.count must be an integer, got 1.5"),
        ({"mode": "soft", "limit": "none"}, "servo.limit must be a number, got 'none'"),
        ({"mode": "soft", "pair": [1]}, "servo.pair must be an array of length 2, got [1]"),
        ({"mode": "soft", "pair": [1, "a"]}, "servo.pair[1] must be a number, got [1, 'a']"),
    ],
)
def test_wrong_value_is_refused(table: Any, message: str) -> None:
    assert refused(table) == f"run.toml: {message}"


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (1, "limits must be a table, got 1"),
        ([{"warnings": 0}], "limits must be a table, got [{'warnings': 0}]"),
        ({"warning": 0}, "[limits]: unknown key 'warning'; known: tracking.rms, warnings (did"),
        ({"tracking": 1}, "[limits]: unknown key 'tracking'; known"),
        ({"tracking": {"rms": {"A": 1}}}, "[limits]: unknown key 'tracking.rms.A'; known"),
        ({"tracking": {"rms": 1}, "tracking.rms": 2}, "limits.tracking.rms is set twice"),
        *[
            ({"warnings": bad}, f"limits.warnings must be an upper bound or [low, high], got {bad}")
            for bad in (True, [], [1], [1, 2, 3], [2, 1], [0, True], [[0], [1]])
        ],
    ],
)
def test_wrong_limit_is_refused(table: Any, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        tables.bounds(table, ["tracking.rms", "warnings"], "limits", "run.toml")
    assert str(caught.value).startswith(f"run.toml: {message}")


def test_inputs_are_not_nested_beyond_what_means_anything() -> None:
    deepest = tables.DEEPEST
    assert not tables.is_deep(tomllib.loads(".".join(["a"] * deepest) + " = 1"))
    assert tables.is_deep(tomllib.loads(".".join(["a"] * (deepest + 1)) + " = 1"))
    assert tables.is_deep(tomllib.loads("a = " + "[" * 30 + "]" * 30))
    with pytest.raises(ConfigError, match="--set takes KEY=VALUE"):
        tables.parse_setting(".".join(["a"] * (deepest + 1)) + "=1")
