"""A robot's run as a TOML file: the robot, what its feet do, what it walks on, its limits."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from fivebar_sim import units
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.files import presets, quantities, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.metrics.catalogue import (
    GROUND_KEYS,
    JUMP_KEYS,
    PUSH_KEYS,
    ROBOT_KEYS,
    ROBOTS,
)
from fivebar_sim.metrics.guards import Guards
from fivebar_sim.robots.floor import KINDS, Air, Floor, Payload
from fivebar_sim.robots.floor import Scene as Stage
from fivebar_sim.robots.gait import PHASES, Gait
from fivebar_sim.robots.ground import KINDS as GROUNDS
from fivebar_sim.robots.ground import Ground
from fivebar_sim.robots.push import Push
from fivebar_sim.robots.robot import LEGS, Robot
from fivebar_sim.scenario import Scenario, reading
from fivebar_sim.scenario.together import check_window

KEYS = (
    *("name", "robot", "scene", "duration", "path", "gait", "controller"),
    *("sensors", "sim", "guards", "limits", "converge", "push"),
)

TRUNK_KEYS = tuple(metric.key for metric in ROBOTS)
"""The metrics of a trunk that moves."""


class RobotScenario(Scenario, frozen=True, kw_only=True):
    """One run of a robot, ready to be simulated.

    It has all that a leg's scenario has, of each of its legs: `leg`, `servo` and `path` are those
    of every leg.

    Attributes:
        robot: The robot.
        phases: By what part of a period each leg is ahead of the path.
        strides: What the path's x is multiplied by for each leg; None: 1 for every leg.
        sideways: What it is multiplied by for each foot's way to the left; None: 0 for every leg.
        steering: Where each leg is steered, to the left [rad]; None: 0 for every leg.
        scene: What the robot stands on.
        pushes: Forces on its trunk.
    """

    robot: Robot
    phases: dict[str, float]
    strides: dict[str, float] | None = None
    sideways: dict[str, float] | None = None
    steering: dict[str, float] | None = None
    scene: Stage = Floor()
    pushes: tuple[Push, ...] = ()
    known_limits: ClassVar[tuple[str, ...]] = ROBOT_KEYS

    def _fit(self) -> None:
        """Raise unless all parts fit together."""
        _check_together(self)

    @property
    def words(self) -> str:
        """What is simulated: "robot q8bot of 220 g"."""
        return f"robot {self.robot.name} of {units.text(1e3 * self.robot.mass, 'g')}"

    @property
    def gait(self) -> Gait:
        """What the feet do."""
        return Gait(
            path=self.path,
            phases=self.phases,
            strides=self.strides,
            sideways=self.sideways,
            steering=self.steering,
        )

    @classmethod
    def from_table(cls, table: Table, where: str, folder: Path) -> RobotScenario:
        """Return the scenario of a table; `where` names it in messages, files are under `folder`.

        Raises:
            ConfigError: A value in the table is illegal; names the key.
        """
        tables.check_keys(table, KEYS, where)
        tables.check_finite(table, where)
        name, duration = reading.name_and_duration(table, where)
        controller_name, controller = reading.controller(table.get("controller", {}), where)
        robot = read_robot(table["robot"], where, folder)
        path = reading.path(table.get("path"), where, folder)
        scene = _scene(table.get("scene", "floor"), where)

        parts = {
            "name": name,
            "robot": robot,
            "leg": robot.leg,
            "servo": robot.servo,
            "path": path,
            **_gait(table.get("gait", {}), where),
            "controller": controller,
            "controller_name": controller_name,
            "scene": scene,
            "pushes": _pushes(table.get("push", []), where),
            "duration": duration,
            "sensors": tables.convert(table.get("sensors", {}), Sensors, "sensors", where),
            "sim": reading.sim(table.get("sim", {}), scene, where),
            "guards": tables.convert(table.get("guards", {}), Guards, "guards", where),
            "limits": tables.bounds(table.get("limits", {}), ROBOT_KEYS, "limits", where),
            "converge": reading.converge(table.get("converge", {}), where, ROBOT_KEYS),
        }
        return cls._of_parts(parts, where)

    def table(self) -> Table:
        """Return the resolved scenario as a TOML table: the robot spelt out, every default written.

        A CSV is named by its copy beside the table.
        """
        table = super().table()
        # They are the robot's.
        for key in ("leg", "servo"):
            table.pop(key)
        changed = msgspec.structs.replace(self.robot, servo=self.servo)
        gait = {"phases": self.phases, "strides": self.strides or dict.fromkeys(LEGS, 1.0)}
        moved = {"sideways": self.sideways, "steering": self.steering}
        gait |= {key: legs for key, legs in moved.items() if legs and any(legs.values())}
        own = {"name": table.pop("name"), "robot": changed.table(), "gait": gait, **table}
        if self.pushes:
            own["push"] = [msgspec.to_builtins(push) for push in self.pushes]
        return own


def read_robot(value: Any, where: str, folder: Path) -> Robot:
    """Return the robot of a preset, of a file beside the scenario, or of a table with changes.

    Args:
        value: A preset's name or a table, as the scenario has it.
        where: The scenario, for messages.
        folder: Where the scenario's files are.

    Raises:
        ConfigError: A value is illegal; names the key.
    """
    own = copy.deepcopy(value) if isinstance(value, dict) else {"preset": value}
    preset = own.pop("preset", None)
    if preset is None:
        return Robot.from_table(own, f"{where}: [robot]", folder)
    if not isinstance(preset, str) or "\0" in preset:
        raise ConfigError(f"{where}: robot must be the name of a preset or a table, got {value!r}")

    file = presets.find(folder / preset if preset.endswith(".toml") else preset, "robot")
    try:
        base = Robot.load(file)
    except ConfigError as error:
        raise ConfigError(f"{where}: robot.preset: {error}") from None
    if not own:
        return base

    table = base.table()
    # A leg has the rotors of its servos, unless it says otherwise itself.
    if base.leg.armature == base.servo.armature:
        del table["leg"]["armature"]
    _merge(table, own)
    return Robot.from_table(table, f"{where}: [robot]", folder)


def _merge(table: Table, own: Table) -> None:
    """Put changes into a table; one with a preset of its own replaces what is there."""
    for key, value in own.items():
        old = table.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and "preset" not in value:
            _merge(old, value)
        else:
            table[key] = value


def _gait(table: Any, where: str) -> dict[str, dict[str, float] | None]:
    """Return phases, strides, ways to the side and steering of the table [gait]."""
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: gait must be a table, got {table!r}")
    tables.check_keys(table, ("phases", "strides", "sideways", "steering"), f"{where}: [gait]")
    phases = table.get("phases", "together")
    if isinstance(phases, str):
        if phases not in PHASES:
            raise ConfigError(f"{where}: gait.phases: {unknown('gait', phases, PHASES)}")
        phases = PHASES[phases]

    given = {"strides": dict.fromkeys(LEGS, 1.0), **table, "phases": phases}
    for key, value in given.items():
        if not isinstance(value, dict):
            raise ConfigError(f"{where}: gait.{key} must be a table of the legs, got {value!r}")
    found: dict[str, dict[str, float] | None] = {key: dict(legs) for key, legs in given.items()}
    if "steering" in given:
        found["steering"] = {
            leg: quantities.quantity(angle, "rad", f"{where}: gait.steering.{leg}")
            for leg, angle in given["steering"].items()
        }
    return found


def _scene(value: Any, where: str) -> Stage:
    """Return the scene of a kind's name, such as "floor", or of a table."""
    own = {"kind": value} if isinstance(value, str) else value
    if not isinstance(own, dict) or "kind" not in own:
        raise ConfigError(f"{where}: scene must be one of {', '.join(KINDS)}, got {value!r}")
    kind = own["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(f"{where}: {unknown('scene of a robot', str(kind), KINDS)}")
    if KINDS[kind] is not Floor:
        return tables.convert(own, KINDS[kind], "scene", where)

    rest = dict(own)
    ground = _ground(rest.pop("ground", "flat"), where)
    payload = tables.convert(rest.pop("payload", {}), Payload, "scene.payload", where)
    floor = tables.convert(rest, Floor, "scene", where)
    return msgspec.structs.replace(floor, ground=ground, payload=payload)


def _pushes(value: Any, where: str) -> tuple[Push, ...]:
    """Return the pushes of the tables [[push]]."""
    if not isinstance(value, list):
        raise ConfigError(f"{where}: push must be tables [[push]], got {value!r}")
    return tuple(tables.convert(each, Push, f"push[{k}]", where) for k, each in enumerate(value))


def _ground(value: Any, where: str) -> Ground:
    """Return what lies on a floor, of a kind's name, such as "rough", or of a table."""
    own = {"kind": value} if isinstance(value, str) else value
    if not isinstance(own, dict) or "kind" not in own:
        raise ConfigError(
            f"{where}: scene.ground must be one of {', '.join(GROUNDS)}, or a table with a kind, "
            f"got {value!r}"
        )
    kind = own["kind"]
    if not isinstance(kind, str) or kind not in GROUNDS:
        raise ConfigError(f"{where}: scene.ground: {unknown('ground', str(kind), GROUNDS)}")
    return tables.convert(own, GROUNDS[kind], "scene.ground", where)


def _check_pushes(scenario: RobotScenario, *, held: bool) -> None:
    """Raise unless every push acts on a trunk that is free, within the run."""
    if scenario.pushes and held:
        raise ConfigError("push needs a floor: in the scene 'air' the trunk is held")
    # Half a step more is rounding.
    end = scenario.duration + 0.5 * scenario.sim.timestep
    for k, push in enumerate(scenario.pushes):
        if not push.end <= end:
            raise ConfigError(
                f"push[{k}] must end within the run of {scenario.duration:g} s, got time + "
                f"duration = {push.end:g} s"
            )
    for key in scenario.limits:
        if key in PUSH_KEYS and not scenario.pushes:
            raise ConfigError(f"limits.{key} needs a [[push]]: nothing pushes the robot")


def _check_friction(scenario: RobotScenario) -> None:
    """Raise where what passes through gears is not known: off level floors, beside S and T."""
    if not scenario.servo.records_friction:
        return

    where = ""
    if scenario.robot.hip_motors:
        where = f"with hips.{scenario.robot.hip_motors[0].key}"
    elif isinstance(scenario.scene, Floor) and not scenario.scene.ground.level:
        where = "on uneven ground"

    if where:
        raise ConfigError(
            f"servo.friction of a robot {where} must be a number [N m]: how friction changes with "
            "speed and load is known of legs without motors S and T, in the air or on a flat floor"
        )


def _check_together(scenario: RobotScenario) -> None:
    """Raise unless the tables of a scenario, each legal by itself, fit together."""
    try:
        scenario.gait.check_motors(scenario.robot)
    except ArgumentError as error:
        raise ConfigError(f"gait.{error}") from None

    check_window(scenario)
    _check_friction(scenario)
    held = isinstance(scenario.scene, Air)
    _check_pushes(scenario, held=held)
    for key in scenario.limits:
        if held and key in (*TRUNK_KEYS, *GROUND_KEYS):
            raise ConfigError(f"limits.{key} needs a floor: scene must be 'floor'")
        if key in JUMP_KEYS and scenario.path.period is not None:
            raise ConfigError(
                f"limits.{key} needs a path that does not repeat, as kind 'heights': a "
                "gait is no jump"
            )
    reading.check_servo_limits(scenario.limits, scenario.servo)
