"""A robot in many poses at once, as MuJoCo has it there: in one call for some hundred of them."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from fivebar_sim.arrays import Array
from fivebar_sim.simulation.lean import without_clock

BLOCK = 256
"""Poses in a call: what MuJoCo says of them stays in the processor's cache."""

OFF = (
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
    mujoco.mjtDisableBit.mjDSBL_CONTACT,
    mujoco.mjtDisableBit.mjDSBL_GRAVITY,
    mujoco.mjtDisableBit.mjDSBL_SPRING,
    mujoco.mjtDisableBit.mjDSBL_DAMPER,
    mujoco.mjtDisableBit.mjDSBL_SENSOR,
    mujoco.mjtDisableBit.mjDSBL_ISLAND,
)
"""What makes no difference to masses and velocities."""


class Pose(NamedTuple):
    """What MuJoCo has in some poses, (n, ...) each.

    Attributes:
        kinetic: Kinetic energy [J], (n,).
        bias: Joint torques of c(q, v), without weight [N m], (n, nv).
        centers: Of mass, of each body [m], (n, bodies, 3).
        geoms, sites: Places [m], (n, ..., 3).
        rates: Turning rates and velocities of the bodies [rad/s, m/s], (n, bodies, 6).
        about: The points that the velocities are of [m], (n, bodies, 3).
        root: Which of these points belongs to each body, (bodies,).
    """

    kinetic: Array
    bias: Array
    centers: Array
    geoms: Array
    sites: Array
    rates: Array
    about: Array
    root: Array

    def turning(self, body: int) -> Array:
        """Return a body's turning rates [rad/s], (n, 3)."""
        return self.rates[:, body, :3]

    def velocity(self, body: int, point: Array) -> Array:
        """Return the velocity of a point of a body [m/s], (n, 3)."""
        rx, ry, rz = (point - self.about[:, int(self.root[body])]).T
        wx, wy, wz = self.turning(body).T
        # np.cross takes four times as long.
        turned = np.stack([wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx], axis=1)
        return self.rates[:, body, 3:] + turned


class Poses:
    """A robot in many poses.

    Args:
        model: The robot's model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        bare = copy.copy(model)
        bare.opt.disableflags |= sum(flag.value for flag in OFF)
        bare.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY.value
        self._batch = Batch(bare, BLOCK, 1)
        names = ("energy", "qfrc_bias", "xipos", "geom_xpos", "site_xpos", "cvel", "subtree_com")
        self._fields = [self._batch.bind(name) for name in names]
        self._root = bare.body_rootid

    def blocks(self, q: Array, v: Array) -> Iterator[tuple[slice, Pose]]:
        """Yield some poses after the other, and what MuJoCo has in them until the next.

        Args:
            q: qpos, (N, nq).
            v: qvel, (N, nv).
        """
        batch = self._batch
        for begin in range(0, len(q), BLOCK):
            rows = slice(begin, min(begin + BLOCK, len(q)))
            count = rows.stop - begin
            batch.qpos[:count] = q[rows]
            batch.qvel[:count] = v[rows]

            with without_clock():
                batch.forward(np.arange(count), mujoco.mjtStage.mjSTAGE_VEL.value)
            energy, *fields = (field[:count] for field in self._fields)
            yield rows, Pose(energy[:, 1], *fields, root=self._root)
