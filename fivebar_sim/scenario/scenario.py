"""A scenario: which leg follows which path, driven how, simulated how, judged by what."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, ClassVar, Self

import msgspec
import numpy as np
import tomli_w

from fivebar_sim.arrays import Array
from fivebar_sim.control import Feedback, Setpoints, find, name_of
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.files import resources, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Sim
from fivebar_sim.metrics.catalogue import LIMIT_KEYS
from fivebar_sim.metrics.guards import Guards
from fivebar_sim.paths import FootPath
from fivebar_sim.scenario import forces, reading, together
from fivebar_sim.scenario.forces import FootForce
from fivebar_sim.scenario.leg_words import leg_words
from fivebar_sim.scenario.scenes import Air, Ground, Payload, Scene

KEYS = (
    *("name", "leg", "scene", "duration", "path", "force", "servo", "sensors", "controller"),
    *("sim", "guards", "limits", "converge"),
)


class Scenario(msgspec.Struct, frozen=True, kw_only=True):
    """One run, ready to be simulated: Scenario(leg=leg, path=path) needs no more than these two.

    Attributes:
        name: Name of the run directory.
        leg: The leg.
        path: The foot's path.
        controller: What drives the motors: plans all setpoints, or is asked at every control step.
        controller_name: Its name in the entry-point group; "" for the one that it has there.
        scene: What the leg hangs on and stands on.
        duration: Length of the run [s].
        force: Force of the world on the foot: applied in the scene "payload", and expected by the
            controller in every scene; None for no force.
        servo: The servos at A and E.
        sensors: The sensors at A and E, for feedback controllers.
        sim: Timestep, integrator, seed.
        guards: Bounds beyond which the physics of the run cannot be trusted.
        limits: Metric's dotted key to (low, high).
        converge: Metric's dotted key to the relative error that the timestep may cause, for those
            metrics that `fivebar converge` would refuse.
    """

    name: str = "scenario"
    leg: FiveBar
    path: FootPath
    controller: Setpoints | Feedback = msgspec.field(default_factory=lambda: find("servo")())
    controller_name: str = ""
    scene: Scene = Air()
    duration: float = 4.0
    force: FootForce | None = None
    servo: Servo = Servo()
    sensors: Sensors = Sensors()
    sim: Sim = Sim()
    guards: Guards = Guards()
    limits: dict[str, tuple[float, float]] = {}
    converge: dict[str, float] = {}

    known_limits: ClassVar[tuple[str, ...]] = LIMIT_KEYS

    def __post_init__(self) -> None:
        together.check_parts(self)
        # Also where another leg replaces the one that the path was of.
        msgspec.structs.force_setattr(self, "path", self.path.of_leg(self.leg))
        if not self.controller_name:
            msgspec.structs.force_setattr(self, "controller_name", name_of(self.controller))
        limits = together.legal_limits(self.limits, self.known_limits)
        msgspec.structs.force_setattr(self, "limits", limits)
        self._fit()

    def _fit(self) -> None:
        """Fill in what follows from other parts; raise unless all of them fit together."""
        scene = together.with_belt_speed(self.scene, self.path)
        msgspec.structs.force_setattr(self, "scene", scene)
        together.check_window(self)
        together.check_scene(self)

    def __repr__(self) -> str:
        """Return what differs from the defaults; Python makes the same scenario of it."""
        own: list[str] = []
        for field in msgspec.structs.fields(self):
            value = getattr(self, field.name)
            if field.name == "controller_name":
                usual = name_of(self.controller)
            else:
                make = field.default_factory
                usual = field.default if make is msgspec.NODEFAULT else make()
            if value != usual:
                own.append(f"{field.name}={value!r}")
        return f"{type(self).__name__}({', '.join(own)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the leg over its path, what is run, and the limits."""
        # By name: what draws stands above this room.
        return importlib.import_module("fivebar_sim.report.notebook").scenario(self)

    @property
    def words(self) -> str:
        """What is simulated: "classic leg, L2 = 70 mm"."""
        return leg_words(self.leg, self.servo.armature)

    @property
    def steps(self) -> int:
        """The number of physics steps: duration / timestep, rounded."""
        return round(self.duration / self.sim.timestep)

    @property
    def window(self) -> slice:
        """The rows that tracking and load are measured over.

        Whole periods after the ramp, or from the drop on in a landing; for a path that comes to
        rest, up to that time.
        """
        h = self.sim.timestep
        # The impact may come before the ramp ends, and is what a landing is run for.
        landing = isinstance(self.scene, Ground) and self.scene.lands
        ramp = 0.0 if landing else self.path.ramp
        period = self.path.period
        first = round(ramp / h)
        last = self.steps
        if period is not None:
            # 1e-9: a duration of whole periods must not lose one to rounding.
            periods = math.floor((self.duration - ramp) / period * (1.0 + 1e-9))
            return slice(first, min(round((ramp + periods * period) / h), last))
        return slice(first, min(round(min(self.path.rest, self.duration) / h), last))

    @property
    def for_good(self) -> slice:
        """The rows that stand for a motion that goes on for good: the motors' heat is theirs.

        Those of the window, or the steps at rest after a path that comes to rest within the run.
        """
        first = round(min(self.path.rest, self.duration) / self.sim.timestep)
        return slice(first, self.steps) if first < self.steps else self.window

    @property
    def command(self) -> int:
        """Steps from one motor command to the next, of the slower of controller and bus."""
        own = self.controller.period if isinstance(self.controller, Feedback) else 0.0
        bus = 1.0 / self.servo.rate if self.servo.rate else 0.0
        return max(1, round(max(own, bus) / self.sim.timestep))

    @property
    def times(self) -> Array:
        """The times of all steps [s], (N + 1,)."""
        return np.arange(self.steps + 1, dtype=np.float64) * self.sim.timestep

    @property
    def foot_path(self) -> Array:
        """The foot's targets over the whole run, at every step [m], (N + 1, 2)."""
        return self.path.at(self.times).position

    @property
    def foot_force(self) -> Array | None:
        """The force of the world on the foot at every step [N], (N + 1, 2)."""
        return None if self.force is None else self.force.at(self.times, self.path)

    @property
    def payload(self) -> float:
        """The point mass that the foot carries [kg]."""
        return self.scene.mass if isinstance(self.scene, Payload) else 0.0

    @property
    def trunk(self) -> float:
        """Mass of the trunk on the hip [kg]; 0 where the hip is fixed."""
        return self.scene.mass if isinstance(self.scene, Ground) else 0.0

    @classmethod
    def load(cls, source: str | Path, settings: Iterable[str] = ()) -> Scenario:
        """Return a shipped scenario by name, or the scenario of a TOML file.

        That of a file with the key `robot` is a `robots.scenario.RobotScenario`.

        Args:
            source: "classic-ellipse", or a path.
            settings: Changes "KEY=VALUE" with dotted keys, applied in order.

        Raises:
            ConfigError: The file cannot be read, or a value in it is illegal; names file and key.
        """
        shipped = resources.shipped("scenarios")
        path = shipped.get(str(source), Path(source))
        if path.suffix != ".toml":
            raise ConfigError(f"{unknown('scenario', str(source), shipped)}; or a path to a .toml")
        table = tables.read(path, "scenario")
        for setting in settings:
            reading.change(table, *tables.parse_setting(setting), str(source))
        # A file without a name gives the run its own; a key `name` in it, or a setting, wins.
        return cls.from_table({"name": path.stem, **table}, str(source), path.parent)

    @classmethod
    def from_table(cls, table: Table, where: str, folder: Path) -> Scenario:
        """Return the scenario of a table; `where` names it in messages, files are under `folder`.

        Raises:
            ConfigError: A value in the table is illegal; names the key.
        """
        if cls is Scenario and "robot" in table:
            return reading.of_robots().from_table(table, where, folder)
        tables.check_keys(table, KEYS, where)
        tables.check_finite(table, where)
        name, duration = reading.name_and_duration(table, where)
        controller_name, controller = reading.controller(table.get("controller", {}), where)
        path = reading.path(table.get("path"), where, folder)
        scene = reading.scene(table.get("scene", "air"), where)
        servo = reading.servo(table.get("servo", {}), where, folder)
        parts = {
            "name": name,
            "leg": reading.leg(table.get("leg", "classic"), where, folder, servo.armature),
            "path": path,
            "controller": controller,
            "controller_name": controller_name,
            "scene": scene,
            "duration": duration,
            "force": reading.force(table.get("force"), where, folder),
            "servo": servo,
            "sensors": tables.convert(table.get("sensors", {}), Sensors, "sensors", where),
            "sim": reading.sim(table.get("sim", {}), scene, where),
            "guards": tables.convert(table.get("guards", {}), Guards, "guards", where),
            "limits": tables.bounds(table.get("limits", {}), LIMIT_KEYS, "limits", where),
            "converge": reading.converge(table.get("converge", {}), where),
        }

        return cls._of_parts(parts, where)

    @classmethod
    def _of_parts(cls, parts: dict[str, Any], where: str) -> Self:
        """Return the scenario of legal parts.

        Raises:
            ConfigError: They do not fit together; the message begins with `where`.
        """
        try:
            return cls(**parts)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from None

    def driven_by(self, controller: Setpoints | Feedback) -> Scenario:
        """Return the same scenario with another controller, under that controller's name.

        The name is that of the controller's entry point, or of its class if it has none.

        Raises:
            ConfigError: The object is not a controller, or has a field that TOML cannot hold.
        """
        ours = isinstance(controller, (Setpoints, Feedback))
        if not ours or not isinstance(controller, msgspec.Struct):
            raise ConfigError(
                "controller must be a msgspec Struct with setpoints(), or with command(), drive "
                f"and period, got {controller!r}"
            )

        name = name_of(controller)
        driven = msgspec.structs.replace(self, controller=controller, controller_name=name)
        # Tried now: the run directory is written after the run, too late to find out.
        try:
            tomli_w.dumps(driven.table())
        except TypeError as error:
            raise ConfigError(
                f"controller {name!r} has a field that TOML cannot hold: {error}"
            ) from None

        return driven

    def table(self) -> Table:
        """Return the resolved scenario as a TOML table: the leg spelt out, every default written.

        A CSV is named by its copy beside the table; see `copied_name`.
        """
        path, force = (msgspec.to_builtins(part) for part in (self.path, self.force))
        for part, name in zip((path, force), self.copies, strict=True):
            if name is not None:
                part["file"] = name

        table = {
            "name": self.name,
            "scene": "air" if self.scene == Air() else _present(msgspec.to_builtins(self.scene)),
            "duration": self.duration,
            "leg": _present(asdict(self.leg)),
            "path": _present(path),
            "force": None if force is None else _present(force),
            "servo": _present(msgspec.to_builtins(self.servo)),
            "controller": {
                "name": self.controller_name,
                **_present(msgspec.to_builtins(self.controller)),
            },
            "sensors": msgspec.to_builtins(self.sensors),
            "sim": msgspec.to_builtins(self.sim),
            "guards": msgspec.to_builtins(self.guards),
            "limits": {
                key: high if low == -math.inf else [low, high]
                for key, (low, high) in self.limits.items()
            },
            "converge": dict(self.converge) or None,
        }
        return _present(table)

    @property
    def copies(self) -> tuple[str | None, str | None]:
        """Names that the CSVs of path and force get beside a resolved scenario."""
        path = copied_name(self.path)
        force = copied_name(self.force)
        # Two files of one name in different folders must not become one file here.
        return path, f"force-{force}" if force is not None and force == path else force

    @property
    def files(self) -> dict[str, bytes]:
        """The CSVs that go with a resolved scenario, by name, as they were when they were read."""
        parts = zip((self.path, self.force), self.copies, strict=True)
        return {
            name: part.content for part, name in parts if name and isinstance(part, forces.READ)
        }


def copied_name(part: FootPath | FootForce | None) -> str | None:
    """Return the name of a CSV's copy beside a resolved scenario; None for other paths and forces.

    It ends with .csv, unlike the name of any other file there.
    """
    if not isinstance(part, forces.READ):
        return None
    name = Path(part.file).name
    return name if name.endswith(".csv") else f"{name}.csv"


def _present(table: Table) -> Table:
    """Return the keys that have a value: TOML has no null."""
    return {key: value for key, value in table.items() if value is not None}
