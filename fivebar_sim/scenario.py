"""A scenario: which leg follows which path, driven how, simulated how, judged by what."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fivebar_sim import control, resources, tables
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Setpoints
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.geometry import FiveBar, read_table
from fivebar_sim.metrics import LIMIT_KEYS
from fivebar_sim.paths import KINDS, Csv, FootPath
from fivebar_sim.servo import Integrator, Servo
from fivebar_sim.tables import Table

SCENES = ("air",)
MOST_STEPS = 5_000_000
"""Physics steps of one run: what its arrays need, about 500 bytes a step, must fit in memory."""

NAME = re.compile(r"""(?![. ])[^/\\:*?"<>|]+(?<! )""")
LONGEST_NAME = 200
"""A file may have 255 bytes on most systems, and the run directory's stage adds some."""

KEYS = ("name", "leg", "scene", "duration", "path", "servo", "controller", "sim", "limits")


class Sim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How the run is simulated.

    Attributes:
        timestep: h [s].
        integrator: MuJoCo's integrator, "discrete" or "implicitfast".
        seed: Of everything random in a run; the plain servo has nothing random.
    """

    timestep: float = 0.001
    integrator: Integrator = "discrete"
    seed: int = 0

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep, "s", low=0.0, strict=True)
        check_number("seed", self.seed, "", low=0)


class Scenario(msgspec.Struct, frozen=True, kw_only=True):
    """One run, ready to be done.

    Attributes:
        name: What the run directory is called.
        leg: The leg.
        path: The foot's path.
        controller: What plans the servos' setpoints.
        controller_name: Its name in the entry-point group.
        scene: "air".
        duration: [s].
        servo: The servos at A and E.
        sim: Timestep, integrator, seed.
        limits: Metric's dotted key to (low, high).
    """

    name: str
    leg: FiveBar
    path: FootPath
    controller: Setpoints
    controller_name: str
    scene: str = "air"
    duration: float = 4.0
    servo: Servo = Servo()
    sim: Sim = Sim()
    limits: dict[str, tuple[float, float]] = {}

    @property
    def steps(self) -> int:
        """The number of physics steps: duration / timestep, rounded."""
        return round(self.duration / self.sim.timestep)

    @property
    def window(self) -> slice:
        """The rows that tracking and load are measured over: whole periods after the ramp."""
        h, ramp, period = self.sim.timestep, self.path.ramp, self.path.period
        first = round(ramp / h)
        if period is None:
            return slice(first, self.steps)
        periods = math.floor((self.duration - ramp) / period * (1.0 + 1e-9))
        return slice(first, min(round((ramp + periods * period) / h), self.steps))

    @property
    def foot_path(self) -> Array:
        """The foot's targets over the whole run, at every step [m], (N + 1, 2)."""
        return self.path.at(np.arange(self.steps + 1) * self.sim.timestep).position

    @classmethod
    def load(cls, source: str | Path, settings: Iterable[str] = ()) -> Scenario:
        """Return the scenario of a shipped name or a TOML file.

        Args:
            source: "classic-ellipse", or a path.
            settings: Changes "KEY=VALUE" with dotted keys, applied in order.

        Raises:
            ConfigError: The file cannot be read, or says something illegal; names file and key.
        """
        shipped = resources.shipped("scenarios")
        path = shipped.get(str(source), Path(source))
        if path.suffix != ".toml":
            raise ConfigError(f"{unknown('scenario', str(source), shipped)}; or a path to a .toml")
        table = tables.read(path, "scenario")
        for setting in settings:
            _set(table, *tables.parse_setting(setting), str(source))
        return cls.from_table({"name": path.stem, **table}, str(source), path.parent)

    @classmethod
    def from_table(cls, table: Table, where: str, folder: Path) -> Scenario:
        """Return the scenario of a table; `where` names it in messages, files are under `folder`.

        Raises:
            ConfigError: The table says something illegal; names the key.
        """
        tables.check_keys(table, KEYS, where)
        tables.check_finite(table, where)
        name, scene, duration = _scalars(table, where)
        controller_name, controller = _controller(table.get("controller", {}), where)
        scenario = cls(
            name=name,
            leg=_leg(table.get("leg", "classic"), where, folder),
            path=_path(table.get("path"), where, folder),
            controller=controller,
            controller_name=controller_name,
            scene=scene,
            duration=duration,
            servo=tables.convert(table.get("servo", {}), Servo, "servo", where),
            sim=tables.convert(table.get("sim", {}), Sim, "sim", where),
            limits=tables.bounds(table.get("limits", {}), LIMIT_KEYS, "limits", where),
        )
        _check_window(scenario, where)
        return scenario

    def table(self) -> Table:
        """Return the resolved scenario as a TOML table: the leg spelt out, every default written.

        A CSV is named by its copy beside the table; see `copied_name`.
        """
        path: Table = msgspec.to_builtins(self.path)
        if isinstance(self.path, Csv):
            path["file"] = copied_name(self.path)
        return {
            "name": self.name,
            "scene": self.scene,
            "duration": self.duration,
            "leg": _present(asdict(self.leg)),
            "path": _present(path),
            "servo": _present(msgspec.to_builtins(self.servo)),
            "controller": {
                "name": self.controller_name,
                **_present(msgspec.to_builtins(self.controller)),
            },
            "sim": msgspec.to_builtins(self.sim),
            "limits": {
                key: high if low == -math.inf else [low, high]
                for key, (low, high) in self.limits.items()
            },
        }


def copied_name(path: Csv) -> str:
    """Return what a CSV is called beside a resolved scenario: ends with .csv, as no other file."""
    name = Path(path.file).name
    return name if name.endswith(".csv") else f"{name}.csv"


def _present(table: Table) -> Table:
    """Return the keys that have a value: TOML has no null."""
    return {key: value for key, value in table.items() if value is not None}


def _set(table: Table, parts: list[str], value: Any, where: str) -> None:
    """Apply one change to a scenario's table.

    Another path.kind or controller.name keeps only those keys that the new one has too.

    Raises:
        ConfigError: A part of the key is a value, not a table.
    """
    if isinstance(table.get("leg"), str) and parts[0] == "leg" and len(parts) > 1:
        table["leg"] = {"preset": table["leg"]}
    if parts[0] == "limits" and len(parts) > 1:
        if isinstance(table.get("limits"), dict):
            table["limits"] = dict(tables.flat(table["limits"]))
        parts = ["limits", ".".join(parts[1:])]
    tables.put(table, parts, value, where)
    if not isinstance(value, str):
        return
    if parts == ["path", "kind"] and value in KINDS:
        known = tables.keys(KINDS[value])
        table["path"] = {k: v for k, v in table["path"].items() if k in known}
    if parts == ["controller", "name"] and value in control.known():
        known = ["name", *tables.keys(control.find(value))]
        table["controller"] = {k: v for k, v in table["controller"].items() if k in known}


def _scalars(table: Table, where: str) -> tuple[str, str, float]:
    name = table.get("name")
    if not isinstance(name, str) or not _is_file_name(name):
        raise ConfigError(
            f"{where}: name must be a plain file name of 1 to {LONGEST_NAME} bytes, got {name!r}"
        )
    scene = table.get("scene", "air")
    if scene not in SCENES:
        raise ConfigError(f"{where}: {unknown('scene', str(scene), SCENES)}")
    duration = table.get("duration", 4.0)
    try:
        check_number("duration", duration, "s", low=0.0, strict=True)
    except ArgumentError as error:
        raise ConfigError(f"{where}: {error}") from None
    return name, scene, float(duration)


def _is_file_name(name: str) -> bool:
    """Return whether a name may be that of a run directory, on any system."""
    plain = NAME.fullmatch(name) is not None and name.isprintable()
    return plain and len(name.encode()) <= LONGEST_NAME


def _leg(value: Any, where: str, folder: Path) -> FiveBar:
    """Return the leg of "classic", of a file beside the scenario, or of a table with changes."""
    if isinstance(value, str):
        value = {"preset": value}
    if not isinstance(value, dict):
        raise ConfigError(f"{where}: leg must be a preset's name or a table, got {value!r}")
    own = dict(value)
    base = _preset(own.pop("preset"), where, folder) if "preset" in own else {}
    return FiveBar.from_table({**base, **own}, f"{where}: [leg]")


def _preset(preset: Any, where: str, folder: Path) -> Table:
    """Return the table of a leg that ships, or of a file beside the scenario; legal by itself."""
    if not isinstance(preset, str) or "\0" in preset:
        raise ConfigError(f"{where}: leg.preset must be a preset's name, got {preset!r}")
    source = folder / preset if preset.endswith(".toml") else preset
    try:
        table = read_table(source)
        tables.check_finite(table, str(source))
        FiveBar.from_table(table, str(source))
    except ConfigError as error:
        raise ConfigError(f"{where}: leg.preset: {error}") from None
    return table


def _path(value: Any, where: str, folder: Path) -> FootPath:
    if not isinstance(value, dict) or "kind" not in value:
        raise ConfigError(f"{where}: [path] needs a kind; known: {', '.join(sorted(KINDS))}")
    kind = value["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(f"{where}: path.kind: {unknown('path', str(kind), KINDS)}")
    return tables.convert(value, KINDS[kind], "path", where).resolve(folder)


def _controller(value: Any, where: str) -> tuple[str, Setpoints]:
    if not isinstance(value, dict):
        raise ConfigError(f"{where}: controller must be a table, got {value!r}")
    own = dict(value)
    name = own.pop("name", "servo")
    try:
        kind = control.find(str(name))
    except ConfigError as error:
        raise ConfigError(f"{where}: controller.name: {error}") from None
    return str(name), tables.convert(own, kind, "controller", where)


def _check_window(scenario: Scenario, where: str) -> None:
    """Raise unless the run is long enough to be measured, and the path long enough for the run."""
    h, path, duration = scenario.sim.timestep, scenario.path, scenario.duration
    came = f"got {duration:g} s"
    if not 2 <= duration / h <= MOST_STEPS:
        raise ConfigError(
            f"{where}: duration must be 2 to {MOST_STEPS} timesteps of {h:g} s, {came}"
        )
    if not scenario.steps * h <= path.end * (1.0 + 1e-9):
        raise ConfigError(f"{where}: duration must be at most the path's {path.end:g} s, {came}")
    needs, what = path.ramp, f"the ramp of {path.ramp:g} s"
    if path.period is not None:
        needs, what = needs + path.period, f"{what} and one period of {path.period:g} s"
    if not needs <= duration * (1.0 + 1e-9) or scenario.window.stop <= scenario.window.start:
        raise ConfigError(
            f"{where}: duration must be longer than {what}, to have something to measure; {came}"
        )
