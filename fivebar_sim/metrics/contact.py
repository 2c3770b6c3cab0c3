"""How far `implicitfast` falls short of a contact's work: a foot that should stick creeps.

MuJoCo computes the force of a contact with the inertia M. A step of `implicitfast` then divides by
M + h D, where D is the damping of the servos, so that the foot's motion changes by a part of what
the contact asked for, and the rest comes steps later. Meanwhile the foot creeps, and the motors
lose the side force that they held against each other. `discrete` computes both with M + h D.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import PoseError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import ground
from fivebar_sim.metrics.columns import motors


def shortfall(leg: FiveBar, record: Mapping[str, Array], damping: float) -> Array | None:
    """Return the largest eigenvalue of h D / M in each step in stance, 0 elsewhere, (N,).

    A contact moves the leg by 1 / (1 + it) of what it should. Measured on the shipped scenarios,
    with the errors of the load share and the RMS torques at 1, 0.5, 0.25 and 0.125 ms against
    `discrete` at 1/16 ms: the worst error falls with the timestep. It is at most 0.12 times this
    number on a rail. On a belt that the foot must not be dragged by, it is up to 0.7 times as much.

        treadmill-trot      2.7 to 0.34    75, 63, 50, 17 %
        rail-hop            2.8 to 0.34    33, 9, 5, 3 %
        rail-landing        2.5 to 0.32    16, 5, 2, 1 %
        q8bot-squat         4.0 to 0.50    5, 3, 1, 1 %
        minitaur-treadmill  0.16 to 0.02   0.3 % and less

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        damping: Rate gain of the servos that the step takes implicitly [N m s/rad].

    Returns:
        None where a pose has no mass matrix.
    """
    h = float(record["time"][0])
    stands = ground.stands(record)
    try:
        M = dynamics.mass_matrix(leg, motors(record, "theta")[stands])
    except PoseError:
        return None
    found = np.zeros(len(stands))
    # M is symmetric and positive: its smallest eigenvalue has the largest inverse.
    found[stands] = h * damping / np.linalg.eigvalsh(M)[:, 0]
    return found
