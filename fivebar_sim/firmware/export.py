"""Writes a leg as a C library: header, source, an example, and what Arduino and PlatformIO ask."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from importlib.metadata import version
from pathlib import Path

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources
from fivebar_sim.files.exchange import exchange
from fivebar_sim.files.whole_file import check_parent
from fivebar_sim.firmware import example, source
from fivebar_sim.geometry import FiveBar

HEADER = "fivebar_leg.h"
SOURCE = "fivebar_leg.c"
SKETCH = "examples/play_gait/play_gait.ino"
GAIT = "examples/play_gait/gait.h"

SUMMARY = "Kinematics of a closed five-bar leg, the same bits as in its simulation"


def write(leg: FiveBar, folder: str | Path) -> Path:
    """Write a leg as a C library into a folder of its own; an earlier export there is replaced.

    Args:
        leg: The leg.
        folder: The folder; folders above it are made.

    Returns:
        The folder.

    Raises:
        GeometryError: The firmware cannot hold the leg.
        ConfigError: The folder has files that are not an export's, or cannot be written.
    """
    place = Path(folder)
    files = texts(leg)
    check_free(place, set(files))
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".fivebar-", dir=place.absolute().parent))
        try:
            # mkdtemp makes folders that only their owner can read.
            stage.chmod(0o755)
            for name, text in files.items():
                (stage / name).parent.mkdir(parents=True, exist_ok=True)
                (stage / name).write_text(text, encoding="utf-8")
            _put(stage, place)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    except OSError as error:
        raise ConfigError(f"cannot write {place}: {error.strerror or error}") from None
    return place


def texts(leg: FiveBar) -> dict[str, str]:
    """Return the files of an export, by their path within it.

    Raises:
        GeometryError: The firmware cannot hold the leg.
    """
    return {
        HEADER: _shipped(HEADER),
        SOURCE: source.with_leg(_shipped(SOURCE), leg),
        SKETCH: _shipped(SKETCH),
        GAIT: example.header(leg),
        "library.json": _platformio(),
        "library.properties": _arduino(),
    }


def check_free(place: Path, ours: set[str]) -> None:
    """Raise unless a folder is missing, empty, or nothing but an earlier export.

    Raises:
        ConfigError: It has anything else in it.
    """
    if not place.exists() and not place.is_symlink():
        check_parent(place, ConfigError)
        return
    if place.is_symlink() or not place.is_dir():
        raise ConfigError(f"cannot write {place}: something that is not a directory is there")
    # An earlier export is replaced by renaming, which the folder of this very process cannot be.
    if place.resolve() == Path.cwd():
        raise ConfigError(f"cannot write {place}: it is the current folder; give one within it")
    there = {path.relative_to(place).as_posix() for path in place.rglob("*") if not _is_dir(path)}
    foreign = sorted(there - ours)
    if foreign:
        raise ConfigError(
            f"cannot write {place}: it has {foreign[0]}, which is not an export's; give a folder "
            "that is new, empty or of an earlier export"
        )
    # A file of one of our names that somebody else wrote.
    if there and source.HEADING not in _text(place / SOURCE):
        raise ConfigError(
            f"cannot write {place}: its {sorted(there)[0]} is not of an export; give a folder "
            "that is new, empty or of an earlier export"
        )


def _is_dir(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _text(path: Path) -> str:
    return path.read_text("utf-8", errors="replace") if path.is_file() else ""


def _put(stage: Path, place: Path) -> None:
    """Put a finished folder in its place; what was there ends up in the stage's."""
    if not place.exists():
        stage.rename(place)
        return
    if exchange(stage, place):
        return
    # Systems that cannot exchange two folders have a moment without either.
    aside = Path(f"{stage}-old")
    place.rename(aside)
    os.rename(stage, place)
    shutil.rmtree(aside, ignore_errors=True)


def _shipped(name: str) -> str:
    return resources.file("firmware", name).read_text("utf-8")


def _platformio() -> str:
    """Return library.json."""
    library = {
        "name": "fivebar_leg",
        "version": version("fivebar-sim"),
        "description": SUMMARY,
        "keywords": "robotics, kinematics, quadruped, five-bar",
        "license": "Apache-2.0",
        "frameworks": "*",
        "platforms": "*",
        "headers": HEADER,
        "examples": [{"name": "play_gait", "base": "examples/play_gait", "files": ["*.*"]}],
    }

    return json.dumps(library, indent=2) + "\n"


def _arduino() -> str:
    """Return library.properties."""
    lines = {
        "name": "fivebar_leg",
        "version": version("fivebar-sim"),
        "author": "fivebar-sim",
        "maintainer": "fivebar-sim",
        "sentence": f"{SUMMARY}.",
        "paragraph": "Inverse and forward kinematics, Jacobian, torques, workspace, servos.",
        "category": "Device Control",
        "url": "",
        "architectures": "*",
        "includes": HEADER,
    }

    return "".join(f"{key}={value}\n" for key, value in lines.items())
