"""What was identified as TOML: a scenario to run, and presets of its leg and its servo."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.identify.findings import remarks
from fivebar_sim.identify.fit import Fit
from fivebar_sim.identify.parameters import OFFSETS, put
from fivebar_sim.scenario import Scenario


def write(path: Path, scenario: Scenario, fit: Fit, logs: Sequence[str]) -> list[Path]:
    """Write the scenario as identified, and a preset of each of its tables that has changed.

    Args:
        path: "mine.toml"; the presets are mine-leg.toml and mine-servo.toml.
        scenario: The scenario that the numbers started from.
        fit: What was identified.
        logs: The names of the logs.

    Returns:
        The files.

    Raises:
        ConfigError: A file cannot be written.
    """
    check(path)
    found = put(scenario, fit.parameters, fit.values).scenario
    table = found.table()
    table["name"] = path.stem
    # Limits and guards are for the old numbers.
    table.pop("limits", None)
    head = "".join(f"# {line}\n" for line in _head(scenario, fit, logs))
    files = {path: table}
    for name in ("leg", "servo"):
        if any(each.key.startswith(f"{name}.") for each in fit.parameters):
            files[path.with_name(f"{path.stem}-{name}.toml")] = dict(table[name])

    for place, content in files.items():
        _write(place, head + tomli_w.dumps(content))
    for name, content in found.files.items():
        path.with_name(name).write_bytes(content)
    return list(files)


def check(path: Path) -> None:
    """Raise unless a scenario can be written there.

    Raises:
        ConfigError: Not a TOML file, or no place for one.
    """
    if path.suffix != ".toml":
        raise ConfigError(f"--out must end in .toml, got {path}")
    whole_file.check_place(path)


def _head(scenario: Scenario, fit: Fit, logs: Sequence[str]) -> list[str]:
    """Return the lines that say where the numbers come from."""
    lines = [f"Identified by fivebar from {', '.join(logs)}, starting from {scenario.name}."]
    words = remarks(fit)
    rows: list[Any] = list(zip(fit.parameters, fit.values, fit.half_widths, words, strict=True))
    for each, value, half, word in rows:
        note = f"  ({word})" if word else ""
        unit = f" {each.unit}" if each.unit else ""
        lines.append(f"{each.key} = {value:.6g} +- {half:.2g}{unit}, 95 %{note}")
    if any(each.key in OFFSETS for each in fit.parameters):
        lines.append("An offset is what has to be added to the log's angles and commands.")
    return lines


def _write(path: Path, text: str) -> None:
    with whole_file.stage(path) as place:
        place.write_text(text, encoding="utf-8")
