"""The foot path of a walking or trotting leg: a straight stance on the ground, a swing above it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import check_number
from fivebar_sim.paths.base import FARTHEST, Cyclic, Pair, Sample, check_pair, ease, times
from fivebar_sim.paths.quintic import STEEPEST, arch, pieces

GRAVITY = 9.81
"""What a running gait's hip falls with [m/s^2]."""


class Gait(Cyclic, frozen=True, tag="gait"):
    """Stance and swing of one leg, in the hip frame, starting in the middle of the stance.

    The foot stands for the fraction duty of each period: it moves straight back along x at
    `stance_speed`, like the ground under a body that moves forward. Then it swings back to the
    front; see `nominal`.

    Within the ramp all speeds are those of `FootPath.at`, s' times the nominal ones: the stance
    speed rises from 0 to its nominal value at t = ramp. Until then a belt that runs at the constant
    `stance_speed` slips against the foot. With ramp <= duty / frequency this happens in the first
    stance alone.

    Attributes:
        centre: (x, z) of the middle of the stance line [m]; z is that of the ground.
        stride: Length of the stance line [m]: the body moves on by stride / duty in each period.
            Negative walks towards -x; 0 steps on the spot.
        lift: Height of the swing above the ground [m].
        duty: Duty factor: the fraction of a period that is stance, in (0, 1).
        touchdown: Downward speed of the foot at the end of the swing [m/s].
        running: Whether the hip flies while the foot swings, as it must where no other leg carries
            it; see `bounce`. In a walk the hip stays level.
    """

    centre: Pair
    stride: float
    lift: float
    duty: float = 0.5
    touchdown: float = 0.0
    running: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "centre", "m")
        check_number("stride", self.stride, "m", low=-FARTHEST, high=FARTHEST)
        check_number("lift", self.lift, "m", low=0.0, high=FARTHEST, strict=True)
        check_number("duty", self.duty, "", low=0.0, high=1.0, strict=True)
        check_number("touchdown", self.touchdown, "m/s", low=0.0, high=self.fastest_touchdown)

    @property
    def stance_speed(self) -> float:
        """Speed of the ground under the foot towards -x, stride frequency / duty [m/s]."""
        return self.stride * self.frequency / self.duty

    @property
    def fastest_touchdown(self) -> float:
        """Greatest touchdown [m/s], 6 lift frequency / (1 - duty): above, the swing passes lift."""
        return STEEPEST * self.lift * self.frequency / (0.5 * (1.0 - self.duty))

    def cycle(self, time: ArrayLike) -> Array:
        """Return the time since the planned touch-down, in periods, with the ramp of the path.

        Args:
            time: [s], shape (...).

        Returns:
            In [0, 1), shape (...): stance below duty, swing from there on.

        Raises:
            ArgumentError: Unless every time is in [0, inf).
        """
        return self._cycle(ease(times(time, self.end), self.ramp)[0])

    def in_stance(self, time: ArrayLike) -> Bools:
        """Return whether the foot is planned to stand: from touch-down up to lift-off.

        Args:
            time: [s], shape (...).

        Raises:
            ArgumentError: Unless every time is in [0, inf).
        """
        return np.asarray(self.cycle(time) < self.duty)

    def nominal(self, time: ArrayLike) -> Sample:
        """Return stance and swing and their rates; see `FootPath.nominal`.

        With c the cycle since touch-down, v = stance_speed, and T = (1 - duty) / frequency:

            stance, c < duty:   x = cx + stride (1/2 - c / duty),   z = cz
            swing, c >= duty:   x: a quintic from cx - stride/2 to cx + stride/2, x' = -v, x'' = 0
                                at both ends;   z: the `arch` of lift, up and down in T/2 each

        Position, velocity and acceleration are continuous, within and between the pieces, with one
        exception: at touch-down z' jumps from -touchdown to 0, since the ground stops the foot; the
        value at that instant is 0. The foot overshoots the stance line at both ends of the swing,
        where it must turn round. If `running`, z is lower by the height of the hip, see `bounce`:
        the foot's height above the ground stays as it is here.
        """
        cycle = self._cycle(self._times(time))
        duty = self.duty
        half = 0.5 * self.stride
        stands = cycle < duty
        # Both halves are computed for all times; where it stands the swing is not used.
        swing = np.maximum(cycle, duty)
        cx, cz = self.centre
        slope = -self.stride / duty
        x, dx, ddx = pieces([(duty, cx - half, slope, 0.0), (1.0, cx + half, slope, 0.0)], swing)
        z, dz, ddz = pieces(arch(duty, 1.0, cz, self.lift, self.touchdown * self.period), swing)
        x = np.where(stands, cx + half + slope * cycle, x)
        dx = np.where(stands, slope, dx)
        ddx = np.where(stands, 0.0, ddx)

        position = np.stack([x, z], axis=-1)
        velocity = self.frequency * np.stack([dx, dz], axis=-1)
        acceleration = self.frequency**2 * np.stack([ddx, ddz], axis=-1)
        if not self.running:
            return Sample(position, velocity, acceleration)

        # In the frame of a hip that rises, the foot falls.
        up, up_dot, up_ddot = self.bounce(cycle)
        position[..., 1] -= up
        velocity[..., 1] -= up_dot
        acceleration[..., 1] -= up_ddot
        return Sample(position, velocity, acceleration)

    def bounce(self, cycle: Array) -> tuple[Array, Array, Array]:
        """Return how far a running leg's hip is above where it touches down, and its two rates.

        In swing the hip flies. In stance the ground pushes it by a half sine, as the foot force of
        kind "stance" does; the push's mean over a period is the weight. With c the cycle:

            swing    h'' = -GRAVITY
            stance   h'' = GRAVITY (pi / (2 duty) sin(pi c / duty) - 1)

        Args:
            cycle: Of `cycle`, in [0, 1), shape (...).

        Returns:
            h [m], h' [m/s] and h'' [m/s^2], each (...). All are continuous; h = 0 at touch-down and
            lift-off.
        """
        duty = self.duty
        stands = cycle < duty
        span = np.where(stands, duty, 1.0 - duty) * self.period
        t = np.where(stands, cycle, cycle - duty) * self.period
        push = np.where(stands, 0.5 * GRAVITY / duty, 0.0)
        turn = np.pi * t / span

        up = 0.5 * GRAVITY * t * (span - t) - push * span**2 / np.pi * np.sin(turn)
        up_dot = 0.5 * GRAVITY * (span - 2.0 * t) - push * span * np.cos(turn)
        up_ddot = push * np.pi * np.sin(turn) - GRAVITY
        return up, up_dot, up_ddot

    def _cycle(self, time: Array) -> Array:
        # Half a stance after touch-down at t = 0: the ramp from rest begins on the ground.
        return np.mod(time * self.frequency + 0.5 * self.duty, 1.0)
