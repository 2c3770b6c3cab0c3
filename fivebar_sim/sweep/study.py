"""A sweep that has been checked: a scenario's table, and what is changed in it."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

from fivebar_sim.errors import ConfigError, FiveBarError, UnknownError, unknown
from fivebar_sim.files import resources, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.scenario import Scenario, reading
from fivebar_sim.sweep.points import Points

PACKAGES = ("fivebar-sim", "mujoco", "numpy")
"""What the numbers depend on besides the scenario."""


class Study(msgspec.Struct, frozen=True, kw_only=True):
    """A sweep.

    Attributes:
        source: Names the scenario in messages.
        folder: Where its files are.
        table: The scenario as its file has it, with settings.
        points: What is changed in it.
    """

    source: str
    folder: Path
    table: Table
    points: Points

    def scenario(self, values: Sequence[Any]) -> Scenario:
        """Return the scenario with the values of a point.

        Raises:
            ConfigError: A value that the scenario refuses.
        """
        table = copy.deepcopy(self.table)
        for axis, value in zip(self.points.axes, values, strict=True):
            for key in axis.keys:
                # A list in the table must be no other point's.
                own = copy.deepcopy(value)
                reading.change(table, tables.parse_setting(f"{key}=0")[0], own, self.source)
        return Scenario.from_table(table, self.source, self.folder)

    def trials(self) -> Iterator[tuple[str, list[Any]]]:
        """Yield the values of points that hold whatever else than numbers is varied.

        Each axis in turn takes its values, and the others their first; of numbers the first and
        the last are enough. With them comes what is tried, as it would be given.
        """
        first = [axis.values[0] if axis.values else axis.low for axis in self.points.axes]
        for k, axis in enumerate(self.points.axes):
            values = axis.values or (axis.low, axis.high)
            if all(isinstance(value, (int, float)) for value in values):
                values = (values[0], values[-1])
            for value in values:
                yield f"--vary {axis.name}={value}", [*first[:k], value, *first[k + 1 :]]


def study(source: str | Path, points: Points, settings: Sequence[str] = ()) -> Study:
    """Return a checked sweep of a scenario.

    Args:
        source: A shipped scenario's name, or a path.
        points: What is varied.
        settings: Changes of every point, as in `Scenario.load`.

    Raises:
        ConfigError: The scenario cannot be read, a key or a name among the values is unknown, or
            no value is legal.
    """
    shipped = resources.shipped("scenarios")
    path = shipped.get(str(source), Path(source))
    if path.suffix != ".toml":
        raise UnknownError(f"{unknown('scenario', str(source), shipped)}; or a path to a .toml")
    table = {"name": path.stem, **tables.read(path, "scenario")}
    for setting in settings:
        reading.change(table, *tables.parse_setting(setting), str(source))
    found = Study(source=str(source), folder=path.parent, table=table, points=points)
    _check(found)
    return found


def of(scenario: Scenario, points: Points) -> Study:
    """Return a checked sweep of a scenario that is no file; errors are those of `study`."""
    if scenario.files:
        raise ConfigError("a scenario with CSV files is swept by its path: sweep('FILE.toml', ...)")
    found = Study(source=scenario.name, folder=Path(), table=scenario.table(), points=points)
    _check(found)
    return found


def _check(tried: Study) -> None:
    """Raise unless keys and names are known, and some value is legal.

    Raises:
        ConfigError: What is wrong, with a guess.
    """
    refused: list[str] = []
    legal = 0
    for what, values in tried.trials():
        try:
            tried.scenario(values)
            legal += 1
        # Wrong in every point: nobody wants a table of it.
        except UnknownError as error:
            raise UnknownError(f"{what}: {error}") from None
        except FiveBarError as error:
            refused.append(f"{what}: {error}")
    if not legal:
        raise ConfigError(refused[0])


def fingerprint(swept: Study) -> dict[str, Any]:
    """Return what the results of a sweep depend on, and nothing else.

    Two sweeps with the same have the same results, to the last bit on one kind of processor.
    """
    digest = hashlib.blake2b(digest_size=16)
    for _, values in swept.trials():
        try:
            scenario = swept.scenario(values)
        except FiveBarError as error:
            digest.update(str(error).encode())
            continue
        # Presets and CSVs may be files of the user's: what they say counts, not their names.
        digest.update(json.dumps(scenario.table(), sort_keys=True).encode())
        for content in scenario.files.values():
            digest.update(content)

    points = swept.points
    return {
        "vary": {axis.name: list(axis.values) or [axis.low, axis.high] for axis in points.axes},
        "sample": points.sample,
        "seed": points.seed if points.sample is not None else 0,
        "scenario": digest.hexdigest(),
        **{name: version(name) for name in PACKAGES},
    }
