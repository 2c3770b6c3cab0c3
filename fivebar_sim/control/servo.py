"""The servo at A and E: its laws, which commands reach it, and the torque that it really applies.

q, v        angle and rate of the motor's joint; u the command: an angle or a torque
limit       [N m], speed [rad/s]: the DC motor's line, torque `limit` at rest and zero at `speed`
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import check_number, check_step
from fivebar_sim.control import delay, winding
from fivebar_sim.control.friction import Friction, as_friction
from fivebar_sim.dynamics.heat import Winding
from fivebar_sim.errors import ArgumentError
from fivebar_sim.files import presets, tables
from fivebar_sim.integrator import Integrator

Drive = Literal["position", "torque"]
"""What a command is: an angle for the servo [rad], or a torque for the bare motor [N m]."""

FARTHEST = float(np.pi)
"""Farthest that a setpoint means from the servo's angle [rad]: half a turn, beyond which another
way round is shorter."""


class Servo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The servo at each motor: ideal without `speed`, with it a DC motor.

        position:  tau = clip(kp (u - q) - kd v, limit) - (limit / speed) v
        torque:    tau = clip(u, limit) - (limit / speed) v                   0 without speed

    Both hold with the torque that a step ends with: see `applied_torque`. In MuJoCo limit is the
    actuator's forcerange, and the term outside the clip is the damping of the motor's joint.

    Attributes:
        kp: Position gain [N m/rad].
        kd: Derivative gain [N m s/rad].
        limit: Largest torque [N m], at stall; None for no limit.
        speed: No-load speed [rad/s], where the motor has no torque left; None for no such line.
        friction: Coulomb friction of the gear [N m], or a table, see `Friction`; not part of the
            motor's torque.
        rate: Commands per second on the bus [Hz]; None for one every timestep.
        delay: Time from sending a command to its effect [s].
        resolution: Step of the angles that can be commanded [rad], counted from 0; 0 for exact.
        armature: Rotor inertia at the output, its own by the ratio squared [kg m^2]. The leg of
            a scenario has it, unless it says otherwise; None where it is not known.
        kt: Torque per current at the output, gear included [N m/A]; None where it is not known, and
            then no run measures heat.
        resistance: Of the winding [ohm]; goes with kt.
        thermal_resistance: From the winding to the air [K/W]; None where it is not known, and then
            no run measures temperature. It needs kt.
        thermal_time: Time constant of the winding's temperature [s]; goes with it.
        temperature_max: What the winding bears for good [deg C]; goes with it.
        ambient: Temperature of the air [deg C].
    """

    kp: float = 8.0
    kd: float = 0.05
    limit: float | None = None
    speed: float | None = None
    friction: float | Friction = 0.0
    rate: float | None = None
    delay: float = 0.0
    resolution: float = 0.0
    armature: float | None = None
    kt: float | None = None
    resistance: float | None = None
    thermal_resistance: float | None = None
    thermal_time: float | None = None
    temperature_max: float | None = None
    ambient: float = 25.0

    def __post_init__(self) -> None:
        check_number("kp", self.kp, "N m/rad", low=0.0, strict=True)
        check_number("kd", self.kd, "N m s/rad", low=0.0)
        if self.limit is not None:
            check_number("limit", self.limit, "N m", low=0.0, strict=True)

        if self.speed is not None:
            check_number("speed", self.speed, "rad/s", low=0.0, strict=True)
            if self.limit is None:
                raise ArgumentError("speed needs limit beside it: the stalled motor's torque [N m]")
            # Both may be legal and their quotient still overflow.
            check_number("limit / speed", self.back_emf, "N m s/rad")

        if not isinstance(self.friction, Friction):
            check_number("friction", self.friction, "N m", low=0.0)
        if self.rate is not None:
            check_number("rate", self.rate, "Hz", low=0.0, strict=True)

        check_number("delay", self.delay, "s", low=0.0)
        check_step("resolution", self.resolution)
        if self.armature is not None:
            check_number("armature", self.armature, "kg m^2", low=0.0, high=1e6)

        winding.check(self)

    @classmethod
    def load(cls, source: str | Path) -> Servo:
        """Return the servo of a preset ("xl330") or of a TOML file.

        Raises:
            ConfigError: Unknown preset, unreadable file, unknown key, or a number out of range.
        """
        return servo_of(read_table(source), str(source))

    @property
    def back_emf(self) -> float:
        """Torque lost per rate of the motor, limit / speed [N m s/rad]."""
        return _back_emf(self)

    @property
    def winding(self) -> Winding | None:
        """The motor's winding; None where the table does not describe it."""
        return winding.winding(self)

    @property
    def gear(self) -> Friction:
        """The gear's friction, whichever way the table says it."""
        return as_friction(self.friction)

    @property
    def records_friction(self) -> bool:
        """Whether a run's record says what the gears take: of any friction but a number."""
        return isinstance(self.friction, Friction)

    @property
    def dry(self) -> float:
        """Coulomb friction of the gear that turns without load [N m]."""
        return self.gear.base

    @property
    def damping(self) -> float:
        """Rate gain of the position servo, which a velocity feedforward cancels [N m s/rad]."""
        return self.kd + self.back_emf + self.gear.viscous

    def passive(self, drive: Drive) -> float:
        """Return the motor's rate gain that the limit does not clip [N m s/rad].

        With the gear's viscous friction it is the joint's damping.
        """
        return self.kd if _is_kd_passive(self, drive) else self.back_emf

    def check_rate(self, timestep: float) -> None:
        """Raise if commands come faster than timesteps: no command acts for part of a step.

        Args:
            timestep: h [s].

        Raises:
            ArgumentError: Unless 0 < h, and rate <= 1 / h.
        """
        check_number("timestep", timestep, "s", low=0.0, strict=True)
        if self.rate is not None and not self.rate * timestep <= 1.0 + 1e-9:  # rounding of 1 / h
            raise ArgumentError(
                f"rate must be in (0, {1.0 / timestep:g}] Hz, at most one command a timestep "
                f"of {timestep:g} s, got {self.rate!r}"
            )

    def check_whole(self, timestep: float) -> None:
        """Raise unless a command comes every whole number of timesteps.

        Args:
            timestep: h [s].

        Raises:
            ArgumentError: Another rate would be rounded to one of these.
        """
        if self.rate is None:
            return
        # Beyond a million steps a command, rounding is less than a part in a million.
        steps = min(1.0 / max(self.rate * timestep, 1e-6), 1e6)
        whole = round(steps)
        if abs(steps - whole) > 1e-5 * steps:
            near = " or ".join(f"{1.0 / (n * timestep):.7g}" for n in (int(steps), int(steps) + 1))
            raise ArgumentError(
                f"rate must be 1 / (a whole number of timesteps of {timestep:g} s), here {near} "
                f"Hz, got {self.rate!r}"
            )

    def late(self, steps: int, timestep: float) -> tuple[int, float]:
        """Return the whole timesteps in the delay, at most `steps`, and the part of one beyond."""
        return delay.in_steps(self.delay, timestep, steps)

    def latched(self, steps: int, timestep: float, more: int = 0) -> NDArray[np.int64]:
        """Return which row of a table of commands acts in each step, (N,); -1 before the first.

        With n steps a command, rounded to the nearest and n >= 1, and d steps of delay,

            row(k) = n floor((k - d) / n)   for k >= d, else -1

        so that row(k) <= k: a table may grow while it is used. Where the delay is no whole number
        of timesteps, this is the row that acts at a step's end.

        Args:
            steps: N.
            timestep: h [s].
            more: Steps of delay on top; with 1 the row that acts at a step's start.

        Raises:
            ArgumentError: Unless 0 < h, and rate <= 1 / h: no command acts for part of a step.
        """
        self.check_rate(timestep)
        hold = 1
        if self.rate is not None:
            part = self.rate * timestep  # of a command in one step
            hold = max(1, round(1.0 / part) if part * steps > 1.0 else steps)

        since = np.arange(steps) - self.late(steps, timestep)[0] - more
        return np.where(since < 0, -1, since // hold * hold)

    def rounded(self, theta: Array) -> Array:
        """Return the nearest angles that can be commanded [rad], same shape as theta."""
        step = self.resolution
        return step * np.round(theta / step) if step > 0.0 else theta


@dataclass(frozen=True, slots=True)
class ServoArrays:
    """Struct-of-arrays view of n servos that differ in their gains; attributes as in `Servo`.

    Attributes:
        kp: Position gains [N m/rad], (n, 1, 1).
        kd: Derivative gains [N m s/rad], (n, 1, 1).
        viscous: Viscous friction of the gears [N m s/rad], (n, 1, 1).
        limit, speed, resolution: The same for all servos.
    """

    kp: Array
    kd: Array
    viscous: Array
    limit: float | None
    speed: float | None
    resolution: float

    @classmethod
    def of(cls, servos: Sequence[Servo]) -> ServoArrays:
        """Return the arrays of some servos.

        Raises:
            ArgumentError: Servos that differ in limit, speed or resolution.
        """
        check_alike(servos)
        first = servos[0]
        kp = np.array([[[servo.kp]] for servo in servos])
        kd = np.array([[[servo.kd]] for servo in servos])
        viscous = np.array([[[servo.gear.viscous]] for servo in servos])
        return cls(kp, kd, viscous, first.limit, first.speed, first.resolution)

    @property
    def back_emf(self) -> float:
        """As in `Servo` [N m s/rad]."""
        return _back_emf(self)

    @property
    def damping(self) -> Array:
        """As in `Servo` [N m s/rad], (n, 1, 1)."""
        return self.kd + self.back_emf + self.viscous


def check_alike(servos: Sequence[Servo]) -> None:
    """Raise if servos of one group differ in more than gains and bus.

    Raises:
        ArgumentError: They differ in limit, speed or resolution.
    """
    first = servos[0]
    for name in ("limit", "speed", "resolution"):
        if any(getattr(servo, name) != getattr(first, name) for servo in servos):
            raise ArgumentError(f"servos of one group must have the same {name}")


def servo_of(table: tables.Table, where: str) -> Servo:
    """Return the servo of a table, whose friction may be a table too.

    Args:
        table: The keys of a servo.
        where: The file, for messages.

    Raises:
        ConfigError: Unknown key, or a number out of range.
    """
    gear = table.get("friction")
    if not isinstance(gear, dict):
        return tables.convert(table, Servo, "servo", where)
    # By itself, so that its errors name its own keys.
    found = tables.convert(gear, Friction, "servo.friction", where)
    rest = {key: value for key, value in table.items() if key != "friction"}
    return msgspec.structs.replace(tables.convert(rest, Servo, "servo", where), friction=found)


def read_table(source: str | Path) -> tables.Table:
    """Return the TOML table of a servo, from a preset's name or a file's path.

    Raises:
        ConfigError: Unknown preset, no such file, not TOML, or a number that is not finite.
    """
    table = presets.read(source, "servo")
    tables.check_finite(table, str(source))
    return table


class MotorStep(NamedTuple):
    """A step as the motors see it; all arrays have one shape.

    Attributes:
        integrator: MuJoCo's integrator.
        ctrl: Commands u of the step [rad or N m].
        q: Motor angles before the step [rad].
        q_next: Motor angles after it [rad].
        v_next: Motor rates after it [rad/s].
        drive: Whether commands are angles or torques.
    """

    integrator: Integrator
    ctrl: Array
    q: Array
    q_next: Array
    v_next: Array
    drive: Drive = "position"


def saturated(servo: Servo | ServoArrays, step: MotorStep) -> Bools:
    """Return whether the limit clips the torque that a step ends with, in the step's shape."""
    if servo.limit is None:
        return np.zeros(np.shape(step.ctrl), dtype=bool)
    return np.abs(_asked(servo, step)) > servo.limit


def applied_torque(servo: Servo | ServoArrays, step: MotorStep) -> Array:
    """Return the motor torque that was applied over a step [N m], in the step's shape.

    The actuator sensor shows kp (u - q), the force before the implicit update; what enters the
    step's momentum balance is, with (q, v) before the step and (q+, v+) after it,

        discrete:      tau = clip(kp (u - q+) - kd v+, limit) - (limit / speed) v+
        implicitfast:  tau = clip(kp (u - q)  - kd v+, limit) - (limit / speed) v+
        torque drive:  tau = clip(u, limit) - (limit / speed) v+

    `simulation.limits` keeps the limit so; MuJoCo alone decides with the step's start whether it
    clips.
    """
    asked = _asked(servo, step)
    if servo.limit is not None:
        asked = np.clip(asked, -servo.limit, servo.limit)
    passive = servo.kd if _is_kd_passive(servo, step.drive) else servo.back_emf
    return asked - passive * step.v_next


def _back_emf(servo: Servo | ServoArrays) -> float:
    """Return limit / speed [N m s/rad], 0 without them."""
    return 0.0 if servo.speed is None or servo.limit is None else servo.limit / servo.speed


def _is_kd_passive(servo: Servo | ServoArrays, drive: Drive) -> bool:
    """Return whether kd is the joint's damping: only where no limit can clip it."""
    return servo.limit is None and drive == "position"


def _asked(servo: Servo | ServoArrays, step: MotorStep) -> Array:
    """Return the torque at the end of a step before the limit clips it [N m]."""
    if step.drive == "torque":
        return step.ctrl
    # MuJoCo's `discrete` integrator lets the spring act at the end of the step, not at its start.
    spring = servo.kp * (step.ctrl - (step.q_next if step.integrator == "discrete" else step.q))
    return spring if servo.limit is None else spring - servo.kd * step.v_next
