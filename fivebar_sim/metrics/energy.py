"""The energy balance of a run: where energy came from and went, and what is unaccounted for.

A step of MuJoCo takes the joint rates v at the pose q to v' by M(q) (v' - v) = h (f - c(q, v)), f
the joint torques of all that acts and c the centripetal ones, and then moves on with v'. With
w = (v + v') / 2, what acts does the work h f . w in the step, and what the kinetic energy gains at
that pose is all of it if c were that of w: what a step gives away by taking c at its start,
-h (c(q, v) - c(q, w)) . w, is counted as a work of its own. And rates belong to the middle of the
step that they moved the leg by, as in leapfrog: energies are those of v at q - h v / 2.

What is left is then a few parts in a million of the energy turned over. A worse balance means that
other torques, masses or constraints acted than the record says.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.chain import Chain, Pose, Vector, placed
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import end_velocity
from fivebar_sim.metrics.columns import (
    JOINT_COLUMNS,
    MOTOR_JOINTS,
    RATE_COLUMNS,
    motors,
    side_by_side,
)
from fivebar_sim.metrics.ground import contact_radius
from fivebar_sim.metrics.json_types import Amount, Number, Table

STILL = 1e-8
"""Angle that no joint turns by in a leg that only stands [rad]; its balance would be rounding."""


class Body(NamedTuple):
    """What moves.

    Attributes:
        leg: The leg.
        payload: Point mass at the foot [kg].
        trunk: Mass that rides on the hip [kg]; 0 where the hip is fixed.
    """

    leg: FiveBar
    payload: float
    trunk: float

    @property
    def mass(self) -> float:
        """All of it [kg]."""
        return self.trunk + self.payload + sum(link.mass for link in self.leg.links)


class Steps(NamedTuple):
    """What acted on the leg besides the motors, and where it began, at rest.

    Attributes:
        start: qpos at t = 0, the hip's height first where it slides, (nq,).
        constraint: Joint forces of all constraints in each step: loop, ground, gear friction and
            ends of travel, (N, nq).
        force: Pushes on the foot in each step [N], (N, 2), or (N, 0) for none.
    """

    start: Array
    constraint: Array
    force: Array


class Balance(NamedTuple):
    """The works of each step on the leg and its load, and the gains of energy [J], each (N,).

    Attributes:
        motor: Work of motors A and E, including their damping.
        force: Work of the pushes on the foot.
        ground: Work of floor or belt.
        constraints: Work of all other constraints: the loop at C, gear friction, ends of travel;
            negative is lost.
        step: Energy that MuJoCo's step gave by taking centripetal torques at its start.
        kinetic: Gain of kinetic energy.
        potential: Gain of potential energy.
        moved: Whether the leg moved at all; see `STILL`.
        lift: Energy that lifts all that moves by the leg's size, not of a step [J].
    """

    motor: Array
    force: Array
    ground: Array
    constraints: Array
    step: Array
    kinetic: Array
    potential: Array
    moved: bool
    lift: float

    @property
    def turnover(self) -> float:
        """Sum of the absolute works of motors, pushes, ground, constraints and gravity [J]."""
        acting = (self.motor, self.force, self.ground, self.constraints, self.potential)
        return float(np.sum(np.abs(acting)))

    @property
    def unaccounted(self) -> Array:
        """Energy so far that no work accounts for [J], (N,)."""
        given = self.motor + self.force + self.ground + self.constraints + self.step
        return np.cumsum(self.kinetic + self.potential - given)

    @property
    def given(self) -> Array:
        """Energy that constraints gave since they had given least [J], (N,)."""
        # They can only take: any rise of the running sum is energy from nowhere.
        so_far = np.cumsum(self.constraints)
        return so_far - np.minimum.accumulate(np.minimum(so_far, 0.0))

    @property
    def imbalance(self) -> float | None:
        """Largest |unaccounted| / turnover; None where the leg only stood."""
        if not (self.moved and self.turnover > 0.0):
            return None
        return float(np.abs(self.unaccounted).max()) / self.turnover


class Energy(Table, frozen=True):
    """The table "energy" of metrics.json: what the columns of `Balance` add up to [J]."""

    motor: Number
    force: Number
    ground: Number
    constraints: Number
    step: Number
    kinetic: Number
    potential: Number
    turnover: Amount
    imbalance: Amount


class _Motion(NamedTuple):
    """The motion at t = 0 and after each step, (N + 1, ...), and the mean rates of steps, (N, ...).

    Attributes:
        q: Joint angles as in `mechanical` [rad], (N + 1, 4).
        v: Their rates [rad/s], (N + 1, 4).
        hip: Height of the hip frame [m], (N + 1,).
        hip_dot: Its rate [m/s], (N + 1,).
        w: Mean joint rates of each step [rad/s], (N, 4).
        lift: Mean rate of the hip [m/s], (N,).
    """

    q: Array
    v: Array
    hip: Array
    hip_dot: Array
    w: Array
    lift: Array

    @classmethod
    def of(cls, record: Mapping[str, Array], start: Array) -> _Motion:
        """Return the motion of a record that began at rest."""
        q = side_by_side(record, JOINT_COLUMNS)
        v = side_by_side(record, RATE_COLUMNS)
        q = _begun(start[-4:], q)
        v = _begun(np.zeros(4), v)
        # A fixed hip is a hip at height 0 that never moves.
        hip, hip_dot = np.zeros((2, len(q)))
        if "hip_z" in record:
            hip = _begun(start[0], record["hip_z"])
            hip_dot = _begun(0.0, record["hip_dot_z"])
        return cls(q, v, hip, hip_dot, 0.5 * (v[1:] + v[:-1]), 0.5 * (hip_dot[1:] + hip_dot[:-1]))

    def turned(self, leg: FiveBar) -> bool:
        """Return whether a joint turned by more than `STILL`, or the hip rose by as much."""
        # A part of the leg's size for the hip: the rule is the same for legs of any size.
        most = max(float(np.ptp(self.q, axis=0).max()), float(np.ptp(self.hip)) / leg.size)
        return most > STILL


def balance(body: Body, record: Mapping[str, Array], steps: Steps) -> Balance:
    """Return the works of every step, and what the energies gained.

    Args:
        body: What moves.
        record: The columns of rollout.parquet.
        steps: What acted besides the motors.
    """
    leg = body.leg
    h = float(record["time"][0])
    m = _Motion.of(record, steps.start)
    # Rates belong to the middle of the step that they moved the leg by; see above.
    kinetic, potential = mechanical(
        body, m.q - 0.5 * h * m.v, m.v, m.hip - 0.5 * h * m.hip_dot, m.hip_dot
    )
    torque = motors(record, "torque")
    foot = foot_rates(leg, m.q[:-1], m.w)
    none = np.zeros(len(m.w))
    ground = none

    if "ground_z" in record:
        height = m.hip[:-1] + kinematics.chain_points(leg, m.q[:-1]).F[:, 1] - leg.foot_radius
        rolled = contact_radius(leg, height) * (m.w[:, 0] + m.w[:, 1])
        # The force acts on the ball's lowest point, which also rolls.
        x = foot[:, 0] + rolled
        z = foot[:, 1] + m.lift
        ground = h * (record["ground_x"] * x + record["ground_z"] * z)

    joints = np.column_stack([m.lift, m.w]) if "hip_z" in record else m.w
    return Balance(
        motor=h * np.sum(torque * m.w[:, MOTOR_JOINTS], axis=-1),
        force=h * np.sum(steps.force * foot, axis=-1) if steps.force.size else none,
        ground=ground,
        constraints=h * np.sum(steps.constraint * joints, axis=-1) - ground,
        step=h * _given_away(body, m),
        kinetic=np.diff(kinetic),
        potential=np.diff(potential),
        moved=m.turned(leg),
        lift=body.mass * float(np.hypot(*leg.gravity)) * leg.size,
    )


def _given_away(body: Body, m: _Motion) -> Array:
    """Return -(c(q, v) - c(q, w)) . w of every step [W], v the rates at its start, (N,).

    c is that of the links' own directions, and of the hip, which a link's moment r about its joint
    pushes down by r_z psi_dot^2.
    """
    chain = Chain.of(body.leg, None, body.payload)
    p = _open_pose(m.q[:-1])
    v = _of_links(m.v[:-1])
    w = _of_links(m.w)
    still = (0.0, 0.0, 0.0, 0.0)
    at_start = chain.link_torques(p, v, still)
    meant = chain.link_torques(p, w, still)
    links = sum((c - d) * rate for c, d, rate in zip(at_start, meant, w, strict=True))
    hip = sum(
        r[1] * (a * a - b * b) for r, a, b in zip(chain.moments(p), v, w, strict=True)
    )  # fmt: skip

    return np.asarray(hip * m.lift - links)


def mechanical(
    body: Body, q: Array, v: Array, hip: Array | float = 0.0, hip_dot: Array | float = 0.0
) -> Vector:
    """Return the kinetic energy and the potential one, zero with all masses at height 0 [J], (...).

    They are those of the open tree: the loop may be open, and the knees turn freely.

    Args:
        body: What moves.
        q: (theta_A, theta_B, theta_E, theta_D), knees relative to L1 and L4 [rad], (..., 4).
        v: Their rates [rad/s], (..., 4).
        hip: Height of the hip frame [m], (...).
        hip_dot: Its rate [m/s], (...).
    """
    chain = Chain.of(body.leg, None, body.payload)
    p = _open_pose(q)
    w = _of_links(v)
    kinetic, potential = chain.energies(p, w)
    momentum = sum(r[0] * rate for r, rate in zip(chain.moments(p), w, strict=True))
    gravity = body.leg.gravity[1]
    return (
        kinetic + hip_dot * (momentum + 0.5 * body.mass * hip_dot),
        potential - body.mass * gravity * hip,
    )


def foot_rates(leg: FiveBar, q: Array, v: Array) -> Array:
    """Return the velocity of the foot in the hip frame, that of the open chain A-B-F [m/s].

    perp(AB) psi_1_dot + perp(BF) psi_2_dot,   perp(x, z) = (-z, x)

    Args:
        leg: The leg.
        q: Joint angles as in `mechanical` [rad], (..., 4).
        v: Their rates [rad/s], (..., 4).
    """
    psi_1 = q[..., 0]
    psi_2 = q[..., 0] + q[..., 1]
    AB = np.stack([leg.L1 * np.cos(psi_1), leg.L1 * np.sin(psi_1)], axis=-1)
    BF = np.stack(placed((np.cos(psi_2), np.sin(psi_2)), leg.foot_offset), axis=-1)
    return end_velocity(AB, BF, v[..., 0], v[..., 0] + v[..., 1])


def measure(found: Balance) -> Energy:
    """Return the metrics of the energy, over the whole run.

    The net works and gains of `Balance` [J], and its turnover and imbalance.
    """
    works = ("motor", "force", "ground", "constraints", "step", "kinetic", "potential")
    net = {name: float(getattr(found, name).sum()) for name in works}
    return Energy(**net, turnover=found.turnover, imbalance=found.imbalance)


def _open_pose(q: Array) -> Pose:
    """Return the directions of the links at joint angles as in `mechanical`."""
    return Pose(*((np.cos(psi), np.sin(psi)) for psi in _of_links(q)))


def _of_links(q: Array) -> tuple[Array, Array, Array, Array]:
    """Return psi_1..psi_4, the links' own directions, of joint angles; or their rates, of rates."""
    A, B, E, D = (q[..., i] for i in range(4))
    return A, A + B, E + D, E


def _begun(start: Array | float, after: Array) -> Array:
    """Return values after each step with those before the first one."""
    return np.concatenate([np.broadcast_to(start, after[:1].shape), after])
