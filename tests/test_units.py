"""Numbers as people read them: the size stays, the unit fits it, and there is no exponent."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim import units
from fivebar_sim.metrics import Limit
from fivebar_sim.metrics.catalogue import CATALOGUE, shown
from fivebar_sim.metrics.limits import bounds

UNITS = [unit for ladder in units.LADDERS for unit in ladder]


# law


@given(st.floats(1e-20, 1e12) | st.floats(-1e12, -1e-20) | st.just(0.0), st.sampled_from(UNITS))
def test_size_stays_and_reads_well(number: float, unit: str) -> None:
    """In SI the number is the same; it has 0.01 to 1000 units where a ladder reaches so far."""
    ladder = next(each for each in units.LADDERS if unit in each)
    fitted, name = units.fitting(number, unit)
    assert fitted * ladder[name] == pytest.approx(number * ladder[unit], rel=1e-12, abs=0.0)
    names = list(ladder)
    if name != names[-1]:
        assert abs(float(f"{fitted:.4g}")) < units.MOST
    if name != names[0] and number != 0.0:
        assert abs(fitted) >= units.LEAST
    assert math.copysign(1.0, fitted) == math.copysign(1.0, number)


@given(st.sampled_from([row for row in CATALOGUE if row.unit in UNITS]), st.floats(1e-9, 1e6))
def test_no_metric_with_a_ladder_is_shown_with_an_exponent(row: object, value: float) -> None:
    key = row.key  # pyright: ignore[reportAttributeAccessIssue]
    assert "e+" not in shown(key, value)


# edge


@pytest.mark.parametrize(
    ("number", "unit", "read"),
    [
        (1.167e6, "mN m", "1.167 kN m"),
        (1167.0, "mN m", "1.167 N m"),
        (999.94, "mN m", "999.9 mN m"),
        (999.96, "mN m", "1 N m"),  # it would round to 1000
        (5.0, "mN m", "5 mN m"),
        (0.004, "mN m", "4 uN m"),
        (0.117, "um", "0.117 um"),
        (2e-5, "mm", "0.02 um"),
        (2e-6, "mm", "2 nm"),
        (1400.0, "um", "1.4 mm"),
        (80_000.0, "mm", "80 m"),
        (-2500.0, "mJ", "-2.5 J"),
        (1500.0, "ms", "1.5 s"),
        (0.0, "mm", "0 mm"),
        (20_000.0, "cm2", "2 m2"),
        (120_000.0, "%", "120000 %"),
        (12.0, "", "12"),
        (3.0, "steps", "3 steps"),
    ],
)
def test_numbers_and_how_they_are_read(number: float, unit: str, read: str) -> None:
    assert units.text(number, unit) == read


def test_limits_of_two_sizes_have_two_units() -> None:
    def of(low: float, high: float) -> str:
        return bounds(Limit("load.torque_rms.A", low, high, 1.0, True))

    assert of(0.218, 0.241) == "218 to 241 mN m"
    assert of(0.0, 1.1) == "0 to 1.1 N m"
    assert of(0.9, 1.1) == "900 mN m to 1.1 N m"
    assert of(-math.inf, 1.18) == "<= 1.18 N m"
