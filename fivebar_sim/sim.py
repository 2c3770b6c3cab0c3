"""How a run is simulated: the scenario's table [sim]."""

from __future__ import annotations

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.servo import Integrator


class Sim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How the run is simulated.

    Attributes:
        timestep: h [s].
        integrator: MuJoCo's integrator, "discrete" or "implicitfast".
        seed: Of everything random in a run, as the sensors' noise.
    """

    timestep: float = 0.001
    integrator: Integrator = "discrete"
    seed: int = 0

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep, "s", low=0.0, strict=True)
        check_number("seed", self.seed, "", low=0)
