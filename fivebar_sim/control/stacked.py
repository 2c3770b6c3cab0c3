"""Several objects of numbers as one whose numbers are arrays, for formulas written for one."""

from __future__ import annotations

from collections.abc import Sequence
from types import FunctionType, MethodType
from typing import Any, TypeVar, cast

import numpy as np

T = TypeVar("T")


class _Stacked:
    """What each of some objects says of itself: one value where all agree, else an array.

    Methods work on those arrays, as far as their formulas do.

    Args:
        items: Of one class.
        axes: How many axes of length 1 the arrays get after the first, (n, 1, ...).
    """

    def __init__(self, items: Sequence[Any], axes: int) -> None:
        self._items = items
        self._axes = axes

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)

        method = getattr(type(self._items[0]), name, None)
        if isinstance(method, FunctionType):
            value: Any = MethodType(method, self)
        else:
            values = [getattr(item, name) for item in self._items]
            value = values[0]
            if any(other != value for other in values):
                value = np.array(values).reshape(len(values), *[1] * self._axes)

        self.__dict__[name] = value
        return value


def stacked(items: Sequence[T], axes: int) -> T:
    """Return an object whose numbers, where they differ, are arrays of shape (n, 1, ...).

    Where all items are equal it is the first of them.

    Args:
        items: n objects of one class; what differs between them is numbers.
        axes: How many axes of length 1 follow the first.
    """
    first = items[0]
    if all(item == first for item in items):
        return first
    return cast(T, _Stacked(items, axes))
