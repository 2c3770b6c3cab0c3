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
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, blocks, total
from fivebar_sim.dynamics.chain import Chain, Pose, kept
from fivebar_sim.dynamics.plane import Four, Vector, placed
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import (
    JOINT_COLUMNS,
    MOTOR_JOINTS,
    RATE_COLUMNS,
    TORQUE_COLUMNS,
)
from fivebar_sim.metrics.ground import contact_radius
from fivebar_sim.metrics.json_types import Amount, Number, Table

STILL = 1e-8
"""Angle that no joint turns by in a leg that only stands [rad]; its balance would be rounding."""

WORKS = ("motor", "force", "ground", "constraints", "step", "kinetic", "potential")
"""What `Balance` has of each step."""

Joints = tuple[Array, ...]
"""An angle or a rate of each of the joints A, B, E, D."""


@dataclass(frozen=True)
class Body:
    """What moves.

    Attributes:
        leg: The leg.
        payload: Point mass at the foot [kg].
        trunk: Mass that rides on the hip [kg]; 0 where the hip is fixed.
    """

    leg: FiveBar
    payload: float
    trunk: float

    @cached_property
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
        before: Poses before each step, (N,) each; None: the record tells them.
    """

    start: Array
    constraint: Array
    force: Array
    before: Pose | None = None


@dataclass(frozen=True)
class Balance:
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

    @cached_property
    def turnover(self) -> float:
        """Sum of the absolute works of motors, pushes, ground, constraints and gravity [J]."""
        acting = (self.motor, self.force, self.ground, self.constraints, self.potential)
        return total(float(np.abs(each).sum()) for each in acting)

    @cached_property
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
    """The motion before n steps and after each, n + 1 rows, and the mean rates of steps, n rows.

    Attributes:
        q: Angle of each joint as in `mechanical` [rad], (n + 1,) each.
        v: Their rates [rad/s], (n + 1,) each.
        w: Mean joint rates of each step [rad/s], (n,) each.
        hip: Height of the hip frame [m], (n + 1,); a fixed hip is at 0 and never moves.
        hip_dot: Its rate [m/s], (n + 1,) or 0.
        lift: Its mean rate of each step [m/s], (n,) or 0.
    """

    q: Joints
    v: Joints
    w: Joints
    hip: Array | float = 0.0
    hip_dot: Array | float = 0.0
    lift: Array | float = 0.0

    @classmethod
    def of(cls, record: Mapping[str, Array], start: Array, rows: slice) -> _Motion:
        """Return the motion in some steps of a record that began at rest."""
        begun = zip(JOINT_COLUMNS, start[-4:], strict=True)
        q = tuple(_begun(record[name], rows, at) for name, at in begun)
        v = tuple(_begun(record[name], rows) for name in RATE_COLUMNS)
        w = tuple(_mean(each) for each in v)
        if "hip_z" not in record:
            return cls(q, v, w)
        hip_dot = _begun(record["hip_dot_z"], rows)
        return cls(q, v, w, _begun(record["hip_z"], rows, start[0]), hip_dot, _mean(hip_dot))


def balance(body: Body, record: Mapping[str, Array], steps: Steps) -> Balance:
    """Return the works of every step, and what the energies gained.

    Args:
        body: What moves.
        record: The columns of rollout.parquet.
        steps: What acted besides the motors.
    """
    leg = body.leg
    rows = len(record["time"])
    chain = kept(leg, None, body.payload)
    works: dict[str, Array] = dict(zip(WORKS, np.empty((len(WORKS), rows)), strict=True))
    for part in blocks(rows):
        for name, values in _works(body, chain, record, steps, part).items():
            works[name][part] = values

    return Balance(
        **works,
        moved=_turned(leg, record, steps.start),
        lift=body.mass * float(np.hypot(*leg.gravity)) * leg.size,
    )


def _works(
    body: Body, chain: Chain, record: Mapping[str, Array], steps: Steps, rows: slice
) -> dict[str, Array | float]:
    """Return the works of some steps, and what the energies gained; see `balance`."""
    h = float(record["time"][0])
    m = _Motion.of(record, steps.start, rows)
    # Rates belong to the middle of the step that they moved the leg by; see above.
    middle = tuple(q - 0.5 * h * v for q, v in zip(m.q, m.v, strict=True))
    kinetic, potential = mechanical(body, middle, m.v, m.hip - 0.5 * h * m.hip_dot, m.hip_dot)
    pose = steps.before.links(rows) if steps.before else open_pose(tuple(q[:-1] for q in m.q))
    pushes, ground = _outer(body.leg, record, steps, rows, m, pose)

    joints = m.w if isinstance(m.lift, float) else (m.lift, *m.w)
    # Column by column: a sum over each short row by itself takes thirty times as long.
    constraints = total(steps.constraint[rows, i] * rate for i, rate in enumerate(joints))
    torque_A, torque_E = (record[name][rows] for name in TORQUE_COLUMNS)
    return {
        "motor": h * (torque_A * m.w[MOTOR_JOINTS[0]] + torque_E * m.w[MOTOR_JOINTS[1]]),
        "force": h * pushes,
        "ground": h * ground,
        "constraints": h * constraints - h * ground,
        "step": h * _given_away(chain, m, pose),
        "kinetic": np.diff(kinetic),
        "potential": np.diff(potential),
    }


def _outer(
    leg: FiveBar, record: Mapping[str, Array], steps: Steps, rows: slice, m: _Motion, pose: Pose
) -> tuple[Array | float, Array | float]:
    """Return the powers of the pushes and of the ground in some steps [W], 0 without them."""
    pushes = 0.0
    ground = 0.0
    pushed = steps.force.size > 0
    if not pushed and "ground_z" not in record:
        return pushes, ground

    psi_2_dot = m.w[0] + m.w[1]
    x, z = foot_rates(leg, pose, m.w[0], psi_2_dot)
    if pushed:
        pushes = steps.force[rows, 0] * x + steps.force[rows, 1] * z
    if "ground_z" in record:
        first = kinematics.chain_points(leg, steps.start[-4:]).F[1]
        hip = _begun(record["hip_z"], rows, steps.start[0])[:-1]
        height = hip + _begun(record["foot_z"], rows, first)[:-1] - leg.foot_radius
        rolled = contact_radius(leg, height) * psi_2_dot
        # The force acts on the ball's lowest point, which also rolls.
        ground = record["ground_x"][rows] * (x + rolled) + record["ground_z"][rows] * (z + m.lift)
    return pushes, ground


def _turned(leg: FiveBar, record: Mapping[str, Array], start: Array) -> bool:
    """Return whether a joint turned by more than `STILL`, or the hip rose by as much."""
    turns = [_range(record[name], at) for name, at in zip(JOINT_COLUMNS, start[-4:], strict=True)]
    # A part of the leg's size for the hip: the rule is the same for legs of any size.
    rise = _range(record["hip_z"], start[0]) / leg.size if "hip_z" in record else 0.0
    return max(*turns, rise) > STILL


def _range(values: Array, start: float) -> float:
    """Return how far values, and what they began with, are apart."""
    return float(max(values.max(), start) - min(values.min(), start))


def _given_away(chain: Chain, m: _Motion, p: Pose) -> Array:
    """Return -(c(q, v) - c(q, w)) . w of every step [W], v the rates at its start, (N,).

    c is that of the links' own directions, and of the hip, which a link's moment r about its joint
    pushes down by r_z psi_dot^2.

    Args:
        chain: The leg's constants, payload included.
        m: Its motion.
        p: The poses before each step.
    """
    v = _of_links(tuple(rate[:-1] for rate in m.v))
    w = _of_links(m.w)
    moments = chain.moments(p)
    X12, X43 = chain.turning(p, moments)
    # v^2 - w^2 of each link.
    a, b, c, d = ((before - mean) * (before + mean) for before, mean in zip(v, w, strict=True))
    links = X12 * (a * w[1] - b * w[0]) + X43 * (d * w[2] - c * w[3])
    if isinstance(m.lift, float):
        return -links
    hip = total(r[1] * each for r, each in zip(moments, (a, b, c, d), strict=True))
    return hip * m.lift - links


def mechanical(
    body: Body, q: Joints, v: Joints, hip: Array | float = 0.0, hip_dot: Array | float = 0.0
) -> Vector:
    """Return the kinetic energy and the potential one, zero with all masses at height 0 [J], (...).

    They are those of the open tree: the loop may be open, and the knees turn freely.

    Args:
        body: What moves.
        q: (theta_A, theta_B, theta_E, theta_D), knees relative to L1 and L4 [rad], (...) each.
        v: Their rates [rad/s], (...) each.
        hip: Height of the hip frame [m], (...).
        hip_dot: Its rate [m/s], (...).
    """
    chain = kept(body.leg, None, body.payload)
    p = open_pose(q)
    w = _of_links(v)
    moments = chain.moments(p)
    kinetic, potential = chain.energies(p, w, moments)
    # A fixed hip.
    if isinstance(hip, float) and isinstance(hip_dot, float) and hip == hip_dot == 0.0:
        return kinetic, potential

    momentum = total(r[0] * rate for r, rate in zip(moments, w, strict=True))
    return (
        kinetic + hip_dot * (momentum + 0.5 * body.mass * hip_dot),
        potential - body.mass * body.leg.gravity[1] * hip,
    )


def foot_rates(leg: FiveBar, p: Pose, psi_1_dot: Array, psi_2_dot: Array) -> Vector:
    """Return the velocity of the foot in the hip frame, that of the open chain A-B-F [m/s].

    perp(AB) psi_1_dot + perp(BF) psi_2_dot,   perp(x, z) = (-z, x)

    Args:
        leg: The leg.
        p: Its pose.
        psi_1_dot: Rate of L1's direction [rad/s], (...).
        psi_2_dot: Rate of L2's direction [rad/s], (...).
    """
    BF = placed(p.e2, leg.foot_offset)
    x = -(leg.L1 * p.e1[1]) * psi_1_dot - BF[1] * psi_2_dot
    return x, leg.L1 * p.e1[0] * psi_1_dot + BF[0] * psi_2_dot


def measure(found: Balance) -> Energy:
    """Return the metrics of the energy, over the whole run.

    The net works and gains of `Balance` [J], and its turnover and imbalance.
    """
    net = {name: float(getattr(found, name).sum()) for name in WORKS}
    return Energy(**net, turnover=found.turnover, imbalance=found.imbalance)


def open_pose(q: Joints) -> Pose:
    """Return the directions of the links at joint angles as in `mechanical`."""
    return Pose(*((np.cos(psi), np.sin(psi)) for psi in _of_links(q)))


def _of_links(q: Joints) -> Four:
    """Return psi_1..psi_4, the links' own directions, of joint angles; or their rates, of rates."""
    A, B, E, D = q
    return A, A + B, E + D, E


def _mean(rate: Array) -> Array:
    """Return the means over steps of rates before and after them, (n + 1,) to (n,)."""
    return 0.5 * (rate[1:] + rate[:-1])


def _begun(after: Array, rows: slice, start: float = 0.0) -> Array:
    """Return values after some steps, with the one before the first of them, (n + 1,)."""
    if rows.start > 0:
        return after[rows.start - 1 : rows.stop]
    return np.concatenate([[start], after[rows]])
