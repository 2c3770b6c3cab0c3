"""The heat of the motors' windings, and whether a servo survives a motion that goes on for good.

The winding is one body: with P its copper heat, R_th its thermal resistance to the air around the
servo and tau its time constant, its temperature T follows

    P = R (torque / kt)^2,     tau dT/dt = P R_th - (T - ambient)

so that a motion that repeats itself for good brings it to ambient + R_th mean(P).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array


class Cooling(NamedTuple):
    """How a winding gets rid of its heat.

    Attributes:
        resistance: R_th, from the winding to the air [K/W].
        time: tau [s].
        hottest: Temperature that the winding bears for good [deg C].
        ambient: Temperature of the air [deg C].
    """

    resistance: float
    time: float
    hottest: float
    ambient: float

    @property
    def allowed(self) -> float:
        """Heat that keeps the winding at `hottest` [W]."""
        return (self.hottest - self.ambient) / self.resistance


class Winding(NamedTuple):
    """A motor's winding, as its servo's table has it.

    Attributes:
        kt: Torque per current at the output, gear included [N m/A].
        R: Resistance [ohm].
        cooling: How it gets rid of its heat; None where that is not known.
    """

    kt: float
    R: float
    cooling: Cooling | None = None

    @property
    def continuous(self) -> float | None:
        """Torque that heats it to the hottest that it bears, for good [N m]: kt sqrt(P / R)."""
        if self.cooling is None:
            return None
        return self.kt * math.sqrt(self.cooling.allowed / self.R)


class Heating(NamedTuple):
    """The heat of both motors in a motion that goes on for good.

    Attributes:
        watts: Mean copper heat of A and of E [W], (2,).
        temperature: What their windings get to [deg C], (2,); None where the cooling is not known.
        continuous: RMS torque of each as a part of the continuous torque, (2,); None as above.
        used: Heat of the hotter one as a part of what it bears; None as above.
        time: Time constant of the windings [s]; None as above.
    """

    watts: Array
    temperature: Array | None = None
    continuous: Array | None = None
    used: float | None = None
    time: float | None = None

    def reaches(self, part: float) -> float | None:
        """Return when the hotter winding's rise above ambient is a part of what it bears [s].

            -tau ln(1 - part / used)   from a start at the ambient temperature

        None where it never gets there, or is not known to.
        """
        if self.used is None or self.time is None or not self.used > part:
            return None
        return -self.time * math.log1p(-part / self.used)


def heating(torque: Array, winding: Winding) -> Heating:
    """Return how steps that repeat themselves for good heat the motors.

    With P the mean of R (torque / kt)^2 over the steps, and P_max what holds `hottest`:

        temperature = ambient + R_th P,   used = P / P_max,   continuous = sqrt(used)

    Args:
        torque: (tau_A, tau_E) of every step [N m], (N, 2), N at least 1.
        winding: The winding of either motor.
    """
    current = torque / winding.kt
    watts = winding.R * np.mean(current**2, axis=0)
    cooling = winding.cooling
    if cooling is None:
        return Heating(watts)

    parts = watts / cooling.allowed
    return Heating(
        watts=watts,
        temperature=cooling.ambient + cooling.resistance * watts,
        continuous=np.sqrt(parts),
        used=float(parts.max()),
        time=cooling.time,
    )


def line_used(torque: Array, speed: Array, limit: float, no_load: float) -> Array:
    """Return how near each motor comes to its torque-speed line: on it is 1.

        max |torque + (limit / no_load) speed| / limit

    is the largest voltage that the motor needs, as a part of the full one.

    Args:
        torque: (tau_A, tau_E) of every step [N m], (N, 2), N at least 1.
        speed: Rates of A and E [rad/s], (N, 2).
        limit: Torque at stall [N m].
        no_load: Speed without load [rad/s].

    Returns:
        Of A and of E, (2,).
    """
    return np.abs(torque / limit + speed / no_load).max(axis=0)
