"""The oracle's motions: the closed chain under a continuous servo, to about 1e-11 rad.

The state is (theta_A, theta_E) and its rate; the knees follow from closure in every evaluation, so
the loop cannot drift. Accelerations come from the multipliers' equations of `oracle`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import oracle
from oracle import Array, Leg

Pair = Sequence[float]
Path = Callable[[float], tuple[Pair, Pair, Pair]]
"""t [s] -> foot position [m], velocity [m/s], acceleration [m/s^2], in the hip frame."""
Slope = Callable[[float, Array], list[float]]
"""t [s], state y -> dy/dt."""
Law = Callable[[Leg, Path, float, Pair, Pair], Pair]
"""(leg, path, t, theta, theta_dot) -> (tau_A, tau_E) [N m]."""


@dataclass(frozen=True, slots=True)
class Servo:
    """A position servo in continuous time; the torque limit clips spring and damper together.

        tau = clip(kp (u - theta) - kd theta_dot, -limit, limit)
        u = theta_ref                                                       feedforward "none"
        u = theta_ref + (kd / kp) theta_dot_ref                             "velocity"
        u = theta_ref + (kd / kp) theta_dot_ref + tau_ref / kp              "dynamics"

    theta_ref is the pose of path(t), taken within half a turn of theta.

    Attributes:
        kp: [N m/rad].
        kd: [N m s/rad].
        feedforward: "none", "velocity" or "dynamics".
        limit: [N m].
    """

    kp: float
    kd: float
    feedforward: str = "none"
    limit: float = math.inf

    def __post_init__(self) -> None:
        legal = ("none", "velocity", "dynamics")
        if self.feedforward not in legal:
            raise ValueError(f"feedforward must be one of {legal}, got {self.feedforward!r}")

    def __call__(self, leg: Leg, path: Path, t: float, theta: Pair, theta_dot: Pair) -> Pair:
        """Return (tau_A, tau_E) [N m]."""
        theta_ref, ahead = _reference(leg, path, t, self.kd, self.feedforward)
        tau = []
        for ref, extra, q, q_dot in zip(theta_ref, ahead, theta, theta_dot, strict=True):
            pull = self.kp * math.remainder(ref - q, 2.0 * math.pi) + extra
            tau.append(min(max(pull - self.kd * q_dot, -self.limit), self.limit))
        return tau


@lru_cache(maxsize=16)  # an integrator asks for the same time again and again
def _reference(
    leg: Leg, path: Path, t: float, kd: float, feedforward: str
) -> tuple[Pair, list[float]]:
    """Return theta_ref [rad], and kp (u - theta_ref) [N m]; see `Servo`."""
    p, v, a = (complex(*x) for x in path(t))
    if feedforward == "none":
        psi = oracle.pose(leg, p)
        return (psi[0], psi[3]), [0.0, 0.0]

    psi, rate, acceleration = oracle.angles_of(leg, p, v, a)
    ahead = [kd * rate[0], kd * rate[3]]
    if feedforward == "dynamics":
        tau_ref = oracle.torques_of(leg, psi, rate, acceleration)
        ahead = [x + y for x, y in zip(ahead, tau_ref, strict=True)]
    return (psi[0], psi[3]), ahead


@dataclass(frozen=True, slots=True)
class Springs:
    """Torsion springs beside the motors: -k (theta - rest) on each, not part of the motors' torque.

    Attributes:
        k: At A and at E [N m/rad].
        rest: (theta_A, theta_E) where they are slack [rad].
    """

    k: tuple[float, float]
    rest: tuple[float, float]

    def torque(self, theta: Pair) -> tuple[float, float]:
        """Return their torques on psi1 and psi4 [N m]."""
        return self.k[0] * (self.rest[0] - theta[0]), self.k[1] * (self.rest[1] - theta[1])

    def energy(self, theta: Pair) -> float:
        """Return k (theta - rest)^2 / 2 of both [J]."""
        return 0.5 * sum(k * (r - q) ** 2 for k, r, q in zip(self.k, self.rest, theta, strict=True))


@dataclass(frozen=True, slots=True)
class Motion:
    """A simulated motion, one row a requested time.

    Attributes:
        time: [s], shape (N,).
        theta: (theta_A, theta_E) [rad], continuous from (-pi, pi], shape (N, 2).
        theta_dot: [rad/s], shape (N, 2).
        psi: All four absolute angles [rad], shape (N, 4); the knees' unwrapped from row to row.
        psi_dot: [rad/s], shape (N, 4).
        foot: F [m] in the hip frame, shape (N, 2).
        tau: Torques of the motors [N m], the kd term included, springs not, shape (N, 2).
        energy: Kinetic, potential and of the springs [J], shape (N,).
        gap: Loop gap (x, z) [m], shape (N, 2).
    """

    time: Array
    theta: Array
    theta_dot: Array
    psi: Array
    psi_dot: Array
    foot: Array
    tau: Array
    energy: Array
    gap: Array


def knee_rates(leg: Leg, psi: Sequence[float], psi1_dot: float, psi4_dot: float) -> list[float]:
    """Return psi_dot [rad/s] of a closed loop: sum r_k psi_dot_k = 0, by Cramer's rule."""
    (_, r1), (_, r2), (_, r3), (_, r4) = oracle.loop(leg, psi)[1]
    right = -(r1 * psi1_dot + r4 * psi4_dot)
    area = (r2.conjugate() * r3).imag
    psi2_dot = (right.conjugate() * r3).imag / area
    psi3_dot = (r2.conjugate() * right).imag / area
    return [psi1_dot, psi2_dot, psi3_dot, psi4_dot]


@dataclass(frozen=True, slots=True)
class _Chain:
    """What drives the leg; the state y is (theta_A, theta_E, theta_dot_A, theta_dot_E)."""

    leg: Leg
    law: Law | None
    path: Path
    foot_force: Callable[[float], complex] | None
    springs: Springs | None
    evaluations: Iterator[int]

    def motors(self, t: float, y: Sequence[float]) -> Pair:
        """Return the motors' torques [N m]."""
        return (0.0, 0.0) if self.law is None else self.law(self.leg, self.path, t, y[:2], y[2:])

    def slope(self, t: float, state: Array) -> list[float]:
        """Return dy/dt."""
        if next(self.evaluations, None) is None:
            raise RuntimeError(f"the integrator crawls at t = {t:g} s: are B, C and D in line?")
        y = state.tolist()
        psi = oracle.closed(self.leg, y[0], y[1])
        psi_dot = knee_rates(self.leg, psi, y[2], y[3])
        tau = self.motors(t, y)
        if self.springs is not None:
            extra = self.springs.torque(y[:2])
            tau = (tau[0] + extra[0], tau[1] + extra[1])
        force = 0j if self.foot_force is None else self.foot_force(t)
        psi_ddot, _ = oracle.forward_dynamics(self.leg, psi, psi_dot, tau, force)
        return [y[2], y[3], psi_ddot[0], psi_ddot[3]]


def simulate(
    leg: Leg,
    law: Law | None,
    path: Path,
    t_end: float,
    times: Array | None = None,
    *,
    foot_force: Callable[[float], complex] | None = None,
    springs: Springs | None = None,
    method: Literal["LSODA", "DOP853"] = "LSODA",
    rtol: float = 1e-12,
    atol: float = 1e-13,
) -> Motion:
    """Return the motion from rest in the pose of path(0), under error control.

    Args:
        leg: The leg.
        law: Motor torques; None: the motors are free.
        path: The target of the law, and where the foot starts.
        t_end: Length [s].
        times: Where the motion is wanted [s], in [0, t_end]; default every millisecond.
        foot_force: t [s] -> what the world does to the foot, x + 1j z [N].
        springs: Torsion springs beside the motors.
        method: LSODA; or DOP853, an explicit one-step method that shares nothing with it but is
            slowed tenfold by the servo's fast decay (kd / inertia is 2400 1/s in the classic leg).
        rtol: Of the integrator; LSODA at the defaults is within 3e-12 rad of DOP853 at 1e-10.
        atol: Of the integrator [rad, rad/s].

    Raises:
        ValueError: The path starts in the other assembly, the target leaves the workspace, or the
            motion opens the loop.
        RuntimeError: The integrator gave up, or crawls (as where B, C and D are in line).
    """
    start = oracle.pose(leg, complex(*path(0.0)[0]))
    if oracle.assembly_of(leg, start) != leg.assembly:
        raise ValueError(f"path(0) is in assembly {-leg.assembly}, the leg in {leg.assembly}")

    times = np.linspace(0.0, t_end, round(1000 * t_end) + 1) if times is None else times
    y0 = [start[0], start[3], 0.0, 0.0]
    enough = iter(range(round(100_000 * (1.0 + t_end))))  # DOP853 takes 65,000 a second
    chain = _Chain(leg, law, path, foot_force, springs, enough)
    ask = integrated if method == "LSODA" else _by_one_step
    return _recorded(chain, times, ask(chain.slope, y0, times, rtol, atol))


def integrated(
    slope: Slope, start: Sequence[float], times: Array, rtol: float, atol: float
) -> Array:
    """Return the states of a motion from t = 0, shape (N, n), by LSODA.

    `odeint` takes its steps, and interpolates between them, outside of Python: solve_ivp's LSODA,
    which is the same, spends as long on each step as a leg's slope takes.

    Args:
        slope: t [s], y -> dy/dt.
        start: y at t = 0, n numbers.
        times: Where the motion is wanted [s], growing from 0 or later.
        rtol: Relative error of a step.
        atol: Absolute error of a step.

    Raises:
        RuntimeError: The integrator gave up.
    """
    from scipy.integrate import ODEintWarning, odeint

    at = times if times[0] == 0.0 else np.concatenate([[0.0], times])
    with warnings.catch_warnings():
        warnings.simplefilter("error", ODEintWarning)
        try:
            states = odeint(
                *(slope, start, at),
                tfirst=True,
                rtol=rtol,
                atol=atol,
                tcrit=at[-1:],
                mxstep=1_000_000,
            )
        except ODEintWarning as error:
            raise RuntimeError(str(error)) from None
    return states[-len(times) :]


def _by_one_step(
    slope: Slope, start: Sequence[float], times: Array, rtol: float, atol: float
) -> Array:
    """Return what `integrated` does, by DOP853."""
    from scipy.integrate import solve_ivp

    span = (0.0, float(times[-1]))
    result = solve_ivp(slope, span, start, "DOP853", times, rtol=rtol, atol=atol)
    if not result.success:
        raise RuntimeError(result.message)
    return result.y.T


def _recorded(chain: _Chain, time: Array, states: Array) -> Motion:
    """Return everything a motion holds, from its states, shape (N, 4)."""
    leg = chain.leg
    springs = chain.springs
    psi = []
    psi_dot = []
    foot = []
    gap = []
    tau = []
    energy = []
    for t, y in zip(time.tolist(), states.tolist(), strict=True):
        q = oracle.closed(leg, y[0], y[1])
        w = knee_rates(leg, q, y[2], y[3])
        F = oracle.position(oracle.foot(leg, q))
        r = oracle.position(oracle.loop(leg, q))
        psi.append(q)
        psi_dot.append(w)
        foot.append((F.real, F.imag))
        gap.append((r.real, r.imag))
        tau.append(chain.motors(t, y))
        stored = 0.0 if springs is None else springs.energy(y[:2])
        energy.append(oracle.energy(leg, q, w) + stored)
    return Motion(
        time=time,
        theta=states[:, :2].copy(),
        theta_dot=states[:, 2:].copy(),
        psi=np.unwrap(np.array(psi), axis=0),
        psi_dot=np.array(psi_dot),
        foot=np.array(foot),
        tau=np.array(tau),
        energy=np.array(energy),
        gap=np.array(gap),
    )


def eased_ellipse(
    centre: tuple[float, float], radii: tuple[float, float], frequency: float, ramp: float
) -> Path:
    """Return an ellipse that starts at rest at its lowest point towards +x.

        x = cx + rx sin(w s),   z = cz - rz cos(w s),   w = 2 pi frequency
        ds/dt = 10 k^3 - 15 k^4 + 6 k^5,  k = t / T  up to t = T, the ramp;   s = t - T/2  after it

    Args:
        centre: (cx, cz) [m].
        radii: (rx, rz) [m].
        frequency: [Hz].
        ramp: T [s]; 0: in motion from the start.
    """
    cx, cz = centre
    rx, rz = radii
    w = 2.0 * math.pi * frequency
    T = ramp

    def path(t: float) -> tuple[Pair, Pair, Pair]:
        s = t - T / 2
        s1 = 1.0
        s2 = 0.0
        if t < T:
            k = t / T
            s = T * (5 * k**4 / 2 - 3 * k**5 + k**6)
            s1 = 10 * k**3 - 15 * k**4 + 6 * k**5
            s2 = (30 * k**2 - 60 * k**3 + 30 * k**4) / T
        sin = math.sin(w * s)
        cos = math.cos(w * s)
        w1 = w * s1
        w2 = w * s2
        v = (rx * cos * w1, rz * sin * w1)
        a = (rx * (cos * w2 - sin * w1**2), rz * (sin * w2 + cos * w1**2))
        return (cx + rx * sin, cz - rz * cos), v, a

    return path
