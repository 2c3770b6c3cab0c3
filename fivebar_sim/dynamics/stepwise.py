"""The closed chain in MuJoCo's own steps: torques for a motion given at the times k h.

Rates and accelerations of all links are those of the step from k to k + 1, with psi the directions
of the links as in `chain`, and the leg at rest before the first step:

    w+[k] = (psi[k+1] - psi[k]) / h,   w[k] = w+[k-1],  w[0] = 0,   alpha[k] = (w+ - w) / h
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, as_pairs, as_vectors, at, finite, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.chain import Chain, Pose
from fivebar_sim.dynamics.motion import TURN_MAX
from fivebar_sim.dynamics.plane import Four, Vector, cross, dot
from fivebar_sim.errors import ArgumentError, DivergedError, SingularError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import pull
from fivebar_sim.kinematics.rates import SINGULAR

STILL = 1e-12
"""Turn of a motor in a step that counts as none [rad]: as a path sets out, the angles' rounding
would turn the friction round and round."""


def step_torques(
    leg: FiveBar,
    q: ArrayLike,
    timestep: float,
    foot_force: ArrayLike | None = None,
    *,
    payload: float = 0.0,
    friction: float = 0.0,
) -> Array:
    """Return the motor torques that carry all links from each row of a motion to the next.

        tau = G^T (H(psi) alpha + c(psi, w) - Q(psi)) - J^T F + friction sign(theta_dot+)
        (a motor that turns by less than `STILL` in a step has sign 0)

    with G at psi = psi[k]. MuJoCo's step is M (v+ - v) / h + bias = tau + constraint, with M, bias
    and forces at the start of the step. The four rates need not fit the closed loop, and the loop
    may have a small gap. For h -> 0 the result is that of `inverse`.

    Args:
        leg: The leg.
        q: (theta_A, theta_B, theta_E, theta_D) at the times k h, k = 0..N [rad], (..., N + 1, 4).
        timestep: h [s].
        foot_force: (x, z) that the world exerts on the foot during each step [N], broadcasts with
            (..., N, 2); None: 0.
        payload: Point mass at F [kg].
        friction: Coulomb friction of each motor's gear [N m].

    Returns:
        (tau_A, tau_E) of the steps from k = 0..N - 1 [N m], (..., N, 2).

    Raises:
        SingularError: B, C and D are in line.
        ArgumentError: Shapes that do not fit, numbers that are not finite, fewer than two rows,
            a timestep that is not positive, negative payload or friction.
    """
    return step_chain(Chain.of(leg, None, payload), q, timestep, foot_force, friction)


def step_chain(
    chain: Chain, q: ArrayLike, timestep: float, foot_force: ArrayLike | None, friction: float
) -> Array:
    """Return what `step_torques` returns, given a leg's constants."""
    check_number("friction", friction, "N m", low=0.0)
    steps = _Steps.of(_rows(q), timestep)
    force = _forces((0.0, 0.0) if foot_force is None else foot_force, steps.psi[0].shape)
    p = _pose(chain, steps.psi)
    t_A, t_E = chain.at_motors(p, chain.link_torques(p, steps.w, steps.alpha))
    f_A, f_E = chain.foot_torques(p, (force[..., 0], force[..., 1]))

    return np.stack(
        [
            t_A - f_A + friction * _direction(steps.w_next[0] * timestep),
            t_E - f_E + friction * _direction(steps.w_next[3] * timestep),
        ],
        axis=-1,
    )


def _direction(turned: Array) -> Array:
    """Return the sign of what a motor turns by in each step; 0 where that may be rounding."""
    return np.where(np.abs(turned) > STILL, np.sign(turned), 0.0)


def soft_loop(
    leg: FiveBar, q: ArrayLike, timestep: float, damping: float, *, payload: float = 0.0
) -> Array:
    """Return the motion with the loop gap that `implicitfast` needs: L4, L3 trail behind L1, L2.

    MuJoCo computes the loop's force with M, but steps with M + h D, where D is the damping of A
    and E. So the acceleration of the links that the constraint sees is not alpha but

        alpha' = M^-1 (M + h D) alpha,   so   gap_ddot(alpha') = -b gap_dot - k gap

    with k and b of `integrator.pull`, and gap_ddot including its centripetal part. So a moving leg
    opens the loop. The foot sits on L2, so L1 and L2 follow q to the last bit and the foot stays on
    its path; the equation determines L3 and L4, and is solved for them step by step. With

        P = sum of L_i ((k - w_i^2) e_i + x_i perp(e_i)),   x = alpha' + b w

    over a side's two links it is P_right = P_left + k (A - E). The constraint's regularisation is
    neglected: at 1 ms it moves the foot by a nanometre in the air, by 0.3 um under 5 N.

    Args:
        leg: The leg.
        q: (theta_A, theta_B, theta_E, theta_D) of the closed loop at the times k h [rad],
            k = 0..N, (N + 1, 4).
        timestep: h [s].
        damping: Damping of the joints A and E [N m s/rad].
        payload: Point mass at F [kg].

    Returns:
        The angles [rad], (N + 1, 4); theta_A, theta_B and the first row are those of q.

    Raises:
        SingularError: E, D and C come in line.
        DivergedError: A link would turn by TURN_MAX or more in a step.
        ArgumentError: As `step_torques`, or a negative damping.
    """
    return soften(Chain.of(leg, None, payload), q, timestep, damping)


def soften(chain: Chain, q: ArrayLike, timestep: float, damping: float) -> Array:
    """Return what `soft_loop` returns, given a leg's constants."""
    check_number("damping", damping, "N m s/rad", low=0.0)
    q = _rows(q)
    if q.ndim != 2:
        raise ArgumentError(f"q must have shape (N + 1, 4), got {q.shape}")
    steps = _Steps.of(q, timestep)
    pulled = _pull_left(chain, steps, timestep, damping)
    start = float(steps.psi[2][0]), float(steps.psi[3][0])
    psi3, psi4 = _trail(chain, pulled, start, timestep, damping).T
    return np.stack([q[:, 0], q[:, 1], psi4, psi3 - psi4], axis=-1)


class _Steps(NamedTuple):
    """Directions, rates and accelerations of the links L1..L4 in every step, each (..., N)."""

    psi: Four
    w: Four
    w_next: Four
    alpha: Four

    @classmethod
    def of(cls, q: Array, timestep: float) -> _Steps:
        """Return the steps of rows of joint angles, (..., N + 1, 4)."""
        check_number("timestep", timestep, "s", low=0.0, strict=True)
        A, B, E, D = np.moveaxis(q, -1, 0)
        # Absolute directions L1, L2, L3, L4; the knees turn relative to the inner links.
        psi = np.stack([A, A + B, E + D, E])
        # An overflow leaves inf or NaN, which the check below rejects.
        with np.errstate(over="ignore", invalid="ignore"):
            w_next = np.diff(psi, axis=-1) / timestep
            # Before the first row nothing moves, as in a run that starts from rest.
            w = np.concatenate([np.zeros_like(w_next[..., :1]), w_next[..., :-1]], axis=-1)
            alpha = (w_next - w) / timestep
        if not np.isfinite(alpha).all():
            raise ArgumentError(f"q must have finite accelerations at a timestep of {timestep!r} s")
        return cls(*(tuple(rows) for rows in (psi[..., :-1], w, w_next, alpha)))


def _rows(q: ArrayLike) -> Array:
    """Return the rows of joint angles; ArgumentError unless there are at least two."""
    rows = finite(as_vectors(q, "q", 4), "q")
    if rows.ndim < 2 or rows.shape[-2] < 2:
        raise ArgumentError(f"q must have shape (..., N + 1, 4) with N >= 1, got {rows.shape}")
    return rows


def _forces(force: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return the foot force of every step."""
    values = finite(as_pairs(force, "foot_force"), "foot_force")
    try:
        return np.broadcast_to(values, (*shape, 2))
    except ValueError:
        raise ArgumentError(
            f"foot_force must broadcast with (..., N, 2) = {(*shape, 2)}, got {values.shape}"
        ) from None


def _pose(chain: Chain, psi: Four) -> Pose:
    """Return the pose of links with the directions psi; the loop may be open."""
    e1, e2, e3, e4 = ((np.cos(angle), np.sin(angle)) for angle in psi)
    # The loop may be open by micrometres, so only this is checked, not closure.
    sine = np.abs(cross(e2, e3))
    if not (sine > SINGULAR).all():
        raise _in_line("B, C and D", float(sine.min()), first_index(sine <= SINGULAR))
    return chain.coupled(e1, e2, e3, e4)


def _in_line(joints: str, sine: float, index: tuple[int, ...]) -> SingularError:
    return SingularError(
        f"{joints} are in line: the sine of the angle there must be above {SINGULAR:.1e}, "
        f"got {sine:.1e}{at(index)}",
        index,
    )


def _pull_left(chain: Chain, steps: _Steps, h: float, damping: float) -> Array:
    """Return P_left + k (A - E) of every step [m/s^2], (N, 2)."""
    k, b = pull(h)
    p = _pose(chain, steps.psi)
    w1, w2, _, _ = steps.w
    a1, a2, _, _ = steps.alpha
    H12, _ = chain.couplings(p)
    share = h * damping / (chain.I1 * chain.I2 - H12 * H12)

    # x = alpha' + b w, where alpha' = M^-1 (M + h D) alpha and D damps A alone, that is row 1.
    x1 = a1 + share * chain.I2 * a1 + b * w1
    x2 = a2 - share * H12 * a1 + b * w2
    f1 = chain.leg.L1 * (k - w1 * w1)
    f2 = chain.leg.L2 * (k - w2 * w2)
    x1 = chain.leg.L1 * x1
    x2 = chain.leg.L2 * x2

    return np.stack(
        [
            f1 * p.e1[0] - x1 * p.e1[1] + f2 * p.e2[0] - x2 * p.e2[1] - k * chain.AE[0],
            f1 * p.e1[1] + x1 * p.e1[0] + f2 * p.e2[1] + x2 * p.e2[0] - k * chain.AE[1],
        ],
        axis=-1,
    )


def _trail(chain: Chain, pulled: Array, start: Vector, h: float, damping: float) -> Array:
    """Return (psi_3, psi_4) of the side that the loop pulls along [rad], (N + 1, 2)."""
    psi3, psi4 = start
    w3 = 0.0
    w4 = 0.0
    rows = [start]

    # As plain floats, since arithmetic on single numbers is slow in NumPy.
    for n, row in enumerate(pulled.tolist()):
        e3 = math.cos(psi3), math.sin(psi3)
        e4 = math.cos(psi4), math.sin(psi4)
        sine = cross(e4, e3)
        if not abs(sine) > SINGULAR:
            raise _in_line("E, D and C", abs(sine), (n,))

        alpha3, alpha4 = _follow(chain, row, (e3, e4), (w3, w4), h, damping)
        w3 = w3 + h * alpha3
        w4 = w4 + h * alpha4
        if not (abs(h * w3) < TURN_MAX and abs(h * w4) < TURN_MAX):
            raise DivergedError(
                f"the soft loop cannot follow at t = {n * h:g} s: a link must turn by less than "
                f"{TURN_MAX:g} rad in a step; try a smaller timestep",
                n * h,
            )

        # MuJoCo's step is semi-implicit: the angles move with the new rates.
        psi3 = psi3 + h * w3
        psi4 = psi4 + h * w4
        rows.append((psi3, psi4))

    return np.array(rows)


def _follow(
    chain: Chain,
    pulled: Vector,
    e: tuple[Vector, Vector],
    w: Vector,
    h: float,
    damping: float,
) -> Vector:
    """Return the accelerations of L3 and L4 that keep the loop's equation in one step [rad/s^2].

    Args:
        chain: The leg's constants.
        pulled: P_left + k (A - E) [m/s^2].
        e: Directions of L3 and L4, not in line.
        w: Their rates [rad/s].
        h: Timestep [s].
        damping: Damping of the joint E [N m s/rad].
    """
    k, b = pull(h)
    e3, e4 = e
    w3, w4 = w
    L3 = chain.leg.L3
    L4 = chain.leg.L4

    # Without its terms along e3 and e4, P_right is L3 x3 perp(e3) + L4 x4 perp(e4).
    f3 = L3 * (k - w3 * w3)
    f4 = L4 * (k - w4 * w4)
    x = pulled[0] - f3 * e3[0] - f4 * e4[0]
    z = pulled[1] - f3 * e3[1] - f4 * e4[1]

    # So its product with e3 leaves x4 alone, and the one with e4 leaves x3; x = alpha' + b w.
    sine = cross(e4, e3)
    alpha4 = dot((x, z), e3) / (L4 * sine) - b * w4
    alpha3 = -dot((x, z), e4) / (L3 * sine) - b * w3

    # From alpha' back to alpha = (M + h D)^-1 M alpha', where only E, and so row 4, is damped.
    # Of L3's moment the part across is e3 turned by +90 deg: e4 . perp(e3) = e3 x e4.
    H43 = L4 * chain.S3[0] * dot(e4, e3) + L4 * chain.S3[1] * cross(e3, e4)
    share = h * damping / (chain.I3 * chain.I4 - H43 * H43)
    alpha4 /= 1.0 + share * chain.I3
    alpha3 += share * H43 * alpha4

    return alpha3, alpha4
