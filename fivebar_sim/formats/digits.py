"""MuJoCo's XML with every digit: by itself MuJoCo writes six, which moves a foot by micrometres."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from fivebar_sim.errors import ConfigError

MOST = 17
"""Digits with which every float64 reads back as itself."""

USUAL = 6
"""Digits that MuJoCo writes by itself."""

NUMBER = re.compile(r"(?<![\w.+-])[+-]?\d+\.\d+(?:e[+-]?\d+)?(?![\w.])|(?<![\w.+-])-0(?![\w.])")
"""A number with decimals within a value, or a zero with a sign."""


@contextmanager
def every_digit() -> Iterator[None]:
    """Within, MuJoCo writes numbers that read back as themselves."""
    set_digits = _setter()
    set_digits(MOST)
    try:
        yield
    finally:
        set_digits(USUAL)


def _setter() -> ctypes._NamedFuncPointer:
    """Return the function of MuJoCo's library that sets how many digits it writes.

    Python's bindings leave it out. Whoever writes a file reads it back and compares.

    Raises:
        ConfigError: A library without it.
    """
    folder = Path(mujoco.__file__).parent
    library = next(folder.glob("libmujoco*"), folder / "mujoco.dll")
    try:
        return ctypes.CDLL(str(library))["_mjPRIVATE__set_xml_precision"]
    except (AttributeError, OSError):
        raise ConfigError(
            f"this version of MuJoCo, {mujoco.__version__}, cannot write numbers with every digit"
        ) from None


def shortest(value: str) -> str:
    """Return an attribute's value with each number in the fewest digits that read back as it.

    Args:
        value: Numbers with 17 digits between words: "0.040000000000000001 0 -0".
    """
    return NUMBER.sub(lambda found: repr(float(found[0])).removesuffix(".0"), value)
