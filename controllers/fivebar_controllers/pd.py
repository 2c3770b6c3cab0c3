"""Joint PD: each motor's torque from its own angle and rate."""

from __future__ import annotations

from typing import ClassVar, Literal, overload

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.paths.heights import part_of

Gain = float | tuple[float, ...]
"""One number, or one for each part of a run."""


class Pd(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pull each motor to its reference angle with a spring and a damper.

        derivative "measurement":  tau = kp (theta* - theta) - kd theta_dot
        derivative "error":        tau = kp (theta* - theta) + kd (theta_dot* - theta_dot)

    The first trails a moving reference by kd / kp times its rate, the second does not.

    A torque that is held for a period T is stable about a still reference if every eigenvalue m
    of the mass matrix has

        kp T / 2 < kd < 2 m / T        and swings back within a period if kd is above m / T.

    The default gains suit the preset `classic` (m = 2e-5 kg m^2) at 1 ms. A published study of the
    leg of preset `airhockey` has kp = 5, 50 and 150, kd = 5 and the first law.

    Each gain is one number, or a list with one for each part of the run: a jump is stiff while it
    pushes off and soft when it lands.

    Attributes:
        kp: Position gain of each motor [N m/rad].
        kd: Derivative gain [N m s/rad].
        kp_opening: Position gain of the leg's opening, half the difference of the motors' angles
            [N m/rad]; kp is then that of its direction, their mean. None: kp for both, so that each
            motor has its own angle alone.
        kd_opening: Derivative gain of the same [N m s/rad]; None: kd.
        seconds: How long each part of the run but the last takes [s]; empty: it has one part.
        derivative: Whether kd acts on the measured rate or on the rate's error.
        period: Time between two commands T [s].
    """

    drive: ClassVar[Drive] = "torque"

    kp: Gain = 1.0
    kd: Gain = 0.01
    kp_opening: Gain | None = None
    kd_opening: Gain | None = None
    seconds: tuple[float, ...] = ()
    derivative: Literal["measurement", "error"] = "measurement"
    period: float = 0.001

    def __post_init__(self) -> None:
        for seconds in self.seconds:
            check_number("seconds", seconds, "s", low=0.0, strict=True)
        for key in ("kp", "kd", "kp_opening", "kd_opening"):
            self._check_gain(key, getattr(self, key))
        check_number("period", self.period, "s", low=0.0, strict=True)

    def _check_gain(self, key: str, gain: Gain | None) -> None:
        """Raise unless a gain is a number, or one for each part of the run."""
        parts = len(self.seconds) + 1
        if isinstance(gain, tuple) and len(gain) != parts:
            raise ArgumentError(
                f"{key} must be a number or a list of {parts}, one for each part of the run that "
                f"seconds makes, got {len(gain)}"
            )
        unit = "N m/rad" if key.startswith("kp") else "N m s/rad"
        for value in gain if isinstance(gain, tuple) else (gain,):
            if value is not None:
                check_number(key, value, unit, low=0.0)

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the motor torques [N m], (..., 2)."""
        del leg, servo  # each motor by itself, driven in torque
        error = wanted.theta - seen.theta
        if not self.seconds and self.kp_opening is None and self.kd_opening is None:
            # As most are: asked in every step, a leg spends a tenth of its time here.
            if self.derivative == "measurement":
                return self.kp * error - self.kd * seen.theta_dot
            return self.kp * error + self.kd * (wanted.theta_dot - seen.theta_dot)

        rate = -seen.theta_dot
        if self.derivative == "error":
            rate = wanted.theta_dot - seen.theta_dot
        part = int(part_of(self.seconds, seen.time)) if self.seconds else 0
        spring = _weighed(_in_part(self.kp, part), _in_part(self.kp_opening, part), error)
        return spring + _weighed(_in_part(self.kd, part), _in_part(self.kd_opening, part), rate)


@overload
def _in_part(gain: Gain, part: int) -> float: ...
@overload
def _in_part(gain: Gain | None, part: int) -> float | None: ...
def _in_part(gain: Gain | None, part: int) -> float | None:
    """Return a gain in one part of the run."""
    return gain[part] if isinstance(gain, tuple) else gain


def _weighed(mean: float, opening: float | None, pair: Array) -> Array:
    """Return a gain by a pair of A and E; with two gains, of their mean and of half what differs.

        (mean m + opening d, mean m - opening d),   m = (A + E) / 2,   d = (A - E) / 2

    Args:
        mean: The gain.
        opening: That of the half difference; None: the same, to the last bit.
        pair: (A, E), (..., 2).
    """
    if opening is None:
        return mean * pair
    middle = 0.5 * mean * pair.sum(axis=-1, keepdims=True)
    half = 0.5 * opening * (pair[..., :1] - pair[..., 1:])
    return np.concatenate([middle + half, middle - half], axis=-1)
