"""The firmware gives the same bits on every processor, in WebAssembly and in NumPy."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from firmware_bits import bits_of, digests
from firmware_builds import TARGETS, need, run

FEW = 2_000
"""Legs and points in every run of the tests."""

MANY = 10_000_000
"""Legs and points of the long form."""

MORE = 40_000
"""Legs and points of a block in the long form: temporaries stay small."""


@cache
def expected(count: int, block: int, kind: Any = np.float32) -> list[str]:
    return digests(0, count, block, kind)


def compare(target: str, folder: Path, count: int, block: int) -> None:
    need(*TARGETS[target].needs)
    command = TARGETS[target].build(folder, ())
    printed = run(*command, "0", str(count), str(block)).split()
    assert printed == expected(count, block)


@pytest.mark.parametrize("target", TARGETS)
def test_the_bits_are_those_of_numpy(target: str, tmp_path: Path) -> None:
    compare(target, tmp_path, FEW, FEW // 4)


# Not on the Cortex-M0: its software floats would take an hour under QEMU.
@pytest.mark.long
@pytest.mark.parametrize("target", sorted(set(TARGETS) - {"cortex-m0"}))
def test_the_bits_of_ten_million_legs_are_those_of_numpy(target: str, tmp_path: Path) -> None:
    compare(target, tmp_path, MANY, MORE)


@pytest.mark.parametrize(
    ("flags", "kind"),
    [
        (("-DFIVEBAR_SQRT_BY_DIGITS",), np.float32),
        (("-DFIVEBAR_DOUBLE",), np.float64),
        (("-DFIVEBAR_DOUBLE", "-DFIVEBAR_SQRT_BY_DIGITS"), np.float64),
        (("-O0",), np.float32),
        (("-O3", "-march=native"), np.float32),
    ],
)
def test_no_switch_changes_the_bits(flags: tuple[str, ...], kind: Any, tmp_path: Path) -> None:
    need("cc")
    command = TARGETS["host"].build(tmp_path, flags)
    printed = run(*command, "0", str(FEW), str(FEW // 4)).split()
    assert printed == expected(FEW, FEW // 4, kind)


def test_the_digest_sees_other_arithmetic() -> None:
    """A digest that forgot what it mixes could not fail."""
    index = np.arange(1000, dtype=np.uint32)
    with np.errstate(all="ignore"):
        differ = bits_of(index, np.float32) != bits_of(index, np.float64)
    # All but the legs that are refused, of which only the status is mixed.
    assert 0.5 < np.mean(differ) < 1.0
