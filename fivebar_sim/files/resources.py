"""Paths of the shipped files: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


@cache
def folder(name: str) -> Path:
    """Return the shipped folder called name ("models", "scenarios", ...).

    Raises:
        FileNotFoundError: If the installation lacks it.
    """
    # Inside the package once installed, beside it in a checkout.
    for base in (PACKAGE, PACKAGE.parent):
        if (base / name).is_dir():
            return base / name
    raise FileNotFoundError(f"fivebar-sim is installed without its folder {name!r}")


@cache
def file(folder: str, name: str) -> Path:
    """Return a shipped file, where the package itself may have a folder of that name.

    Raises:
        FileNotFoundError: If the installation lacks it.
    """
    for base in (PACKAGE, PACKAGE.parent):
        if (base / folder / name).is_file():
            return base / folder / name
    raise FileNotFoundError(f"fivebar-sim is installed without its file {folder}/{name}")


def shipped(name: str, suffix: str = ".toml") -> dict[str, Path]:
    """Return the files of a shipped folder and of the folders in it by stem, sorted by name."""
    # Robots' scenarios have a folder of their own.
    files = [*folder(name).glob(f"*{suffix}"), *folder(name).glob(f"*/*{suffix}")]
    return {path.stem: path for path in sorted(files, key=lambda path: path.name)}
