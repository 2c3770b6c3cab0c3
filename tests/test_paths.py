"""Foot paths: rates that are rates, a start from rest, seams that do not show, and refusals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import (
    KINDS,
    Circle,
    Csv,
    Ellipse,
    FigureEight,
    FootPath,
    Line,
    PathSpec,
    Sample,
)
from fivebar_sim.paths.base import ease

RAMP = 0.25
KNOTS = np.array([0.0, 0.05, 0.13, 0.18, 0.3, 0.37, 0.45])
ROWS = "0,0,-80 .05,9,-77 .13,20,-70 .18,11,-62 .3,-3,-66 .37,-18,-71 .45,-8,-79"
SHAPES: dict[str, FootPath] = {
    "ellipse": Ellipse(centre=(0.003, -0.072), radii=(0.020, 0.008), frequency=2.0),
    "circle": Circle(centre=(0.003, -0.072), radius=0.011, frequency=2.0),
    "line": Line(start=(-0.02, -0.08), stop=(0.01, -0.07), frequency=2.0),
    "figure-eight": FigureEight(centre=(0.003, -0.072), radii=(0.02, 0.008), frequency=2.0),
}
NAMES = [*SHAPES, "csv", "csv-periodic"]


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, FootPath]:
    file = tmp_path_factory.mktemp("csv") / "foot.csv"
    file.write_text("\n".join(["time_s,x_mm,z_mm", *ROWS.split()]))
    name = str(file)
    return {**SHAPES, "csv": Csv(file=name), "csv-periodic": Csv(file=name, periodic=True)}


def kinks(path: FootPath) -> np.ndarray:
    """Return the times at which the jerk may jump: ramp's end, turns of the line, knots."""
    own = 0.25 * np.arange(5)
    if isinstance(path, Csv):
        own = np.concatenate([KNOTS, KNOTS + (path.period or 0.0)])
    return np.append(own + 0.5 * RAMP, RAMP)


def difference(after: Sample, before: Sample) -> np.ndarray:
    return np.stack([b - a for a, b in zip(before, after, strict=True)])


# law


@given(ramp=st.floats(1e-3, 10.0), tau=st.floats(0.0, 2.0))
def test_ramp_is_never_faster_than_the_path(ramp: float, tau: float) -> None:
    s, s_dot, _ = ease(np.array(ramp * tau), ramp)
    assert 0.0 <= s_dot <= 1.0 + 1e-15  # rounding of a sum that nears 1
    assert max(0.0, tau - 0.5) * ramp * (1.0 - 1e-12) <= s <= ramp * tau


@pytest.mark.parametrize("name", [*SHAPES, "csv-periodic"])
@given(time=st.floats(RAMP, 10.0), cycles=st.integers(1, 20))
def test_paths_repeat_with_their_period(
    paths: dict[str, FootPath], name: str, time: float, cycles: int
) -> None:
    path = paths[name]
    assert path.period is not None
    delta = difference(path.at(time + cycles * path.period), path.at(time))
    # rounding of t < 20 s is 4e-15 s; times velocity 1, acceleration 30, jerk 1e4 in SI
    assert np.all(np.abs(delta) < np.array([[1e-14], [3e-13], [1e-10]]))


@pytest.mark.parametrize("name", NAMES)
def test_paths_start_from_rest_and_are_half_a_ramp_late_after_it(
    paths: dict[str, FootPath], name: str
) -> None:
    path = paths[name]
    begin = path.at(0.0)
    np.testing.assert_array_equal(begin.position, path.nominal(0.0).position)
    np.testing.assert_array_equal([begin.velocity, begin.acceleration], 0.0)
    time = np.linspace(RAMP, 0.45, 101)
    for is_now, nominal in zip(path.at(time), path.nominal(time - 0.5 * RAMP), strict=True):
        np.testing.assert_array_equal(is_now, nominal)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4)])
def test_batches_equal_a_plain_loop(
    paths: dict[str, FootPath], name: str, batch: tuple[int, ...]
) -> None:
    time = np.random.default_rng(0).uniform(0.0, 0.45, batch)
    many = paths[name].at(time)
    for field in Sample._fields:
        assert getattr(many, field).shape == (*batch, 2)
        loop = [getattr(paths[name].at(t), field) for t in time.ravel()]
        np.testing.assert_array_equal(getattr(many, field).reshape(-1, 2), loop)


# slope


@pytest.mark.parametrize("name", NAMES)
def test_velocity_and_acceleration_are_slopes(paths: dict[str, FootPath], name: str) -> None:
    path = paths[name]
    step = 1e-6
    time = np.random.default_rng(1).uniform(step, min(path.end, 0.6) - step, 2000)
    time = time[np.abs(time[:, None] - kinks(path)).min(axis=1) > 2.0 * step]
    slopes = difference(path.at(time + step), path.at(time - step)) / (2.0 * step)
    now = path.at(time)
    # step^2 / 6 times the third derivative (p: 1e4 m/s^3, p': 1e6 m/s^4) is 2e-9 and 2e-7;
    # rounding eps |p| / step is 1e-11, eps t |p''| / step 1e-9 and eps t |p'''| / step 1e-6
    np.testing.assert_allclose(slopes[0], now.velocity, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(slopes[1], now.acceleration, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("name", NAMES)
def test_seams_are_smooth_up_to_the_acceleration(paths: dict[str, FootPath], name: str) -> None:
    path = paths[name]
    step = 1e-9
    seams = kinks(path)
    seams = seams[(seams > 0.0) & (seams < path.end)]
    jumps = difference(path.at(seams + step), path.at(seams - step))
    # 2 step times the next derivative: velocity < 2 m/s, acceleration < 50 m/s^2, jerk < 1e4 m/s^3
    assert np.all(np.abs(jumps) < 2.0 * step * np.array([2.0, 50.0, 1e4])[:, None, None])


# edge


def test_shapes_have_the_period_of_their_frequency() -> None:
    for path in SHAPES.values():
        assert path.period == 0.5
        assert path.end == math.inf
        assert np.ptp(path.nominal([0.1, 0.35]).position[:, 0]) > 0.005  # half of it is too short


def test_lists_are_kept_as_tuples() -> None:
    numbers: Any = [0, -1]  # a list would leave a frozen path editable
    assert Line(start=numbers, stop=(1.0, 0.0), frequency=1.0).start == (0.0, -1.0)


def test_ramp_of_zero_starts_at_speed() -> None:
    path = msgspec.structs.replace(SHAPES["ellipse"], ramp=0.0)
    np.testing.assert_array_equal(path.at(0.0).velocity, path.nominal(0.0).velocity)


@pytest.mark.parametrize("name", ["ellipse", "circle"])
def test_orbits_start_lowest_towards_plus_x(name: str) -> None:
    path = SHAPES[name]
    start = path.nominal(0.0)
    time = np.linspace(0.0, 0.5, 1001)
    assert np.argmin(path.nominal(time[:-1]).position[:, 1]) == 0
    assert start.velocity[0] > 0.0
    assert start.velocity[1] == 0.0
    assert start.acceleration[1] > 0.0


def test_extents_are_as_named() -> None:
    time = np.linspace(0.0, 0.5, 4001)  # every quarter and eighth of the period is hit
    for name, size in {"ellipse": (0.04, 0.016), "circle": (0.022, 0.022)}.items():
        extent = np.ptp(SHAPES[name].nominal(time).position, axis=0)
        np.testing.assert_allclose(extent, size, rtol=1e-13)  # rounding
    eight = SHAPES["figure-eight"].nominal(time)
    np.testing.assert_allclose(np.ptp(eight.position, axis=0), (0.04, 0.016), rtol=1e-13)
    assert np.all(eight.velocity[0] > 0.0)
    np.testing.assert_allclose(eight.position[[0, 2000, 4000]], [(0.003, -0.072)] * 3, atol=1e-16)


def test_line_rests_at_both_ends() -> None:
    line = Line(start=(-0.02, -0.08), stop=(0.01, -0.07), frequency=2.0)
    turns = line.nominal([0.0, 0.25, 0.5, 0.75])
    np.testing.assert_array_equal(turns.position, [line.start, line.stop] * 2)
    np.testing.assert_array_equal([turns.velocity, turns.acceleration], 0.0)
    middle = line.nominal(0.125)
    np.testing.assert_allclose(middle.position, (-0.005, -0.075), atol=1e-16)
    # 15/8 of the mean speed |span| / (T / 2): the minimum-jerk peak
    np.testing.assert_allclose(middle.velocity, np.array([0.03, 0.01]) * 4.0 * 15 / 8, rtol=1e-14)
    held = Line(start=(0.0, -0.08), stop=(0.0, -0.08), frequency=1.0).at(np.linspace(0.0, 1.0, 9))
    np.testing.assert_array_equal(held.position, [(0.0, -0.08)] * 9)


def test_kinds_decode_by_name() -> None:
    periodic = ["circle", "csv", "ellipse", "figure-eight", "gait", "hop", "line"]
    assert sorted(KINDS) == sorted([*periodic, "angles", "heights", "lines", "sine", "step"])
    for name, path in SHAPES.items():
        spec = msgspec.to_builtins(path)
        assert spec["kind"] == name
        assert msgspec.convert(spec, PathSpec) == path
        assert path.resolve(Path()) is path
        assert (path.rest, path.needs_ground, path.outside) == (math.inf, False, "refuse")


# refusal

ELLIPSE = {"kind": "ellipse", "centre": [0.0, -0.07], "radii": [0.02, 0.008], "frequency": 2.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radii": [-0.02, 0.008]}, "radii[0] must be in (0, 1000) m, got -0.02"),
        ({"radii": [0.02, 0]}, "radii[1] must be in (0, 1000) m, got 0.0"),
        ({"centre": [math.nan, 0.0]}, "centre[0] must be in [-1000, 1000] m, got nan"),
        ({"frequency": 0.0}, "frequency must be in (0, 1e+06) Hz, got 0.0"),
        ({"frequency": math.inf}, "frequency must be in (0, 1e+06) Hz, got inf"),
        ({"ramp": -0.1}, "ramp must be in [0, inf) s, got -0.1"),
        ({"ramp": math.nan}, "ramp must be in [0, inf) s, got nan"),
        ({"outside": "clamp"}, "Invalid enum value 'clamp' - at `$[...].outside`"),
        ({"radius": 1.0}, "Object contains unknown field `radius`"),
        ({"kind": "elipse"}, "Invalid value 'elipse'"),
        ({"kind": "csv"}, "Object contains unknown field"),
    ],
)
def test_illegal_tables_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert({"path": {**ELLIPSE, **change}}, dict[str, PathSpec])
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("make", "start"),
    [
        (
            lambda: Circle(centre=(0, 0), radius=-1.0, frequency=1.0),
            "radius must be in (0, 1000) m",
        ),
        (lambda: Circle(centre=(0,), radius=1.0, frequency=1.0), "centre must be two"),  # pyright: ignore[reportArgumentType]
        (lambda: Line(start="ab", stop=(0, 0), frequency=1.0), "start must be two"),  # pyright: ignore[reportArgumentType]
        (
            lambda: Line(start=(0, 0), stop=(0, math.inf), frequency=1.0),
            "stop[1] must be in [-1000, 1000] m, got inf",
        ),
        (lambda: Csv(file=""), "file must be the name of a CSV file, got ''"),
        (lambda: Csv(file="a", given=1.0), "period needs periodic = true, got 1.0 s"),
        (
            lambda: Csv(file="a", periodic=True, given=-1.0),
            "period must be in (0, inf) s, got -1.0",
        ),
    ],
)
def test_illegal_numbers_are_refused(make: Any, start: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        make()
    assert str(caught.value).startswith(start)


def test_times_off_the_path_are_refused(paths: dict[str, FootPath]) -> None:
    for name, time, message in [
        ("ellipse", [0.0, -0.1], "time must be in [0, inf) s, got -0.1 s at index (1,)"),
        ("csv-periodic", math.nan, "time must be in [0, inf) s, got nan s"),
        ("csv-periodic", math.inf, "time must be in [0, inf) s, got inf s"),
        ("line", "soon", "time must be numbers [s]: could not convert string to float: 'soon'"),
    ]:
        for ask in (paths[name].at, paths[name].nominal, paths[name].cycle):
            with pytest.raises(ArgumentError) as caught:
                ask(time)
            assert str(caught.value) == message
    assert RAMP == 0.25  # the path is half of that late, and so ends
    with pytest.raises(ArgumentError, match=r"^time must be in \[0, 0\.575\] s, got 0\.58 s"):
        paths["csv"].at(0.58)
    with pytest.raises(ArgumentError, match=r"^time must be in \[0, 0\.45\] s, got 0\.46 s"):
        paths["csv"].nominal(0.46)
    with pytest.raises(ArgumentError, match="does not repeat has no cycle"):
        paths["csv"].cycle(0.1)
    end = paths["csv"].end  # rounding is forgiven
    last = paths["csv"].at(end * (1.0 + 1e-12))
    np.testing.assert_array_equal(last.position, paths["csv"].at(end).position)
