"""Model files, each read once, and MuJoCo kept quiet about them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import mujoco


@contextmanager
def without_log() -> Iterator[None]:
    """Keep MuJoCo from printing warnings, and from logging them in the working directory.

    Those of a simulation are counted in its data.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo's warnings about models from being logged, and from Python.

    Compiling a scene says that a leg whose names have no prefix cannot be saved as part of another
    file.
    """
    with without_log(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def read(file: Path) -> mujoco.MjSpec:
    """Return a model file's specification, to be changed: a copy of what was read once."""
    with quiet():
        return _read(file).copy()


@cache
def _read(file: Path) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(file))
