"""Where the energy of a run came from and where it went, and what is left unaccounted for.

A step of MuJoCo takes the joint rates v at the pose q to v' by M(q) (v' - v) = h f, f the joint
torques of all that acts, and then moves on with v'. So what acts does the work h f . (v + v') / 2
in the step: exactly what the kinetic energy gains at that pose. And rates belong to the middle of
the step that they moved the leg by, as in leapfrog: energies are those of v at q - h v / 2.
What is left is of second order in the steps' turns; of classic-ellipse 0.02 %, of a landing 0.005 %
of what is turned over. A balance that is worse tells of torques that are not those that acted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.chain import Chain, Pose, Vector, placed
from fivebar_sim.geometry import FiveBar
from fivebar_sim.ground import contact_radius

JOINTS = "ABED"
"""The leg's joints in the order of qpos."""

TINY = 1e-9
"""Turned over, this [J] is nothing: the imbalance of a leg that only stands says nothing."""


class Body(NamedTuple):
    """What moves.

    Attributes:
        leg: The leg.
        payload: Point mass at the foot [kg].
        trunk: What rides on the hip [kg]; 0 where the hip is fixed.
    """

    leg: FiveBar
    payload: float
    trunk: float


class Steps(NamedTuple):
    """What acted on a run besides motors and ground, and where it began, at rest.

    Attributes:
        start: qpos at t = 0, the hip's height first where it slides, (nq,).
        constraint: Joint forces of all constraints in each step: loop, ground, gear friction and
            ends of travel, (N, nq).
        force: Pushes on the foot in each step [N], (N, 2), or (N, 0) for none.
    """

    start: Array
    constraint: Array
    force: Array


class Works(NamedTuple):
    """The work of a step on the leg and what it carries [J], each (N,).

    Attributes:
        motor: Of A and E, their damping included.
        force: Of the pushes on the foot.
        ground: Of floor or belt.
        constraints: Of the loop at C, gear friction and ends of travel; negative is lost.
        kinetic: What the kinetic energy gained.
        potential: What the potential energy gained.
    """

    motor: Array
    force: Array
    ground: Array
    constraints: Array
    kinetic: Array
    potential: Array

    @property
    def turnover(self) -> float:
        """The work of all steps with either sign, added up [J]."""
        return float(np.sum(np.abs(self[:4])))

    @property
    def unaccounted(self) -> Array:
        """Energy so far that no work accounts for [J], (N,)."""
        return np.cumsum(self.kinetic + self.potential - np.sum(self[:4], axis=0))

    @property
    def imbalance(self) -> float | None:
        """Largest |unaccounted| / turnover of all times; None where next to nothing was turned."""
        if not self.turnover > TINY:
            return None
        return float(np.abs(self.unaccounted).max()) / self.turnover


def works(body: Body, record: Mapping[str, Array], steps: Steps) -> Works:
    """Return the work of every step.

    Args:
        body: What moves.
        record: The columns of rollout.parquet.
        steps: What acted besides.
    """
    leg, h = body.leg, float(record["time"][0])
    q = np.stack([record[f"theta_{joint}"] for joint in JOINTS], axis=-1)
    v = np.stack([record[f"theta_dot_{joint}"] for joint in JOINTS], axis=-1)
    q, v = _begun(steps.start[-4:], q), _begun(np.zeros(4), v)
    hip, hip_dot = np.zeros((2, len(q)))
    if "hip_z" in record:
        hip = _begun(steps.start[0], record["hip_z"])
        hip_dot = _begun(0.0, record["hip_dot_z"])
    kinetic, potential = mechanical(body, q - 0.5 * h * v, v, hip - 0.5 * h * hip_dot, hip_dot)

    w, lift = 0.5 * (v[1:] + v[:-1]), 0.5 * (hip_dot[1:] + hip_dot[:-1])
    torque = np.stack([record["torque_A"], record["torque_E"]], axis=-1)
    moved = foot_rates(leg, q[:-1], w)
    force = h * np.sum(steps.force * moved, axis=-1) if steps.force.size else np.zeros(len(w))
    ground = np.zeros(len(w))
    if "ground_z" in record:
        height = hip[:-1] + kinematics.chain_points(leg, q[:-1]).F[:, 1] - leg.foot_radius
        rolled = contact_radius(leg, height) * (w[:, 0] + w[:, 1])
        ground = h * (
            record["ground_x"] * (moved[:, 0] + rolled) + record["ground_z"] * (moved[:, 1] + lift)
        )
    joints = np.column_stack([lift, w]) if "hip_z" in record else w
    return Works(
        motor=h * np.sum(torque * w[:, [0, 2]], axis=-1),
        force=force,
        ground=ground,
        constraints=h * np.sum(steps.constraint * joints, axis=-1) - ground,
        kinetic=np.diff(kinetic),
        potential=np.diff(potential),
    )


def mechanical(
    body: Body, q: Array, v: Array, hip: Array | float = 0.0, hip_dot: Array | float = 0.0
) -> Vector:
    """Return the kinetic energy and the potential one, zero with all masses at height 0 [J], (...).

    Of the open tree: the loop may be open, and the knees turn as they like.

    Args:
        body: What moves.
        q: (theta_A, theta_B, theta_E, theta_D), knees relative to L1 and L4 [rad], (..., 4).
        v: Their rates [rad/s], (..., 4).
        hip: Height of the hip frame [m], (...).
        hip_dot: Its rate [m/s], (...).
    """
    chain = Chain.of(body.leg, None, body.payload)
    psi = _of_links(q)
    p = Pose(*((np.cos(angle), np.sin(angle)) for angle in psi))
    w = _of_links(v)
    kinetic, potential = chain.energies(p, w)
    mass = body.trunk + body.payload + sum(link.mass for link in body.leg.links)
    momentum = sum(r[0] * rate for r, rate in zip(chain.moments(p), w, strict=True))
    gravity = body.leg.gravity[1]
    return (
        kinetic + hip_dot * (momentum + 0.5 * mass * hip_dot),
        potential - mass * gravity * hip,
    )


def foot_rates(leg: FiveBar, q: Array, v: Array) -> Array:
    """Return the velocity of the foot in the hip frame, that of the open chain A-B-F [m/s].

    perp(AB) psi_1_dot + perp(BF) psi_2_dot,   perp(x, z) = (-z, x)

    Args:
        leg: The leg.
        q: Joint angles as in `mechanical` [rad], (..., 4).
        v: Their rates [rad/s], (..., 4).
    """
    psi_1, psi_2, w1, w2 = q[..., 0], q[..., 0] + q[..., 1], v[..., 0], v[..., 0] + v[..., 1]
    AB = leg.L1 * np.cos(psi_1), leg.L1 * np.sin(psi_1)
    BF = placed((np.cos(psi_2), np.sin(psi_2)), leg.foot_offset)
    return np.stack([-AB[1] * w1 - BF[1] * w2, AB[0] * w1 + BF[0] * w2], axis=-1)


def measure(works: Works) -> dict[str, Any]:
    """Return the metrics of the energy, over the whole run.

    motor, force, ground and constraints are the net works [J], kinetic and potential what was
    gained; turnover and imbalance those of `Works`.
    """
    return {
        **{name: float(work.sum()) for name, work in works._asdict().items()},
        "turnover": works.turnover,
        "imbalance": works.imbalance,
    }


def _of_links(q: Array) -> tuple[Array, Array, Array, Array]:
    """Return psi_1..psi_4, the links' own directions, of joint angles; or their rates, of rates."""
    A, B, E, D = (q[..., i] for i in range(4))
    return A, A + B, E + D, E


def _begun(start: Array | float, after: Array) -> Array:
    """Return values after each step with those before the first one."""
    return np.concatenate([np.broadcast_to(start, after[:1].shape), after])
