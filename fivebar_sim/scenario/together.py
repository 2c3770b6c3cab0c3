"""Whether the parts of a scenario, each legal by itself, fit together."""

from __future__ import annotations

from typing import Any, Protocol

import msgspec

from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.files import tables
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Sim
from fivebar_sim.metrics.catalogue import GROUND_KEYS
from fivebar_sim.metrics.guards import Guards
from fivebar_sim.paths import FootPath, Gait
from fivebar_sim.scenario import reading
from fivebar_sim.scenario.forces import FootForce
from fivebar_sim.scenario.scenes import Air, Ground, Payload, Treadmill

MOST_STEPS = 5_000_000
"""Physics steps of one run: what its arrays need, about 600 bytes a step, must fit in memory."""

TYPES: dict[str, type[Any]] = {
    "leg": FiveBar,
    "path": FootPath,
    "servo": Servo,
    "sensors": Sensors,
    "sim": Sim,
    "guards": Guards,
}
"""What the parts of every scenario are."""


class Parts(Protocol):
    """What has to fit together: a `Scenario`."""

    @property
    def name(self) -> str:
        """Name of the run directory."""
        ...

    @property
    def path(self) -> FootPath:
        """The foot's path."""
        ...

    @property
    def scene(self) -> Any:
        """What the leg hangs on and stands on."""
        ...

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        ...

    @property
    def steps(self) -> int:
        """The number of physics steps."""
        ...

    @property
    def window(self) -> slice:
        """The rows that are measured."""
        ...

    @property
    def force(self) -> FootForce | None:
        """Force of the world on the foot."""
        ...

    @property
    def servo(self) -> Servo:
        """The servos."""
        ...

    @property
    def sim(self) -> Sim:
        """Timestep and integrator."""
        ...

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Metric's key to (low, high)."""
        ...


def check_parts(scenario: Parts) -> None:
    """Raise unless each part of a scenario that Python made is legal by itself.

    Raises:
        ConfigError: A name that no directory can have, or a part of another type.
    """
    where = "Scenario"
    parts = {"name": scenario.name, "duration": scenario.duration}
    reading.name_and_duration(parts, where)
    for key, kind in TYPES.items():
        if not isinstance(value := getattr(scenario, key), kind):
            raise ConfigError(f"{where}: {key} must be a {kind.__name__}, got {value!r}")


def legal_limits(
    limits: Any, known: tuple[str, ...], name: str = "limits"
) -> dict[str, tuple[float, float]]:
    """Return limits as (low, high) by key; one number is an upper bound, as in a file.

    Raises:
        ConfigError: An unknown key, or a bound that is neither a number nor (low, high).
    """
    if isinstance(limits, dict):
        limits = {k: [*v] if isinstance(v, tuple) else v for k, v in limits.items()}
    return tables.bounds(limits, known, name, "Scenario")


def check_window(scenario: Parts) -> None:
    """Raise unless the run is long enough to measure, and path and force last as long as it."""
    h = scenario.sim.timestep
    path = scenario.path
    duration = scenario.duration
    came = f"got {duration:g} s"
    if not 2 <= duration / h <= MOST_STEPS:
        raise ConfigError(f"duration must be 2 to {MOST_STEPS} timesteps of {h:g} s, {came}")
    # 1e-9: the product of steps and timestep is rounded.
    if not scenario.steps * h <= path.end * (1.0 + 1e-9):
        raise ConfigError(f"duration must be at most the path's {path.end:g} s, {came}")

    if (force := scenario.force) and not scenario.steps * h <= force.end * (1.0 + 1e-9):
        raise ConfigError(f"duration must be at most the force's {force.end:g} s, {came}")

    # Asked only for their checks: no bus is faster than the timestep, or rounded to another one.
    try:
        scenario.servo.check_rate(h)
        scenario.servo.check_whole(h)
    except ArgumentError as error:
        raise ConfigError(f"servo.{error}") from None

    needs = path.ramp
    what = f"the ramp of {path.ramp:g} s"
    if path.period is not None:
        needs = needs + path.period
        what = f"{what} and one period of {path.period:g} s"

    if not needs <= duration * (1.0 + 1e-9) or scenario.window.stop <= scenario.window.start:
        raise ConfigError(
            f"duration must be longer than {what}, to have something to measure; {came}"
        )


def with_belt_speed(scene: Any, path: FootPath) -> Any:
    """Return the scene; a belt without a speed gets the path's stance speed.

    Raises:
        ConfigError: The path has no stance.
    """
    if not isinstance(scene, Treadmill) or scene.speed is not None:
        return scene
    if not isinstance(path, Gait):
        raise ConfigError(
            "scene.speed is missing: only a gait path says by itself how fast the belt must run"
        )
    try:
        # May be refused: a legal gait can be faster than a belt may run.
        return msgspec.structs.replace(scene, speed=path.stance_speed)
    except ArgumentError as error:
        raise ConfigError(f"scene.{error} from the path's stance") from None


def check_scene(scenario: Parts) -> None:
    """Raise unless the scene has what path, force and limits need."""
    scene = scenario.scene
    grounded = isinstance(scenario.scene, Ground)
    if scenario.path.needs_ground and not grounded:
        raise ConfigError(
            f"path.kind {scenario.path.__struct_config__.tag!r} needs a ground: "
            f"scene must be rail or treadmill, got {scene.kind!r}"
        )
    if isinstance(scene, Air) and scenario.force is not None:
        raise ConfigError("[force] has no effect in scene 'air': choose another scene")
    # A payload of nothing is the scene 'air' under another name.
    if isinstance(scene, Payload) and scene.mass == 0.0 and scenario.force is None:
        raise ConfigError("scene.mass must be in (0, inf) kg where there is no [force], got 0.0")

    for key in scenario.limits:
        if key in GROUND_KEYS and not grounded:
            raise ConfigError(
                f"limits.{key} needs a ground: scene must be rail or treadmill, got {scene.kind!r}"
            )

    reading.check_servo_limits(scenario.limits, scenario.servo)
