"""The firmware gives the same bits on every processor, in WebAssembly and in NumPy.

What is compiled for a processor is compiled once: the leg's object calls no library either.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from firmware_bits import bits_of, digests
from firmware_builds import TARGETS, need, run

FEW = 2_000
"""Legs and points in every run of the tests."""

FEWER = 400
"""Where floats are software's under QEMU."""

MANY = 10_000_000
"""Legs and points of the long form."""

MORE = 40_000
"""Legs and points of a block in the long form: temporaries stay small."""


@cache
def expected(count: int, block: int, kind: Any = np.float32) -> list[str]:
    return digests(0, count, block, kind)


class Built(NamedTuple):
    """What was compiled for a target."""

    folder: Path
    command: list[str]


Builds = Callable[[str], Built]
"""A target's name -> what was compiled for it, once."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Builds:
    @cache
    def build(target: str) -> Built:
        need(*TARGETS[target].needs)
        folder = tmp_path_factory.mktemp(target)
        return Built(folder, TARGETS[target].build(folder, ()))

    return build


def compare(command: list[str], count: int, block: int) -> None:
    printed = run(*command, "0", str(count), str(block)).split()
    assert printed == expected(count, block)


@pytest.mark.parametrize("target", TARGETS)
def test_the_bits_are_those_of_numpy(target: str, built: Builds) -> None:
    count = FEWER if target == "cortex-m0" else FEW
    compare(built(target).command, count, count // 4)


# Not on the Cortex-M0: its software floats would take an hour under QEMU.
@pytest.mark.long
@pytest.mark.parametrize("target", sorted(set(TARGETS) - {"cortex-m0"}))
def test_the_bits_of_ten_million_legs_are_those_of_numpy(target: str, built: Builds) -> None:
    compare(built(target).command, MANY, MORE)


# WebAssembly is linked without any library; a Cortex-M0 has all float arithmetic in one.
@pytest.mark.parametrize("target", sorted(set(TARGETS) - {"wasm", "cortex-m0"}))
def test_the_leg_calls_no_library(target: str, built: Builds) -> None:
    missing = re.findall(r" U (\w+)", run(_nm(target), built(target).folder / "leg.o"))
    # What linkers provide themselves.
    assert set(missing) <= {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}


@pytest.mark.parametrize(
    ("flags", "kind"),
    [
        (("-O1", "-DFIVEBAR_SQRT_BY_DIGITS"), np.float32),
        (("-O1", "-DFIVEBAR_DOUBLE"), np.float64),
        (("-O0", "-DFIVEBAR_DOUBLE", "-DFIVEBAR_SQRT_BY_DIGITS"), np.float64),
        # -O0 with floats: test_firmware_source's sanitizers
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


def _nm(target: str) -> str:
    """Return the program that lists a target's symbols."""
    prefix = TARGETS[target].needs[0].removesuffix("gcc")
    return "nm" if target in ("host", "clang") else f"{prefix}nm"
