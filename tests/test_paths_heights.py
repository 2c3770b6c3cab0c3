"""The heights of a jump: which one at which time, and what cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import Heights

JUMP = Heights(x=0.01, heights=(0.08, 0.25, 0.13), seconds=(0.5, 0.8))


@pytest.mark.parametrize("h", [1e-3, 2.5e-4, 1.0 / 3000.0])
def test_each_height_begins_with_the_step_at_its_time(h: float) -> None:
    """Rounding of k h moves no step: three parts of exactly as many steps as they last."""
    steps = round(2.0 / h)
    path = JUMP.at(np.arange(steps) * h)
    heights, counts = np.unique(-path.position[:, 1], return_counts=True)
    assert dict(zip(heights, counts, strict=True)) == {
        0.08: round(0.5 / h),
        0.25: round(0.8 / h),
        0.13: steps - round(1.3 / h),
    }
    assert np.all(path.position[:, 0] == 0.01)
    assert not path.velocity.any()
    assert not path.acceleration.any()


def test_target_of_a_jump_comes_to_rest_and_does_not_repeat() -> None:
    assert JUMP.rest == pytest.approx(1.3)
    assert JUMP.period is None
    assert JUMP.at([[0.0, 0.6], [1.4, 9e5]]).position.shape == (2, 2, 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seconds": (0.5,)}, "seconds one fewer: .* got 3 heights and 1 seconds"),
        ({"heights": (0.1,), "seconds": ()}, "heights must be two or more"),
        ({"heights": (0.1, np.nan, 0.1)}, r"heights must be in .* m, got nan"),
        ({"seconds": (0.5, 0.0)}, r"seconds must be in \(0, 1e\+06\) s, got 0"),
    ],
)
def test_heights_that_cannot_be_are_refused(change: dict[str, Any], message: str) -> None:
    table: dict[str, Any] = {"heights": (0.08, 0.25, 0.13), "seconds": (0.5, 0.8), **change}
    with pytest.raises(ArgumentError, match=message):
        Heights(**table)
