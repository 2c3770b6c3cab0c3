"""A baseline: what a scenario's metrics were when someone said that they are good.

It lies beside the scenario's file, in baselines/NAME.json: JSON with sorted keys and no date, so
that recording it again where nothing changed gives the same bytes.

How far a metric may move is written beside every value, and can be edited there; it is kept when
the value is recorded anew. The defaults stand far above what differs without anybody's doing, and
far below what a change of the leg, the gains or the timing does. Measured on the shipped scenarios:

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
from fivebar_sim.metrics.limits import look_up

RELATIVE = 0.005
"""By what part of its recorded value a metric may move."""

SAID = ("mujoco", "platform", "integrator", "timestep", "seed")
"""What of a run's provenance a baseline records."""


class Made(msgspec.Struct, frozen=True):
    """What the recorded values were made with; see `provenance`."""

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
        """Return what a run was made with otherwise: "mujoco 3.16.0, now 3.17.0"."""
        said = msgspec.to_builtins(self.made)
        return [f"{k} {said[k]}, now {provenance[k]}" for k in SAID if said[k] != provenance[k]]


def place(source: str) -> Path:
    """Return where the baseline of a scenario lies, given its shipped name or its file."""
    file = resources.shipped("scenarios").get(source, Path(source))
    return file.parent / "baselines" / f"{file.stem}.json"


def record(metrics: Mapping[str, Any], old: Baseline | None = None) -> Baseline:
    """Return the baseline of a run's metrics, with the tolerances of the old one.

    Values have six digits: what differs between machines stays out of the file.
    """
    kept = old.metrics if old else {}
    recorded = {}
    for key in sorted(ABSOLUTE):
        if key.split(".")[0] in metrics:
            value = look_up(metrics, key)
            rounded = None if value is None else float(f"{value:.6g}")
            default = Recorded(None, ABSOLUTE[key], RELATIVE)
            recorded[key] = msgspec.structs.replace(kept.get(key, default), value=rounded)
    made = {key: metrics["provenance"][key] for key in SAID}
    return Baseline(Made(**made), recorded)


def read(path: Path) -> Baseline | None:
    """Return the baseline of a file, or None if there is no such file.

    Raises:
        ConfigError: It cannot be read, or is damaged or of something else; names file and key.
    """
    try:
        input_file.check(path, input_file.TEXT)
        table = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"cannot read baseline {path}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} is no baseline: not JSON: {error}") from None

    where = f"{path} is no baseline"
    if tables.is_deep(table):
        raise ConfigError(f"{where}: nested too deep")
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: it must be a table, got {str(table)[:40]}")

    tables.check_keys(table, ("made", "metrics"), where)
    tables.check_finite(table, where)
    made = tables.convert(table.get("made"), Made, "made", where)
    metrics = table.get("metrics")
    if not isinstance(metrics, dict):
        raise ConfigError(f"{where}: metrics must be a table, got {metrics!r}")

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
