"""What the firmware's float arithmetic adds to exact motor angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, as_pairs, at, first_index
from fivebar_sim.errors import UnreachableError
from fivebar_sim.firmware.kinematics import inverse
from fivebar_sim.firmware.leg import of
from fivebar_sim.firmware.status import Status
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import wrap


def rounding(leg: FiveBar, foot: ArrayLike, theta: ArrayLike) -> Array:
    """Return the firmware's angles less the exact ones, in whichever turn these are, (..., 2).

    Args:
        leg: The leg; the working mode is its own.
        foot: F [m], hip frame, (..., 2); rounded to float32, as the firmware takes it.
        theta: The exact (theta_A, theta_E) [rad], (..., 2).

    Raises:
        GeometryError: The firmware cannot hold the leg.
        UnreachableError: In float32 the leg does not reach some point; `.index` is the first.
    """
    points = as_pairs(foot, "foot")
    angles, status = inverse(of(leg), points, *leg.mode)
    lost = np.asarray(status != Status.OK)
    if lost.any():
        index = first_index(lost)
        x, z = points[index].tolist()
        raise UnreachableError(
            f"in float32 the leg does not reach the foot at ({x:g}, {z:g}) m{at(index)}: status "
            f"{Status(int(status[index])).name}",
            index,
        )

    return wrap(angles.astype(np.float64) - as_pairs(theta, "theta"))
