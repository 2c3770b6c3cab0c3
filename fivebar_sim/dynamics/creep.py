"""How far a foot that should stick creeps under `implicitfast`, and the torque that this costs.

MuJoCo computes the force of a contact with the inertia M, while a step of `implicitfast` divides
by M + h D, where D is the damping of the servos. (`discrete` does both with M + h D.) Friction asks
for a foot that stops, v_dot = -b v, and v is the speed at which it slides. With J the row of
v = J q_dot + const., the step gives

    v_dot = -b v - h J M^-1 D q_ddot

so that a foot that should stick slides at v = -(h / b) J M^-1 D q_ddot. Loop and contact are two
constraints of one solver: M is that of the open chain A-L1-B-L2, which carries the foot, and of D
it has A's damping alone. Since the foot began to stick it has crept by

    x = -sum of (h D_A / b) (J M^-1)_A (change of theta_dot_A in the step)

The servos hold against it. With the hip fixed along x, and the weight on the foot given,

    change of tau = -kp j x / |j|^2,   j = d foot_x / d theta
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics.chain import Chain
from fivebar_sim.dynamics.plane import dot, placed
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import FRICTION_RATE

INSIDE = 0.99
"""Part of the largest friction below which a foot sticks; one that slides has the largest."""


class Footing(NamedTuple):
    """What holds a foot in its place under `implicitfast`.

    Attributes:
        friction: Coulomb's coefficient between foot and floor.
        damping: Damping of the servos that the step takes implicitly [N m s/rad].
        stiffness: Position gain of the servos [N m/rad].
    """

    friction: float
    damping: float
    stiffness: float


class Course(NamedTuple):
    """What the creep needs of every step of a run.

    Attributes:
        timestep: h [s].
        q: Joint angles (theta_A, theta_B, theta_E, theta_D) [rad], (N, 4).
        rate_A: Rate of A [rad/s], (N,).
        ground: Force of the ground on the foot (x, z) [N], (N, 2).
        torque: Torques of A and E [N m], (N, 2).
    """

    timestep: float
    q: Array
    rate_A: Array
    ground: Array
    torque: Array


def changes(leg: FiveBar, footing: Footing, course: Course) -> Array:
    """Return what the creep changes in each motor's torque, as a part of its RMS, (N, 2).

    Measured on trots, hops, landings and squats of several legs, gains, rotors and belts, from 0.5
    to 0.02 ms, against `discrete` at 1/16 ms: RMS torques and the load share are wrong by 0.2 to
    1.7 times the RMS of this, on a belt mostly by about as much.

        treadmill-trot      0.25, 0.1, 0.02 ms    errors 38, 12, 2.2 %    RMS of this 42, 11, 2.0 %
        rail-hop            0.25, 0.1, 0.05 ms           5, 2, 1.1 %                   12, 5, 2.3 %
        rail-landing        0.25, 0.1, 0.05 ms           2, 1.1, 0.6 %                 4, 1.7, 0.8 %
        q8bot-squat         0.25, 0.1, 0.05 ms           1.2, 0.4, 0.2 %               6, 2.4, 1.2 %
        minitaur-treadmill  1 ms                         0.3 %                         0.3 %

    Args:
        leg: The leg.
        footing: What holds the foot.
        course: The steps of a run.

    Raises:
        PoseError: A pose has no Jacobian.
    """
    sticking = sticks(course.ground, footing.friction)
    crept = distance(leg, course.q, course.rate_A, sticking, footing.damping, course.timestep)
    change = cost(leg, course.q[:, ::2], crept, footing.stiffness)

    rms = np.sqrt((course.torque**2).mean(axis=0))
    # A motor without torque has none to lose.
    return np.divide(change, rms, out=np.zeros_like(change), where=rms > 0.0)


def sticks(ground: Array, friction: float) -> Bools:
    """Return in which steps the foot stands and does not slide, (N,).

    Args:
        ground: Force of the ground on the foot (x, z) [N], (N, 2).
        friction: Coulomb's coefficient.
    """
    x, z = ground.T
    return (z > 0.0) & (np.abs(x) < INSIDE * friction * z)


def pushed(leg: FiveBar, theta_A: Array, psi_2: Array) -> Array:
    """Return (J M^-1)_A: how a torque at A accelerates the foot along x [1/(kg m)].

    It is the lowest point of the foot's ball, on the chain A-L1-B-L2 alone. With the coordinates
    theta_A and psi_2 = theta_A + theta_B, M = (I1, H; H, I2):

        J M^-1 (1, 0) = (J_1 I2 - J_2 H) / (I1 I2 - H^2)

    Args:
        leg: The leg.
        theta_A: Angle of A [rad].
        psi_2: Direction of L2 [rad].
    """
    chain = Chain.of(leg, None, 0.0)
    e1 = (np.cos(theta_A), np.sin(theta_A))
    e2 = (np.cos(psi_2), np.sin(psi_2))
    H = leg.L1 * dot(e1, placed(e2, chain.S2))

    J_1 = -leg.L1 * e1[1]
    # The ball turns with L2 and rolls on the floor.
    J_2 = -placed(e2, leg.foot_offset)[1] + leg.foot_radius
    return (J_1 * chain.I2 - J_2 * H) / (chain.I1 * chain.I2 - H**2)


def distance(
    leg: FiveBar, q: Array, rate_A: Array, sticking: Bools, damping: float, timestep: float
) -> Array:
    """Return how far the foot has crept since it began to stick [m], (N,); 0 where it does not.

    Args:
        leg: The leg.
        q: Joint angles (theta_A, theta_B, ...) [rad], (N, 4).
        rate_A: Rate of A [rad/s], (N,).
        sticking: Whether the foot sticks in each step, (N,).
        damping: Damping of the servos [N m s/rad].
        timestep: h [s].
    """
    change = np.diff(rate_A, prepend=rate_A[:1])
    gain = timestep * damping / FRICTION_RATE * pushed(leg, q[:, 0], q[:, 0] + q[:, 1])
    crept = np.cumsum(np.where(sticking, -gain * change, 0.0))
    # What it had crept when it last did not stick.
    before = np.maximum.accumulate(np.where(sticking, 0, np.arange(len(crept))))
    return crept - crept[before]


def cost(leg: FiveBar, theta: Array, crept: Array, stiffness: float) -> Array:
    """Return by how much the creep changes the motors' torques [N m], (N, 2).

    Args:
        leg: The leg.
        theta: Angles of A and E [rad], (N, 2).
        crept: How far the foot has crept along x [m], (N,).
        stiffness: Position gain of the servos [N m/rad].

    Raises:
        PoseError: A pose has no Jacobian.
    """
    j = kinematics.jacobian(leg, theta)[:, 0, :]
    return -stiffness * crept[:, None] * j / (j**2).sum(axis=-1, keepdims=True)
