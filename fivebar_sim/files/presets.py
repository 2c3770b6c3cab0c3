"""Presets: TOML tables that ship by name, such as legs and servos, or files of the user's."""

from __future__ import annotations

from pathlib import Path

from fivebar_sim.errors import UnknownError, unknown
from fivebar_sim.files import resources, tables


def find(source: str | Path, what: str) -> Path:
    """Return the file of a preset's name, or the path itself if it names a TOML file.

    Args:
        source: The preset's name or a path.
        what: The kind of preset, in the singular: those of "leg" ship in models/legs.

    Raises:
        ConfigError: Neither a known preset nor a path to a .toml file.
    """
    known = resources.shipped(f"models/{what}s")
    path = known.get(str(source), Path(source))
    if path.suffix != ".toml":
        raise UnknownError(f"{unknown(f'{what} preset', str(source), known)}; or a path to a .toml")
    return path


def read(source: str | Path, what: str) -> tables.Table:
    """Return the TOML table of a preset; the arguments are those of `find`.

    Raises:
        ConfigError: Unknown preset, no such file, not TOML.
    """
    return tables.read(find(source, what), what)
