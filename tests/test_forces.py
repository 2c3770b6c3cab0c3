"""Foot forces: their values over time, the stance they keep to, and refusals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.paths import Circle, Gait
from fivebar_sim.scenario import forces
from fivebar_sim.scenario.forces import KINDS, Constant, Csv, FootForce, ForceSpec, Stance

GAIT = Gait(centre=(0.0, -0.08), stride=0.03, lift=0.02, frequency=2.0, duty=0.6, ramp=0.25)
CIRCLE = Circle(centre=(0.0, -0.08), radius=0.01, frequency=2.0)
ROWS = "time_s,z_N,x_N\n# z first\n1,10,0\n1.5,20,-2\n3,5,1\n"


@pytest.fixture
def csv(tmp_path: Path) -> Csv:
    (tmp_path / "force.csv").write_text(ROWS)
    return Csv(file="force.csv").resolve(tmp_path)


# law


@given(time=st.floats(0.25, 20.0), cycles=st.integers(1, 20))
def test_stance_force_repeats_with_the_gait(time: float, cycles: int) -> None:
    force = Stance(peak=(3.0, 20.0))
    delta = force.at(time + 0.5 * cycles, GAIT) - force.at(time, GAIT)
    # rounding of t < 30 s is 4e-15 s; the rate is pi / 0.3 s times 20 N
    np.testing.assert_allclose(delta, 0.0, atol=1e-11)


def test_stance_force_is_a_half_sine_of_the_planned_stance() -> None:
    force = Stance(peak=(-3.0, 20.0))
    time = np.linspace(0.0, 1.5, 6001)
    F = force.at(time, GAIT)
    stands = GAIT.in_stance(time)
    np.testing.assert_array_equal(F[~stands], 0.0)
    assert np.all(F[stands, 1] >= 0.0)
    np.testing.assert_allclose(F[:, 0], -0.15 * F[:, 1], rtol=1e-14, atol=1e-15)
    # late by half the ramp: touch-down at 0.475 s, the peak 0.15 s later, lift-off after 0.3 s
    marks = force.at([0.475, 0.55, 0.625, 0.775 - 1e-12, 0.775 + 1e-12], GAIT)[:, 1]
    np.testing.assert_allclose(marks, 20.0 * np.array([0.0, 0.5**0.5, 1.0, 0.0, 0.0]), atol=1e-9)
    # its impulse over a period: 2/pi peak times the stance
    window = (time >= 0.5) & (time < 1.0)
    assert np.sum(F[window, 1]) * 0.25e-3 == pytest.approx(2.0 / np.pi * 20.0 * 0.3, rel=1e-5)


def test_stance_force_keeps_to_the_ramp() -> None:
    force = Stance(peak=(0.0, 20.0))
    np.testing.assert_array_equal(force.at(0.0, GAIT), (0.0, 20.0))  # begins in mid-stance
    tau = 0.4  # the path's own time is 0.25 s times 5/2 tau^4 - 3 tau^5 + tau^6 there
    s = 0.25 * (2.5 * tau**4 - 3.0 * tau**5 + tau**6)
    expected = 20.0 * math.sin(math.pi * (2.0 * s + 0.3) / 0.6)
    assert force.at(0.1, GAIT)[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4)])
def test_batches_equal_a_plain_loop(csv: Csv, batch: tuple[int, ...]) -> None:
    time = np.random.default_rng(0).uniform(0.0, 2.0, batch)
    kinds: list[FootForce] = [Constant(value=(1.0, 2.0)), Stance(peak=(1.0, 2.0)), csv]
    for force in kinds:
        many = force.at(time, GAIT)
        assert many.shape == (*batch, 2)
        loop = [force.at(t, GAIT) for t in time.ravel()]
        np.testing.assert_array_equal(many.reshape(-1, 2), loop)


# edge


def test_csv_force_is_straight_between_its_rows(csv: Csv) -> None:
    assert csv.end == 2.0
    F = csv.at([0.0, 0.25, 0.5, 1.25, 2.0], CIRCLE)
    np.testing.assert_allclose(F, [(0, 10), (-1, 15), (-2, 20), (-0.5, 12.5), (1, 5)], rtol=1e-14)
    Path(csv.file).unlink()
    np.testing.assert_array_equal(csv.at(0.0, CIRCLE), (0.0, 10.0))  # read once


def test_constant_force_is_constant() -> None:
    F = Constant(value=(0.5, -2.0)).at(np.linspace(0.0, 9.0, 4), CIRCLE)
    np.testing.assert_array_equal(F, [(0.5, -2.0)] * 4)
    F[0] = 0.0  # the caller's own
    assert Constant(value=(0.5, -2.0)).end == math.inf


def test_kinds_decode_by_name() -> None:
    assert sorted(KINDS) == ["constant", "csv", "stance"]
    for force in (Constant(value=(1.0, 2.0)), Stance(peak=(1.0, 2.0)), Csv(file="a.csv")):
        table = msgspec.to_builtins(force)
        assert KINDS[table["kind"]] is type(force)
        assert msgspec.convert(table, ForceSpec) == force
    assert Constant(value=(1.0, 2.0)).resolve(Path()) == Constant(value=(1.0, 2.0))


# refusal


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "constant", "value": [0.0, math.nan]}, "value[1] must be in [-1e+06, 1e+06] N"),
        ({"kind": "constant", "value": [0.0]}, "Expected `array` of length 2, got 1"),
        ({"kind": "constant"}, "Object missing required field `value`"),
        ({"kind": "constant", "peak": [0, 0], "value": [0, 0]}, "Object contains unknown field"),
        ({"kind": "stance", "peak": [2e6, 0.0]}, "peak[0] must be in [-1e+06, 1e+06] N"),
        ({"kind": "csv", "file": ""}, "file must be the name of a CSV file, got ''"),
    ],
)
def test_illegal_tables_are_refused(table: dict[str, Any], message: str) -> None:
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert(table, ForceSpec)
    assert str(caught.value).startswith(message)


def test_a_path_without_a_stance_is_refused() -> None:
    legal = 'a force of kind "stance" needs a path of kind "gait", got "circle"'
    with pytest.raises(ArgumentError, match=f"^{legal}$"):
        Stance(peak=(0.0, 1.0)).at(0.0, CIRCLE)


def test_times_without_a_force_are_refused(csv: Csv) -> None:
    kinds: list[FootForce] = [Constant(value=(1.0, 2.0)), Stance(peak=(1.0, 2.0)), csv]
    for force in kinds:
        with pytest.raises(ArgumentError, match=r"time must be in \[0, .*, got -0.1 s at index"):
            force.at([0.0, -0.1], GAIT)
    with pytest.raises(ArgumentError, match=r"time must be in \[0, 2\] s, got 2.1 s"):
        csv.at(2.1, GAIT)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,x_mm,z_mm\n0,0,0\n", "line 1: unknown column 'x_mm'; known: time_s, x_N, z_N"),
        ("time_s,x_N,z_N\n0,0,0\n", "a foot force needs at least 2 rows, got 1"),
        ("time_s,x_N,z_N\n0,0,0\n1,nan,0\n", "line 3: x_N must be a number in"),
    ],
)
def test_illegal_csv_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(ConfigError) as caught:
        forces.Csv(file="bad.csv").resolve(tmp_path)
    assert message in str(caught.value)
    with pytest.raises(ConfigError, match=r"^cannot read foot force .*no\.csv: No such file"):
        forces.Csv(file="no.csv").resolve(tmp_path)
