"""The base of all tasks: leg and servos, actions, observations, rewards, the episode's length."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

import msgspec
import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Observation
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.control.step import check_whole_steps
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.paths import FootPath
from fivebar_sim.scenario.scenes import Ground, Scene
from fivebar_sim.tasks import options
from fivebar_sim.tasks.motion import Motion

Action = Literal["position", "motion", "torque"]
ACTIONS: tuple[str, ...] = get_args(Action)

FASTEST = 40.0
"""Bound of rate setpoints if the servo has no no-load speed [rad/s]."""

LONGEST = 1000.0
"""Upper end of a duration [s]."""

WIDEST = float(np.pi)
"""Upper end of the span of setpoints [rad]."""


class Part(NamedTuple):
    """A named part of an observation or an action.

    Attributes:
        size: Count of its numbers.
        unit: Their unit, "" for pure numbers.
    """

    size: int
    unit: str


class Task(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"):
    """The base of every kind of task.

    An episode starts at rest near the start of the foot path; the targets of a control step are
    those of the path at its time.

    Attributes:
        leg: The leg.
        servo: The servos at A and E.
        sensors: Sensors of the motors' angles and rates; the rest of the observation is exact.
        path: The foot's path, at whose start the foot starts; None for the kind's default path.
        action: "position" setpoints (A, E) [rad]; "motion": with rates after them [rad/s], as
            theta + (damping / kp) theta_dot, which takes the servo's lag out; "torque" [N m].
        span: How far position setpoints may be from the rest pose [rad].
        spread: How far the foot may start from the path's start [m].
        period: Control period [s], a whole number of timesteps.
        duration: Length of an episode [s], a whole number of periods.
        timestep: h of the physics [s].
        integrator: MuJoCo's integrator, "discrete" or "implicitfast".
        weights: Weights of reward terms that differ from `WEIGHTS`.
    """

    WEIGHTS: ClassVar[dict[str, float]] = {}
    """The reward terms with their weights."""
    TARGETS: ClassVar[dict[str, Part]] = {}
    """The observation's parts that are known before the episode."""
    GROUNDED: ClassVar[bool] = False
    """Whether the leg stands on a ground."""

    leg: FiveBar = FiveBar(name="classic")
    servo: Servo = Servo()
    sensors: Sensors = Sensors()
    path: FootPath | None = None
    action: Action = "position"
    span: float = 1.0
    spread: float = 0.002
    period: float = 0.005
    duration: float = 4.0
    timestep: float = 0.001
    integrator: Integrator = "discrete"
    # msgspec copies an empty default: objects do not share it.
    weights: dict[str, float] = {}

    def __post_init__(self) -> None:
        for name in options.KINDS:
            options.check_kind(name, getattr(self, name))
        _check_word("action", self.action, ACTIONS)
        _check_word("integrator", self.integrator, get_args(Integrator))
        if self.action == "torque" and self.servo.limit is None:
            raise ArgumentError("action 'torque' needs a servo with a limit: its bounds [N m]")

        check_number("span", self.span, "rad", low=0.0, high=WIDEST, strict=True)
        check_number("spread", self.spread, "m", low=0.0, high=self.leg.size)
        check_number("timestep", self.timestep, "s", low=0.0, strict=True)
        check_whole_steps("period", self.period, self.timestep)
        # As in a scenario: no bus is faster than the timestep, or rounded to another one.
        try:
            self.servo.check_rate(self.timestep)
            self.servo.check_whole(self.timestep)
        except ArgumentError as error:
            raise ArgumentError(f"servo.{error}") from None

        check_number("duration", self.duration, "s", low=0.0, high=LONGEST, strict=True)
        periods = round(self.duration / self.period)
        # To a part in a million, as in `whole_steps`: decimals are rounded as floats.
        if periods < 1 or abs(periods * self.period - self.duration) > 1e-6 * self.duration:
            raise ArgumentError(
                f"duration must be a whole number of periods of {self.period:g} s, "
                f"got {self.duration!r} s"
            )

        self._check_weights()

    def _check_weights(self) -> None:
        """Raise unless the weights are numbers by the names of reward terms."""
        if not isinstance(self.weights, Mapping):
            known = ", ".join(self.WEIGHTS)
            raise ArgumentError(f"weights must be a table of {known}, got {self.weights!r}")
        for name, weight in self.weights.items():
            if name not in self.WEIGHTS:
                raise ArgumentError(unknown("reward term", str(name), self.WEIGHTS))
            check_number(f"weights.{name}", weight, "")

    @property
    def kind(self) -> str:
        """Name of the kind."""
        return str(self.__struct_config__.tag)

    @property
    def every(self) -> int:
        """Timesteps in a control period."""
        return round(self.period / self.timestep)

    @property
    def periods(self) -> int:
        """Control periods in an episode."""
        return round(self.duration / self.period)

    @property
    def times(self) -> Array:
        """The times of an episode's control steps, including its end [s], (periods + 1,)."""
        return np.arange(self.periods + 1, dtype=np.float64) * self.period

    @property
    def drive(self) -> Drive:
        """Whether the motors are sent angles or torques."""
        return "torque" if self.action == "torque" else "position"

    @property
    def home(self) -> Array:
        """The foot in the leg's rest pose [m], hip frame, (2,)."""
        return kinematics.chain_points(self.leg, self._rest).F

    @property
    def _rest(self) -> Array:
        """The leg's rest pose, standing where there is a ground, (4,)."""
        return kinematics.hanging(self.leg) if self.GROUNDED else kinematics.home(self.leg)

    @property
    def scene(self) -> Scene:
        """What the leg hangs on and stands on."""
        raise NotImplementedError

    @property
    def foot_path(self) -> FootPath:
        """The path, or the kind's default path if none was given."""
        raise NotImplementedError

    def resolved(self) -> Self:
        """Return the task with its default path spelt out, so that another leg keeps it."""
        return msgspec.structs.replace(self, path=self.foot_path)

    @property
    def actions(self) -> dict[str, Part]:
        """The parts of an action, in order."""
        if self.action == "torque":
            return {"torque": Part(2, "N m")}
        parts = {"theta": Part(2, "rad")}
        return parts if self.action == "position" else {**parts, "theta_dot": Part(2, "rad/s")}

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The least and the greatest legal action, (2,), with rates (4,)."""
        if self.action == "torque":
            assert self.servo.limit is not None
            return np.full(2, -self.servo.limit), np.full(2, self.servo.limit)
        rest = self._rest[::2]
        low = rest - self.span
        high = rest + self.span
        if self.action == "position":
            return low, high
        fastest = np.full(2, self.servo.speed or FASTEST)
        return np.concatenate([low, -fastest]), np.concatenate([high, fastest])

    @property
    def parts(self) -> dict[str, Part]:
        """The parts of an observation, in order."""
        parts = {
            "theta": Part(2, "rad"),
            "theta_dot": Part(2, "rad/s"),
            "foot": Part(2, "m"),
            "foot_dot": Part(2, "m/s"),
        }
        if self.GROUNDED:
            parts |= {
                "hip_z": Part(1, "m"),
                "hip_dot_z": Part(1, "m/s"),
                "contact": Part(1, ""),
            }

        return {**parts, **self.TARGETS}

    def targets(self) -> dict[str, Array]:
        """Return the parts TARGETS at each control step, (periods + 1, size)."""
        raise NotImplementedError

    def observation(self, seen: Observation, now: Motion, targets: Array) -> Array:
        """Return the observations of n legs, all parts joined, (n, size).

        Args:
            seen: Readings of the legs' sensors.
            now: State of the legs.
            targets: The parts TARGETS, joined, (n, size of them).
        """
        ground = [now.hip, now.contact[:, None]] if self.GROUNDED else []
        return np.concatenate(
            [seen.theta, seen.theta_dot, now.foot, now.foot_dot, *ground, targets], axis=1
        )

    def terms(self, now: Motion, targets: Array) -> dict[str, Array]:
        """Return the reward terms WEIGHTS of a control period, (n,) each; see `observation`."""
        raise NotImplementedError

    def weight(self, name: str) -> float:
        """Return the weight of a reward term."""
        return self.weights.get(name, self.WEIGHTS[name])


class Grounded(Task, frozen=True):
    """A task on the ground; the hip rides on a rail.

    Attributes:
        mass: Mass of the trunk on the hip [kg].
        friction: Coulomb's coefficient between foot and floor.
        drop: Height of the foot above the floor at the start [m].
    """

    GROUNDED: ClassVar[bool] = True

    mass: float = 0.5
    friction: float = 1.0
    drop: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        # Made for its checks alone: a task allows what its scene allows.
        Ground(mass=self.mass, friction=self.friction, drop=self.drop)


def _check_word(name: str, value: Any, known: tuple[str, ...]) -> None:
    """Raise unless a value is one of some words."""
    if not isinstance(value, str) or value not in known:
        raise ArgumentError(unknown(name, str(value), known))


def effort(now: Motion) -> Array:
    """Return mean |tau|^2 of both motors over the control period [N^2 m^2], (n,)."""
    return np.einsum("nkj,nkj->n", now.torque, now.torque) / now.torque.shape[1]


def closeness(error: Array, scale: float) -> Array:
    """Return exp(-|error|^2 / scale^2) of vectors (n, k): 1 for no error, (n,)."""
    return np.exp(-np.einsum("nk,nk->n", error, error) / scale**2)


def clock_hand(cycle: Array) -> Array:
    """Return (cos, sin) of a clock's cycle, counted in turns, (..., 2)."""
    # Two numbers, since one angle would jump by a turn once a period.
    angle = 2.0 * np.pi * cycle
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def phase(path: FootPath, time: Array) -> Array:
    """Return (cos, sin) of a path's phase within its period, (..., 2).

    Raises:
        ConfigError: A path without a period.
    """
    if path.period is None:
        kind = path.__struct_config__.tag
        raise ConfigError(f"the path must be a periodic one, for its phase; got kind {kind!r}")
    return clock_hand(path.cycle(time))
