"""What the tables of metrics.json are made of: numbers with their ranges, and pairs of motors.

The same types are written and read, so that no run writes what no reader takes.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

LARGEST = 1e100
"""No metric is larger: what is done with one cannot overflow."""

Number = Annotated[float, msgspec.Meta(ge=-LARGEST, le=LARGEST)] | None
"""None where it is undefined."""
Amount = Annotated[float, msgspec.Meta(ge=0, le=LARGEST)] | None
Part = Annotated[float, msgspec.Meta(ge=0, le=1)] | None
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Sign = Annotated[int, msgspec.Meta(ge=-1, le=1)]


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table whose keys are all known."""


class Motors(Table, frozen=True):
    """An amount for each motor."""

    A: Amount
    E: Amount


class Parts(Table, frozen=True):
    """A part of the steps for each motor."""

    A: Part
    E: Part
