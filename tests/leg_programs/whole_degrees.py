"""The published rounding: whole degrees, truncated where the argument says so."""

from __future__ import annotations

import math
import sys

import right
from speak import Leg, Numbers, speak


def inverse(leg: Leg, numbers: Numbers) -> Numbers | None:
    """Return the angles in whole degrees."""
    found = right.inverse(leg, numbers)
    whole = math.trunc if sys.argv[1:] == ["truncated"] else round
    return None if found is None else [float(whole(math.degrees(theta))) for theta in found]


if __name__ == "__main__":
    speak("degrees", {"inverse": inverse})
