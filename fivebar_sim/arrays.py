"""The array types of the public signatures, and conversion of arguments to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.errors import ArgumentError

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


def first_index(bad: Bools) -> tuple[int, ...]:
    """Return the index of the first True in a batch of any shape; () for a single value."""
    return tuple(int(i) for i in np.argwhere(bad)[0])


def at(index: tuple[int, ...]) -> str:
    """Return " at index (2, 0)" for a message, or nothing for a single value."""
    return f" at index {index}" if index else ""


def as_pairs(values: ArrayLike, name: str) -> Array:
    """Return values as float64 pairs, shape (..., 2).

    Args:
        values: Points (x, z) or angle pairs.
        name: What the argument is called, for the message.

    Raises:
        ArgumentError: Unless the values are numbers of shape (..., 2).
    """
    try:
        pairs = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must be numbers of shape (..., 2): {error}") from None
    if pairs.ndim == 0 or pairs.shape[-1] != 2:
        raise ArgumentError(f"{name} must have shape (..., 2), got {pairs.shape}")
    return pairs
