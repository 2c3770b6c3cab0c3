"""The array types of the public signatures, and conversion of arguments to them."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Iterator
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.errors import ArgumentError

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


ROWS = 4096
"""Rows of a long array that are computed at once, so that what comes up meanwhile stays small."""

FEW = 64
"""Numbers up to which it takes less time to write an array out than to broadcast a view of it."""


def blocks(rows: int) -> Iterator[slice]:
    """Yield the slices of at most `ROWS` rows that make up all rows."""
    for start in range(0, rows, ROWS):
        yield slice(start, min(start + ROWS, rows))


def largest_of_rows(values: Array) -> Array:
    """Return what max(axis=-1) does for a few columns, (..., k) to (...), 100 times as fast.

    NumPy reduces each short row by itself.
    """
    return reduce(np.maximum, [values[..., k] for k in range(values.shape[-1])])


def largest_of_columns(values: Array) -> Array:
    """Return what max(axis=0) does for long columns, (N, k) to (k,), as `largest_of_rows` does."""
    return np.array([column.max() for column in values.T])


def total(values: Iterable[Any]) -> Any:
    """Return the sum of one or more numbers or arrays, one added to the other, with the same bits.

    Python's own sum makes up for the rounding of floats, from 3.12 on, and not for that of arrays.
    """
    return reduce(operator.add, values)


def sum_of_columns(values: NDArray[Any]) -> Array:
    """Return what sum(axis=0) does for long columns, (N, k) to (k,), N at least 1, bit by bit."""
    # One number after the other, as over the rows; the sum of a single column would be pairwise.
    return np.array([np.cumsum(column)[-1] for column in values.T])


def first_index(bad: Bools) -> tuple[int, ...]:
    """Return the index of the first True in a batch of any shape; () for a single value."""
    return tuple(int(i) for i in np.argwhere(bad)[0])


def at(index: tuple[int, ...]) -> str:
    """Return " at index (2, 0)" for a message, or "" for a single value."""
    return f" at index {index}" if index else ""


def as_vectors(values: ArrayLike, name: str, size: int) -> Array:
    """Return values as float64 vectors, shape (..., size).

    Args:
        values: Points, or tuples of angles.
        name: Name of the argument, for the message.
        size: Length of the last axis.

    Raises:
        ArgumentError: Unless the values are numbers of shape (..., size).
    """
    try:
        vectors = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must be numbers of shape (..., {size}): {error}") from None
    # A scalar has no last axis to look at.
    if vectors.ndim == 0 or vectors.shape[-1] != size:
        raise ArgumentError(f"{name} must have shape (..., {size}), got {vectors.shape}")
    return vectors


def as_pairs(values: ArrayLike, name: str) -> Array:
    """Return values as float64 pairs, shape (..., 2); see `as_vectors`."""
    return as_vectors(values, name, 2)


def finite(values: Array, name: str) -> Array:
    """Return the values if all are finite.

    Raises:
        ArgumentError: Some value is NaN or infinite; the message names the first index.
    """
    good = np.isfinite(values)
    if not good.all():
        raise ArgumentError(f"{name} must be finite{at(first_index(~good))}")
    return values


def broadcast(**arrays: Array) -> list[Array]:
    """Return the arrays broadcast to one shape.

    Raises:
        ArgumentError: The shapes do not broadcast; the message names the arrays.
    """
    # A controller asks at every step, with arrays that are alike already.
    if len({array.shape for array in arrays.values()}) == 1:
        return list(arrays.values())

    try:
        shape = np.broadcast(*arrays.values()).shape
    except ValueError:
        shapes = " and ".join(str(array.shape) for array in arrays.values())
        names = " and ".join(arrays)
        raise ArgumentError(f"{names} must broadcast, got shapes {shapes}") from None

    if math.prod(shape) > FEW:
        return list(np.broadcast_arrays(*arrays.values()))
    return [array if array.shape == shape else _filled(array, shape) for array in arrays.values()]


def _filled(array: Array, shape: tuple[int, ...]) -> Array:
    """Return an array of a shape with what another one broadcasts to."""
    filled = np.empty(shape)
    filled[...] = array
    return filled
