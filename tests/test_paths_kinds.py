"""Gait, hop, step and lines: rates that are rates, smooth seams, periods, tables, and refusals."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import msgspec
import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import tables
from fivebar_sim.paths import KINDS, FootPath, Gait, Hop, Lines, PathSpec, Sample, Step

POINTS = ((0.01, -0.08), (-0.02, -0.07), (-0.02, -0.09), (0.015, -0.075))
RAMP = 0.3
PATHS: dict[str, FootPath] = {
    "gait": Gait(
        centre=(0.004, -0.08),
        stride=0.03,
        lift=0.02,
        frequency=1.6,
        duty=0.6,
        touchdown=0.15,
        ramp=RAMP,
    ),
    "hop": Hop(low=0.05, high=0.085, frequency=1.6, thrust=0.2, flight=0.3, tuck=0.01, ramp=RAMP),
    "step": Step(start=(-0.02, -0.08), stop=(0.01, -0.07), lift=0.02, seconds=0.7, ramp=RAMP),
    "lines": Lines(points=POINTS, seconds=(0.2, 0.45, 0.35), ramp=RAMP),
}
PERIOD = 0.625
OWN_SEAMS = {
    "gait": PERIOD * np.array([0.3, 0.5, 0.7, 1.3, 1.5, 1.7]),
    "hop": PERIOD * np.array([0.2, 0.35, 0.5, 1.0, 1.2, 1.35]),
    "step": np.array([0.35, 0.7]),
    "lines": np.array([0.2, 0.65, 1.0]),
}
"""Times of the nominal path at which its jerk may jump [s]."""
SEAMS = {name: np.append(own + 0.5 * RAMP, RAMP) for name, own in OWN_SEAMS.items()}
"""Times after the ramp or at its end at which the jerk may jump [s]."""


def difference(after: Sample, before: Sample) -> np.ndarray:
    return np.stack([b - a for a, b in zip(before, after, strict=True)])


# law


@pytest.mark.parametrize("name", ["gait", "hop"])
@given(time=st.floats(RAMP, 10.0), cycles=st.integers(1, 20))
def test_cyclic_paths_repeat(name: str, time: float, cycles: int) -> None:
    path = PATHS[name]
    assert path.period == PERIOD
    now = path.at(time)
    later = path.at(time + cycles * PERIOD)
    seams = np.array(SEAMS[name]) / PERIOD
    if np.min(np.abs((time / PERIOD - seams + 0.5) % 1.0 - 0.5)) > 1e-12:
        # rounding of t < 23 s is 4e-15 s; times velocity 1, acceleration 50, jerk 1e4 in SI
        assert np.all(np.abs(difference(later, now)) < np.array([[1e-14], [1e-12], [1e-9]]))


@pytest.mark.parametrize("name", ["step", "lines"])
def test_held_paths_rest_for_ever(name: str) -> None:
    path = PATHS[name]
    held = path.at(np.array([path.rest + 1e-12, path.rest + 1e-9, 50.0]))  # after its rounding
    last = {"step": (0.01, -0.07), "lines": POINTS[-1]}[name]
    np.testing.assert_array_equal(held.position, [last] * 3)
    np.testing.assert_array_equal([held.velocity, held.acceleration], 0.0)
    assert (path.period, path.end) == (None, math.inf)
    assert not np.allclose(path.at(path.rest - 0.05).position, last, atol=1e-5)


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4)])
def test_batches_equal_a_plain_loop(path: FootPath, batch: tuple[int, ...]) -> None:
    time = np.random.default_rng(0).uniform(0.0, 1.4, batch)
    many = path.at(time)
    for field in Sample._fields:
        assert getattr(many, field).shape == (*batch, 2)
        loop = [getattr(path.at(t), field) for t in time.ravel()]
        np.testing.assert_array_equal(getattr(many, field).reshape(-1, 2), loop)


# slope


@pytest.mark.parametrize("name", PATHS)
def test_velocity_and_acceleration_are_slopes(name: str) -> None:
    path = PATHS[name]
    step = 1e-6
    time = np.random.default_rng(1).uniform(step, 1.2, 2000)
    seams = np.array([*SEAMS[name], 0.0])
    time = time[np.abs(time[:, None] - seams).min(axis=1) > 2.0 * step]
    slopes = difference(path.at(time + step), path.at(time - step)) / (2.0 * step)
    now = path.at(time)
    # step^2 / 6 times the third derivative (p: 1e4 m/s^3, p': 1e6 m/s^4) is 2e-9 and 2e-7;
    # rounding eps |p| / step is 1e-11, eps t |p''| / step 1e-9 and eps t |p'''| / step 1e-6
    np.testing.assert_allclose(slopes[0], now.velocity, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(slopes[1], now.acceleration, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("name", PATHS)
def test_seams_are_continuous(name: str) -> None:
    path = PATHS[name]
    step = 1e-9
    seams = np.array(SEAMS[name])
    jumps = np.abs(difference(path.at(seams + step), path.at(seams - step)))
    # 2 step times the next derivative: velocity < 2 m/s, acceleration < 50 m/s^2, jerk < 1e4 m/s^3
    bound = 2.0 * step * np.array([2.0, 50.0, 1e4])[:, None]
    assert np.all(jumps[0] < bound[0])
    if name == "lines":
        return  # its velocity jumps
    if name == "gait":  # and here z' alone, at touch-down: see its own test
        landing = np.isclose(np.mod((seams - 0.5 * RAMP) / PERIOD, 1.0), 0.7)
        jumps[1, landing, 1] = 0.0
    assert np.all(jumps[1] < bound[1])
    assert np.all(jumps[2] < bound[2])


# edge


@pytest.mark.parametrize("name", PATHS)
def test_kinds_go_to_a_table_and_come_back(name: str) -> None:
    table = tomllib.loads(tomli_w.dumps(msgspec.to_builtins(PATHS[name])))
    assert table["kind"] == name
    assert tables.convert(table, KINDS[name], "path", "mine.toml") == PATHS[name]
    assert msgspec.convert(table, PathSpec) == PATHS[name]
    table["outside"] = "clamp"
    legal = r"mine.toml: path.outside must be one of 'refuse', 'nearest', got 'clamp'"
    with pytest.raises(ConfigError, match=legal):
        tables.convert(table, KINDS[name], "path", "mine.toml")


def test_only_hops_need_a_ground_and_only_cycles_are_eased() -> None:
    assert [name for name, kind in KINDS.items() if kind.needs_ground] == ["hop"]
    default = {name: f.default for name, kind in KINDS.items() for f in _ramp(kind)}
    assert {name for name, ramp in default.items() if ramp == 0.0} == {
        "heights",
        "hop",
        "lines",
        "step",
    }


def _ramp(kind: type[FootPath]) -> list[Any]:
    return [f for f in msgspec.structs.fields(kind) if f.name == "ramp"]


# refusal

GAIT = {"stride": 0.02, "lift": 0.01, "frequency": 2.0, "centre": [0.0, -0.08]}
HOP = {"low": 0.05, "high": 0.08, "frequency": 2.0, "thrust": 0.2, "flight": 0.3}
STEP = {"start": [0.0, -0.08], "stop": [0.01, -0.08], "lift": 0.01, "seconds": 0.5}
LINES = {"points": POINTS, "seconds": 1.0}


@pytest.mark.parametrize(
    ("kind", "legal", "change", "message"),
    [
        ("gait", GAIT, {"centre": [0.0, math.nan]}, "centre[1] must be in [-1000, 1000] m"),
        ("gait", GAIT, {"stride": math.inf}, "stride must be in [-1000, 1000] m, got inf"),
        ("gait", GAIT, {"lift": 0.0}, "lift must be in (0, 1000) m, got 0.0"),
        ("gait", GAIT, {"frequency": 0.0}, "frequency must be in (0, 1e+06) Hz, got 0.0"),
        ("gait", GAIT, {"duty": 1.0}, "duty must be in (0, 1), got 1.0"),
        ("gait", GAIT, {"duty": 0.0}, "duty must be in (0, 1), got 0.0"),
        ("gait", GAIT, {"touchdown": -0.1}, "touchdown must be in [0, 0.24] m/s, got -0.1"),
        ("gait", GAIT, {"touchdown": 0.25}, "touchdown must be in [0, 0.24] m/s, got 0.25"),
        ("hop", HOP, {"x": math.nan}, "x must be in [-1000, 1000] m, got nan"),
        ("hop", HOP, {"high": -0.1}, "high must be in (0, 1000) m, got -0.1"),
        ("hop", HOP, {"low": 0.08}, "low must be in (0, 0.08) m, got 0.08"),
        ("hop", HOP, {"thrust": 0.0}, "thrust must be in (0, 1), got 0.0"),
        ("hop", HOP, {"flight": 0.8}, "flight must be in (0, 0.8), got 0.8"),
        ("hop", HOP, {"tuck": 0.04}, "tuck must be in [0, 0.03] m, got 0.04"),
        ("step", STEP, {"stop": [0.0, math.inf]}, "stop[1] must be in [-1000, 1000] m, got inf"),
        ("step", STEP, {"lift": -0.01}, "lift must be in [0, 1000] m, got -0.01"),
        ("step", STEP, {"seconds": 0.0}, "seconds must be in (0, 1e+06) s, got 0.0"),
        ("step", STEP, {"ramp": 0.6}, "ramp must be in [0, 0.5] s, the time that the path moves"),
        ("lines", LINES, {"points": POINTS[:1]}, "points must be at least 2, got 1"),
        (
            "lines",
            LINES,
            {"points": [[0.0, 0.0], [0.0, math.nan]]},
            "points[1][1] must be in [-1000, 1000] m, got nan",
        ),
        ("lines", LINES, {"seconds": [1.0, 2.0]}, "seconds must be one number, or 3 for 4 points"),
        ("lines", LINES, {"seconds": [1, 2, 0]}, "seconds[2] must be in (0, 1e+06) s, got 0.0"),
        ("lines", LINES, {"seconds": -1.0}, "seconds must be in (0, 1e+06) s, got -1.0"),
        ("lines", LINES, {"ramp": 3.5}, "ramp must be in [0, 3] s, the time that the path moves"),
    ],
)
def test_illegal_tables_are_refused(
    kind: str, legal: dict[str, Any], change: dict[str, Any], message: str
) -> None:
    assert isinstance(msgspec.convert({"kind": kind, **legal}, PathSpec), KINDS[kind])
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert({"kind": kind, **legal, **change}, PathSpec)
    assert str(caught.value).startswith(message)
