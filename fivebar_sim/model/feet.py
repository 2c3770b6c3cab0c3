"""What a floor does to the feet of legs, seen in each leg's own plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.gears import Bars, Foot, foot_place
from fivebar_sim.robots.places import rotation

POSE = 7
"""Numbers of a trunk's pose at the front of qpos: its place, then its quaternion."""


class Hips(NamedTuple):
    """Where legs are on the trunks that carry them, (n, k, ...) of n robots of k legs.

    Attributes:
        place: Of the hip frame in the trunk's [m], (n, k, 3).
        axes: Columns are the hip frame's axes in the trunk's, (n, k, 3, 3).
    """

    place: Array
    axes: Array

    @classmethod
    def of(cls, models: Sequence[mujoco.MjModel], fronts: Sequence[str]) -> Hips:
        """Return the hips of some models, whose legs' names begin with `fronts`."""
        bodies = [[model.body(f"{front}hip") for front in fronts] for model in models]
        turned = np.array([[body.quat for body in row] for row in bodies])
        axes = rotation(turned.reshape(-1, 4)).reshape(*turned.shape[:2], 3, 3)
        return cls(np.array([[body.pos for body in row] for row in bodies]), axes)


def walking(bars: Bars, hips: Hips, q: Array, trunk: Array, force: Array) -> Foot:
    """Return what a floor does to the feet of robots whose trunks are free.

    Args:
        bars: The legs, (n k,) each.
        hips: Where they are on their trunks.
        q: (theta_A, theta_B, theta_E, theta_D) before the step [rad], (n, k, 4).
        trunk: Place [m] and quaternion of each trunk before it, (n, 7).
        force: Of the floor on each foot, along the world's axes [N], (n, k, 3).
    """
    axes = rotation(trunk[:, 3:])[:, None] @ hips.axes
    place = trunk[:, None, :3] + np.einsum(
        "nij,nkj->nki", rotation(trunk[:, 3:]), np.broadcast_to(hips.place, (*q.shape[:2], 3))
    )

    # Along the plane's x and z; what acts along the joints' own axes turns none of them.
    plane = axes.reshape(-1, 3, 3)[..., [0, 2]]
    acting = np.einsum("nij,ni->nj", plane, force.reshape(-1, 3))

    foot = foot_place(bars, q.reshape(-1, 4))
    height = place.reshape(-1, 3)[:, 2] + np.einsum("nj,nj->n", plane[:, 2], foot)
    overlap = np.minimum(height - bars.foot_radius, 0.0)
    # MuJoCo has the contact in the middle of the overlap, below the ball's middle.
    arm = -(bars.foot_radius + 0.5 * overlap)[:, None] * plane[:, 2]
    return Foot(acting, arm)
