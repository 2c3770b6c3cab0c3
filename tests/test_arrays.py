"""Reductions over few columns: NumPy's bits, whatever the numbers are."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim.arrays import (
    Array,
    broadcast,
    largest_of_columns,
    largest_of_rows,
    sum_of_columns,
    total,
)
from fivebar_sim.errors import ArgumentError


def draws(rows: int, columns: int) -> Array:
    """Return numbers of very different sizes: sums of them depend on their order."""
    rng = np.random.default_rng(rows)
    return rng.normal(size=(rows, columns)) * 10.0 ** rng.integers(-9, 9, size=(rows, columns))


@pytest.mark.parametrize("rows", [1, 2, 9, 1000, 4097])
@pytest.mark.parametrize("columns", [2, 4])
def test_bits_are_those_of_numpy(rows: int, columns: int) -> None:
    values = draws(rows, columns)
    assert np.array_equal(sum_of_columns(values), values.sum(axis=0))
    assert np.array_equal(largest_of_columns(values), values.max(axis=0))
    assert np.array_equal(largest_of_rows(values), values.max(axis=-1))


def test_nan_is_the_largest_of_all() -> None:
    values = draws(9, 2)
    values[4, 1] = np.nan
    assert np.isnan(largest_of_rows(values)).tolist() == [k == 4 for k in range(9)]
    assert np.isnan(largest_of_columns(values)).tolist() == [False, True]
    assert np.isnan(sum_of_columns(values)).tolist() == [False, True]


def test_total_has_the_bits_of_arrays_of_one_number() -> None:
    """From Python 3.12 on sum() of these floats is 2, of arrays 0."""
    numbers = (1.0, 1e100, 1.0, -1e100)
    assert total(iter(numbers)) == total(np.array([each]) for each in numbers)[0] == 0.0


@pytest.mark.parametrize("rows", [1, 20, 1000])
def test_broadcast_is_numpy_s(rows: int) -> None:
    """Few numbers are written out, many are not; the values are the same."""
    rng = np.random.default_rng(3)
    one = rng.normal(size=(rows, 2))
    other = rng.normal(size=2)
    both = broadcast(one=one, other=other)
    for ours, theirs in zip(both, np.broadcast_arrays(one, other), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(ArgumentError, match=r"^one and x must broadcast, got"):
        broadcast(one=one, x=np.zeros(3))
