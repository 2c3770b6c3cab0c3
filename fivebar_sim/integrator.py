"""MuJoCo's integrator: its name, the scenario's table [sim], and how stiffly it closes the loop."""

from __future__ import annotations

from typing import Literal

import msgspec

from fivebar_sim.checks import check_number

Integrator = Literal["discrete", "implicitfast"]

CONNECT = {
    "discrete": ((1e-4, 1.0), (0.95, 0.99, 0.001)),
    # Here the time constant is in timesteps: below two of them the leg flies apart.
    "implicitfast": ((2.0, 1.0), (0.9999, 0.9999, 0.001)),
}
"""solref and solimp of the loop's closure by integrator; docs/model.md shows what they do."""


FRICTION_RATE = 2.0 / (0.95 * 0.005)
"""How fast friction stops a foot in the solver's eyes, v_dot = -b v [1/s]: 2 / (dmax timeconst).

They are those of the geom `foot` in leg.xml.
"""

ON_RAIL = 5e-5
"""Default timestep of `implicitfast` on a floor that stands still [s]; see `dynamics.creep`."""

ON_BELT = 2e-5
"""The same on a treadmill [s]: what a foot creeps adds up over a stance that goes one way."""


class Sim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The table [sim] of a scenario.

    Attributes:
        timestep: h [s]. A scenario under "implicitfast" that gives none has 0.05 ms on a rail and
            0.02 ms on a treadmill.
        integrator: MuJoCo's integrator, "discrete" or "implicitfast".
        seed: Seed of all random numbers in a run, such as the sensors' noise.
    """

    timestep: float = 0.001
    integrator: Integrator = "discrete"
    seed: int = 0

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep, "s", low=0.0, strict=True)
        check_number("seed", self.seed, "", low=0)


def solref(integrator: Integrator, timestep: float) -> tuple[float, float]:
    """Return the time constant [s] and the damping ratio of the loop's closure."""
    timeconst, ratio = CONNECT[integrator][0]
    return timeconst * timestep if integrator == "implicitfast" else timeconst, ratio


def pull(timestep: float) -> tuple[float, float]:
    """Return the stiffness k [1/s^2] and the drag b [1/s] of the loop under `implicitfast`.

    The constraint asks for gap_ddot = -b gap_dot - k gap. With the time constant T, the damping
    ratio z and the impedance d, the same for every gap under `implicitfast`:

        k = 1 / (d T^2 z^2),   b = 2 / (d T)

    See:
        MuJoCo, Modeling, Solver parameters: k carries its impedance d here.
    """
    T, z = solref("implicitfast", timestep)
    # solimp is flat at 0.9999 there, so that d does not depend on the gap.
    d = CONNECT["implicitfast"][1][1]
    return 1.0 / (d * (T * z) ** 2), 2.0 / (d * T)
