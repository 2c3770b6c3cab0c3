"""Foot paths from a CSV file: through every point, whatever the spelling, and refusals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from fivebar_sim import Scenario, run
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.paths import Csv, PathSpec

TROT = Path(__file__).parents[1] / "scenarios" / "q8bot_trot.csv"
TIMES = [10.0, 10.05, 10.13, 10.18, 10.3, 10.4, 10.45]  # irregular, and not from 0 [s]
POINTS = [(0, -80), (9, -77), (20, -70), (11, -62), (-3, -66), (-18, -71), (-8, -79)]  # [mm]
KNOTS = np.array(TIMES) - TIMES[0]
FEET = 1e-3 * np.array(POINTS)


def table(header: str = "time_s,x_mm,z_mm", scale: float = 1.0, end: str = "\n") -> str:
    rows = [f"{t},{x * scale!r},{z * scale!r}" for t, (x, z) in zip(TIMES, POINTS, strict=True)]
    return end.join([header, *rows, ""])


def csv(folder: Path, text: str | bytes, **keys: Any) -> Csv:
    raw = text if isinstance(text, bytes) else text.encode()
    (folder / "foot.csv").write_bytes(raw)
    return msgspec.convert({"file": "foot.csv", **keys}, Csv).resolve(folder)


# edge


def test_csv_passes_through_its_points(tmp_path: Path) -> None:
    for periodic in (False, True):
        path = csv(tmp_path, table(), periodic=periodic)
        np.testing.assert_allclose(path.nominal(KNOTS).position, FEET, rtol=0.0, atol=1e-16)
    path = csv(tmp_path, table(), ramp=0.2)
    assert (path.span, path.end) == (KNOTS[-1], KNOTS[-1] + 0.1)
    # four points or fewer are one polynomial: two rows give the straight line
    two = csv(tmp_path, "time_s,x_m,z_m\n0,0,-0.08\n2,0.02,-0.07\n").nominal(0.5)
    np.testing.assert_allclose(two.position, (0.005, -0.0775), atol=1e-16)
    np.testing.assert_allclose(two.velocity, (0.01, 0.005), atol=1e-16)


def test_csv_of_a_cubic_is_that_cubic(tmp_path: Path) -> None:
    rows = [f"{t},{0.02 * t**3!r},{0.03 * t**2 - 0.08!r}" for t in (0.0, 0.3, 0.5, 0.9, 1.0)]
    foot = csv(tmp_path, "\n".join(["time_s,x_m,z_m", *rows])).nominal(0.4)
    np.testing.assert_allclose(foot.position, (0.00128, -0.0752), rtol=1e-13)
    np.testing.assert_allclose(foot.velocity, (0.0096, 0.024), rtol=1e-13)
    np.testing.assert_allclose(foot.acceleration, (0.048, 0.06), rtol=1e-12)


RECTANGLE = """time_s,x_mm,z_mm
0.00,20,-80
0.05,10,-80
0.10,0,-80
0.15,-10,-80
0.20,-20,-80
0.25,-20,-70
0.30,-10,-70
0.35,0,-70
0.40,10,-70
0.45,20,-70
"""
"""A gait along a rectangle, ten points in half a second."""


def test_only_the_spline_overshoots_a_rectangle(tmp_path: Path) -> None:
    times = np.linspace(0.0, 0.5, 2001)
    low = (-0.02, -0.08)
    high = (0.02, -0.07)
    worst = {}
    for kind in ("cubic", "linear", "hold"):
        path = csv(tmp_path, RECTANGLE, periodic=True, interpolation=kind)
        foot = path.nominal(times).position
        beyond = np.maximum(foot - high, low - foot)
        worst[kind] = beyond.max(axis=0)
    np.testing.assert_allclose(worst["cubic"], (1.579e-3, 1.064e-3), atol=1e-6)
    assert (worst["linear"] <= 1e-16).all()
    assert (worst["hold"] == 0.0).all()


def test_lines_and_steps_through_the_points(tmp_path: Path) -> None:
    for periodic in (False, True):
        middle = 0.5 * (KNOTS[1:] + KNOTS[:-1])
        length = np.diff(KNOTS)[:, None]
        lines = csv(tmp_path, table(), periodic=periodic, interpolation="linear").nominal(middle)
        np.testing.assert_allclose(lines.position, 0.5 * (FEET[1:] + FEET[:-1]), atol=1e-16)
        np.testing.assert_allclose(lines.velocity, np.diff(FEET, axis=0) / length, rtol=1e-12)
        assert (lines.acceleration == 0.0).all()

        path = csv(tmp_path, table(), periodic=periodic, interpolation="hold")
        np.testing.assert_array_equal(path.nominal(middle).position, FEET[:-1])
        np.testing.assert_array_equal(path.nominal(KNOTS).position, FEET)
        assert (path.nominal(middle).velocity == 0.0).all()
        assert len(path.knots) == len(KNOTS) + periodic
        assert path.jumps


def test_interpolation_is_written_and_others_are_refused(tmp_path: Path) -> None:
    path = csv(tmp_path, table(), interpolation="hold")
    assert msgspec.to_builtins(path)["interpolation"] == "hold"
    assert msgspec.to_builtins(csv(tmp_path, table()))["interpolation"] == "cubic"
    word: Any = "holds"
    with pytest.raises(ArgumentError, match=r"unknown interpolation 'holds'.*did you mean 'hold'"):
        Csv(file="foot.csv", interpolation=word)


@pytest.mark.parametrize(
    ("settings", "trips"),
    [
        ("path.interpolation=linear", False),
        ("path.interpolation=linear controller.feedforward=velocity", True),
        ("path.interpolation=hold", True),
        ("path.interpolation=hold servo=xl330", False),
    ],
)
def test_jumps_that_a_run_does_not_resolve_trip_the_guard(
    tmp_path: Path, settings: str, trips: bool
) -> None:
    """The plain servo's torque jumps with its command; the XL330's bus and limit let it last."""
    (tmp_path / "foot.csv").write_text(RECTANGLE, "utf-8")
    text = 'duration = 0.8\n[path]\nkind = "csv"\nfile = "foot.csv"\nperiodic = true\n'
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    found = run(Scenario.load(tmp_path / "mine.toml", settings.split()))
    lost = [guard.name for guard in found.measured.guards if not guard.ok]
    assert ("jolts" in lost) == trips
    assert (found.verdict == "fail") == trips


@pytest.mark.parametrize(
    "text",
    [
        table("time_s,x_m,z_m", scale=1e-3),
        b"\xef\xbb\xbf" + table(end="\r\n").encode(),
        "# from a logger\n\n"
        + table(" time_s , x_mm , z_mm ").replace("\n10.3", "\n # lift\n10.3"),
        "\n".join(",".join(reversed(line.split(","))) for line in table().split("\n")),
    ],
    ids=["metres", "BOM and CRLF", "comments, blanks, spaces", "other order"],
)
def test_csv_spellings_give_the_same_path(tmp_path: Path, text: str | bytes) -> None:
    time = np.linspace(0.0, 0.45, 100)
    once = csv(tmp_path, table()).at(time)
    for a, b in zip(once, csv(tmp_path, text).at(time), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)  # mm to m rounds


def test_csv_period_rules(tmp_path: Path) -> None:
    closed = table() + "10.5,0,-80\n"
    for text, keys, period in [
        (table(), {}, 0.515),  # the median interval is 0.065 s, the mean 0.075 s
        (table(), {"period": 0.5}, 0.5),
        (closed, {}, 0.5),
        (closed, {"period": 0.5}, 0.5),
        (closed, {"period": 0.6}, 0.6),
    ]:
        path = csv(tmp_path, text, periodic=True, **keys)
        assert path.period == pytest.approx(period, rel=1e-12)
        assert path.end == math.inf
    spelt_out = msgspec.convert(msgspec.to_builtins(path), PathSpec)
    assert spelt_out == path
    assert spelt_out.period == path.period
    assert spelt_out.resolve(tmp_path / "elsewhere") == path  # the name is absolute by now


def test_csv_is_read_once(tmp_path: Path) -> None:
    path = csv(tmp_path, table())
    Path(path.file).unlink()
    assert path.at(0.4).position.shape == (2,)


def test_trot_of_the_q8bot() -> None:
    path = Csv(file=TROT.name, periodic=True).resolve(TROT.parent)
    rows = np.loadtxt(TROT, delimiter=",", skiprows=3)
    assert rows.shape == (360, 3)
    assert path.period == pytest.approx(1.8, rel=1e-12)
    np.testing.assert_allclose(path.nominal(rows[:, 0]).position, 1e-3 * rows[:, 1:], atol=1e-16)
    # 8 equal cycles, to the spline's memory of the table's rounded times
    one = path.nominal(np.linspace(0.3, 0.5, 99))
    two = path.nominal(np.linspace(0.525, 0.725, 99))
    np.testing.assert_allclose(one.position, two.position, atol=1e-14)
    # what rounding the corners costs: it dips 0.356 mm below the commanded ground line
    lowest = path.nominal(np.linspace(0.0, 1.8, 180_001)).position[:, 1].min()
    assert lowest == pytest.approx(-43.716e-3, abs=1e-6)


# refusal

LEGAL = "the header must be time_s,x_mm,z_mm or time_s,x_m,z_m, in any order"
HEAD = "# note\ntime_s,x_m,z_m\n0,0,0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", f": no header; {LEGAL}"),
        ("time_s,x_mm\n", f", line 1: no column 'z_mm'; {LEGAL}, got 'time_s,x_mm'"),
        ("time_s,x_mm,z_m\n", f", line 1: no column 'z_mm'; {LEGAL}, got 'time_s,x_mm,z_m'"),
        (
            "\ntime_s,x_m,z_m,x_m\n",
            f", line 2: too many columns; {LEGAL}, got",
        ),
        (
            "time_s,x_m,z_m,y_m\n",
            ", line 1: unknown column 'y_m'; known: time_s, x_m, x_mm,",
        ),
        (HEAD + "1,2\n", ", line 4: a row must have 3 cells (time_s,x_m,z_m), got 2"),
        (HEAD + "\n1,a,0\n", ", line 5: x_m must be a number in [-1e+06, 1e+06], got 'a'"),
        (HEAD + "1,0,nan\n", ", line 4: z_m must be a number in [-1e+06, 1e+06], got 'nan'"),
        (HEAD + "inf,0,0\n", ", line 4: time_s must be a number in [-1e+06, 1e+06], got 'inf'"),
        (HEAD + "1,1_0,0\n", ", line 4: x_m must be a number in [-1e+06, 1e+06], got '1_0'"),
        (HEAD + "1,,0\n", ", line 4: x_m must be a number in [-1e+06, 1e+06], got ''"),
        (
            HEAD + "2,0,0\n#\n1,0,0\n",
            ", line 6: times are not sorted: time_s must be > 2.0 s of",
        ),
        (
            HEAD + "#\n0,0,0\n",
            ", line 5: times are repeated: time_s must be > 0.0 s of line 3",
        ),
        (HEAD, ": a foot path needs at least 2 rows, got 1"),
        (b"# a\n# \xe9t\xe9\n", ", line 2: must be UTF-8, got byte 0xe9"),
    ],
)
def test_illegal_csv_is_refused(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        csv(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'foot.csv'}{message}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        (table(), {"period": 0.45}, "period must be > 0.45 s, the sampled span, got 0.45 s"),
        (table() + "10.5,0,-80\n", {"period": 0.4}, "period must be >= 0.5 s, the sampled span"),
        (HEAD + "1,1,0\n2,0,0\n", {}, "a periodic path needs at least 3 distinct points, got 2"),
        (table(), {"periodic": False, "ramp": 0.5}, "ramp must be in [0, 0.45] s"),
    ],
)
def test_illegal_rhythms_are_refused(
    tmp_path: Path, text: str, keys: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        csv(tmp_path, text, **{"periodic": True, **keys})
    assert str(caught.value).startswith(f"{tmp_path / 'foot.csv'}: {message}")


def test_unreadable_csv_is_refused(tmp_path: Path) -> None:
    for name, why in {"no.csv": "No such file or directory", ".": "Is a directory"}.items():
        with pytest.raises(ConfigError, match=f"^cannot read foot path .*: {why}$"):
            Csv(file=name).resolve(tmp_path)
