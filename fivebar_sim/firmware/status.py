"""The statuses of the firmware's functions."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Statuses = NDArray[np.int32]


class Status(IntEnum):
    """Why a function of the firmware has no answer; `firmware/fivebar_leg.h` has the same."""

    OK = 0
    UNREACHABLE = 1
    LOOP_OPEN = 2
    OUT_OF_LIMITS = 3
    NOT_FINITE = 4
    SINGULAR = 5
    BAD_ARGUMENT = 6
    BAD_LEG = 7


def first_of(*checks: tuple[ArrayLike, Status]) -> Statuses:
    """Return the status of the first check that fails, in each place; OK where none does.

    Args:
        checks: Where something is wrong, (...), and the status that says so, in the order in which
            the C code asks.
    """
    status = np.int32(Status.OK)
    for wrong, name in reversed(checks):
        status = np.where(wrong, np.int32(name), status)
    return np.asarray(status, dtype=np.int32)


def then(status: Statuses, later: Statuses) -> Statuses:
    """Return the first status where it is not OK, else the later one."""
    return np.where(status == Status.OK, later, status)
