"""Baselines: the metrics of a scenario at a time when someone accepted them as good.

A baseline lies beside the scenario's file, in baselines/NAME.json: JSON with sorted keys and no
date, so that recording it again without a change gives the same bytes.

The tolerance of each metric is written beside its value and can be edited there; recording a new
value keeps it. The defaults are far above what platforms and versions change, and far below the
effect of another leg, gain or timing. Measured on the shipped scenarios:

    again, alone, batched, on 1 or 2 threads                      the same bits
    MuJoCo 3.16, stepped by mj_step; NumPy 2.0, or without AVX    the same bits
    a C library without fused multiplication                      1e-8, relative
    MuJoCo 4.0                                                    4e-8 at most, relative
    every command and the start off by 1e-14, relative,
        as on a processor that rounds otherwise                   a thousandth of a tolerance

`scripts/determinism.py` measures it. 0.5 % is 100,000 times what a version changes, which leaves
room for a later solver of MuJoCo's, and a twentieth of the 10 % that must never pass. The absolute
part is for values that are next to nothing: 1 nm, a thousandth of a mN m, three steps of 1500.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import input_file, resources, tables, whole_file
from fivebar_sim.metrics.catalogue import ABSOLUTE
from fivebar_sim.metrics.limits import has, look_up

RELATIVE = 0.005
"""By what part of its recorded value a metric may move."""

MADE_WITH = ("mujoco", "platform", "integrator", "timestep", "seed")
"""The keys of a run's provenance that a baseline records."""


class Made(msgspec.Struct, frozen=True):
    """Versions and settings that the recorded values were made with; see `provenance`."""

    mujoco: str
    platform: str
    integrator: str
    timestep: float
    seed: int


class Recorded(msgspec.Struct, frozen=True):
    """A recorded metric.

    Attributes:
        value: In SI units; None where it was undefined.
        absolute: Tolerance, in the metric's unit.
        relative: Tolerance, as a part of |value|.
    """

    value: float | None
    absolute: float
    relative: float

    def __post_init__(self) -> None:
        check_number("absolute", self.absolute, "", low=0.0)
        check_number("relative", self.relative, "", low=0.0)

    @property
    def tolerance(self) -> float:
        """How far the metric may move: absolute + relative |value|."""
        return self.absolute + self.relative * abs(self.value or 0.0)


class Baseline(msgspec.Struct, frozen=True):
    """The recorded metrics of a scenario, by dotted key, and what they were made with."""

    made: Made
    metrics: dict[str, Recorded]

    def differences(self, provenance: Mapping[str, Any]) -> list[str]:
        """Return how a run was made differently: "mujoco 3.16.0, now 3.17.0"."""
        then = msgspec.to_builtins(self.made)
        return [
            f"{key} {then[key]}, now {provenance[key]}"
            for key in MADE_WITH
            if then[key] != provenance[key]
        ]


def place(source: str) -> Path:
    """Return the path of a scenario's baseline, given its shipped name or its file."""
    file = resources.shipped("scenarios").get(source, Path(source))
    return file.parent / "baselines" / f"{file.stem}.json"


def record(metrics: Mapping[str, Any], old: Baseline | None = None) -> Baseline:
    """Return a new baseline of a run's metrics; tolerances of the old one are kept."""
    kept = old.metrics if old else {}
    recorded = {}
    for key in sorted(ABSOLUTE):
        if has(metrics, key):
            value = look_up(metrics, key)
            # Six digits: differences between machines are beyond them.
            rounded = None if value is None else float(f"{value:.6g}")
            default = Recorded(None, ABSOLUTE[key], RELATIVE)
            recorded[key] = msgspec.structs.replace(kept.get(key, default), value=rounded)
    made = {key: metrics["provenance"][key] for key in MADE_WITH}
    return Baseline(Made(**made), recorded)


def read(path: Path) -> Baseline | None:
    """Return the baseline of a file, or None if there is no such file.

    Raises:
        ConfigError: It cannot be read, is damaged, or is not a baseline; names file and key.
    """
    try:
        table = input_file.read_json(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"cannot read baseline {path}: {error.strerror}") from None
    except ValueError as error:
        raise ConfigError(f"{path} is not a baseline: not JSON: {error}") from None

    where = f"{path} is not a baseline"
    if tables.is_deep(table):
        raise ConfigError(f"{where}: nested too deep")
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: it must be a table, got {str(table)[:40]}")

    # Before the conversion, so that messages name the key that the user wrote.
    tables.check_keys(table, ("made", "metrics"), where)
    tables.check_finite(table, where)
    made = tables.convert(table.get("made"), Made, "made", where)
    metrics = table.get("metrics")
    if not isinstance(metrics, dict):
        raise ConfigError(f"{where}: metrics must be a table, got {metrics!r}")
    # It would judge nothing, and look like a baseline that is met.
    if not metrics:
        raise ConfigError(f"{where}: metrics must have at least one metric, got none")

    tables.check_keys(metrics, ABSOLUTE, f"{where}: metrics")
    each = {
        key: tables.convert(value, Recorded, f"metrics.{key}", where)
        for key, value in metrics.items()
    }
    return Baseline(made, each)


def write(path: Path, baseline: Baseline) -> None:
    """Write a baseline, whole or not at all.

    Raises:
        ConfigError: The place cannot be written.
    """
    text = json.dumps(msgspec.to_builtins(baseline), indent=2, sort_keys=True, allow_nan=False)
    whole_file.write(path, text + "\n")
