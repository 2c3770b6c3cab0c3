"""Reading the foot motions and the regions of a design task."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fivebar_sim.design.task.motions import REGIONS, FootMotion, Region, check_load
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.files import tables
from fivebar_sim.scenario import reading


def motion(name: str, table: Any, where: str, folder: Path) -> FootMotion:
    """Return a foot motion of a table [motion.NAME]."""
    at = f"{where}: motion.{name}"
    if not isinstance(table, Mapping):
        raise ConfigError(f"{at} must be a table, got {table!r}")
    tables.check_keys(table, ("path", "force", "payload", "weight"), at)

    path = reading.path(table.get("path"), at, folder)
    force = reading.force(table.get("force"), at, folder)
    found = FootMotion(name, path, force, table.get("payload", 0.0), table.get("weight", 1.0))
    try:
        check_load(found)
    except ArgumentError as error:
        raise ConfigError(f"{at}: {error}") from None
    return found


def region(name: str, table: Any, where: str) -> Region:
    """Return the region of a table [region.NAME]."""
    at = f"{where}: [region.{name}]"
    if not isinstance(table, Mapping) or table.get("kind") not in REGIONS:
        kind = table.get("kind") if isinstance(table, Mapping) else table
        raise ConfigError(f"{at}: {unknown('kind', str(kind), REGIONS)}")
    return tables.convert(dict(table), REGIONS[table["kind"]], f"region.{name}", where)
