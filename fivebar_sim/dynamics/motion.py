"""Motions of the closed chain: a fixed step for thousands of legs, error control for one.

The state is (theta, theta_dot); knees and C follow from closure in every evaluation, so the loop
cannot drift open.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, as_pairs, at, broadcast, finite, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.chain import Chain, Pose
from fivebar_sim.dynamics.plane import Vector, split
from fivebar_sim.errors import (
    ArgumentError,
    DivergedError,
    ExtraError,
    LoopOpenError,
    SingularError,
)
from fivebar_sim.geometry import FiveBar

if TYPE_CHECKING:
    from scipy.integrate import DOP853

Law = Callable[[float, Array, Array], ArrayLike]
"""(t [s], theta, theta_dot) -> torques (tau_A, tau_E) [N m] or forces (x, z) [N]; arrays have the
shape (..., 2) of the simulated legs, and the result broadcasts with them. A law must not keep
state: it is called several times a step."""


TURN_MAX = 0.5
"""Largest turn of a motor in a fixed step [rad]. The method loses its order at far less, and the
first wrong step beside a singular pose is that large."""


class Motion(NamedTuple):
    """A simulated motion.

    Attributes:
        time: [s], (N,).
        theta: (theta_A, theta_E) [rad], (N, ..., 2).
        theta_dot: [rad/s], (N, ..., 2).
    """

    time: Array
    theta: Array
    theta_dot: Array


def simulate(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    timestep: float,
    steps: int,
    torque: Law | None = None,
    *,
    foot_force: Law | None = None,
    every: int = 1,
    assembly: int | None = None,
    payload: float = 0.0,
) -> Motion:
    """Return the motion of any number of legs by the classic Runge-Kutta method of order 4.

    The error falls with timestep^4 once the step resolves the fastest motion. It is not estimated,
    and near a singular pose some steps may be wrong before an error is raised: watch the energy.

    Args:
        leg: The leg; all states are of this one.
        theta: (theta_A, theta_E) at t = 0 [rad], (..., 2).
        theta_dot: At t = 0 [rad/s], broadcasts with theta.
        timestep: h [s].
        steps: Number of steps.
        torque: Law of the motor torques; None: the motors are free.
        foot_force: Law of the force of the world on the foot; None: no force.
        every: Number of steps between two rows of the result.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        The motion at t = 0, every h, 2 every h, ...

    Raises:
        LoopOpenError: The links do not meet at t = 0.
        SingularError: B, C and D are in line at t = 0.
        DivergedError: A leg's loop opens or it becomes singular, a motor turns by more than
            `TURN_MAX` in a step, or a law returns NaN; `.time` is the start of that step.
        ArgumentError: As `inverse`; or a timestep or a number of steps that is not positive, or a
            law whose result has the wrong shape.
    """
    chain = Chain.of(leg, assembly, payload)
    return simulate_chain(chain, theta, theta_dot, timestep, steps, torque, foot_force, every)


def simulate_chain(
    chain: Chain,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    timestep: float,
    steps: int,
    torque: Law | None,
    foot_force: Law | None,
    every: int,
) -> Motion:
    """Return what `simulate` returns, given a leg's constants."""
    check_number("timestep", timestep, "s", low=0.0, strict=True)
    for name, count in (("steps", steps), ("every", every)):
        if not isinstance(count, (int, np.integer)) or count < 1:
            raise ArgumentError(f"{name} must be a whole number of at least 1, got {count!r}")
    q, w = _start(theta, theta_dot)
    plant = _Plant(chain, torque, foot_force)
    plant.chain.check_pose(q[..., 0], q[..., 1])
    return _runge_kutta(plant, q, w, timestep, range(0, steps + 1, every), steps)


def integrate(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    times: ArrayLike,
    torque: Law | None = None,
    *,
    foot_force: Law | None = None,
    rtol: float = 1e-12,
    atol: float = 1e-13,
    assembly: int | None = None,
    payload: float = 0.0,
) -> Motion:
    """Return the motion of one leg to high precision: DOP853, order 8 under error control.

    The method is SciPy's, which nothing else of the package needs: install the extra `precise`.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) at the first time [rad], (2,).
        theta_dot: At the first time [rad/s], (2,).
        times: Times of the rows of the result, increasing [s], (N,); between two steps of the
            integrator the motion is interpolated with order 7.
        torque: Law of the motor torques, smooth in all arguments; None: the motors are free.
        foot_force: Law of the force of the world on the foot, as smooth; None: no force.
        rtol: Relative error of a step, at least 2.3e-14.
        atol: Absolute error of a step [rad, rad/s].
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Raises:
        LoopOpenError: The links do not meet at times[0].
        SingularError: B, C and D are in line at times[0].
        DivergedError: The motion runs into a singular pose, or a law returns NaN; `.time` is the
            last time that the integrator reached.
        ArgumentError: As `simulate`; or more than one leg, or times that do not increase.
        ExtraError: SciPy is not installed.
    """
    chain = Chain.of(leg, assembly, payload)
    return integrate_chain(chain, theta, theta_dot, times, torque, foot_force, rtol, atol)


def integrate_chain(
    chain: Chain,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    times: ArrayLike,
    torque: Law | None,
    foot_force: Law | None,
    rtol: float,
    atol: float,
) -> Motion:
    """Return what `integrate` returns, given a leg's constants."""
    q, w = _start(theta, theta_dot)
    if q.shape != (2,):
        raise ArgumentError(f"theta must be of one leg, (2,), got {q.shape}; see simulate")

    t = finite(np.asarray(times, dtype=np.float64), "times")
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0.0):
        raise ArgumentError("times must rise, at least two of them, shape (N,)")

    # DOP853 itself raises a smaller rtol to this, with a warning.
    check_number("rtol", rtol, "", low=100 * np.finfo(float).eps, high=1.0)
    check_number("atol", atol, "rad", low=0.0, high=1.0)
    plant = _Plant(chain, torque, foot_force)
    plant.chain.check_pose(q[0], q[1])
    states = _dop853(plant, np.concatenate([q, w]), t, rtol, atol)

    return Motion(t.copy(), states[:, :2].copy(), states[:, 2:].copy())


class _UnfitError(Exception):
    """A law whose result is not finite, or a step that is too long or cannot be short enough."""


@dataclass(frozen=True, slots=True)
class _Plant:
    """A leg with the laws of its torques and its foot force."""

    chain: Chain
    torque: Law | None
    foot_force: Law | None

    def accelerations(self, t: float, q: Array, w: Array) -> Vector:
        """Return the two motor accelerations [rad/s^2]."""
        p = self.chain.pose(*split(q))
        return self.driven(t, q, w, p, split(w))

    def driven(self, t: float, q: Array, w: Array, p: Pose, rates: Vector) -> Vector:
        """Return the accelerations in a pose, whose rates are also given one by one."""
        tau = _evaluate(self.torque, "torque", t, q, w) or (0.0, 0.0)
        force = _evaluate(self.foot_force, "foot_force", t, q, w)
        try:
            return self.chain.accelerations(p, rates, tau, force)
        except ZeroDivisionError:  # plain numbers raise it, arrays become infinite
            raise _UnfitError("the links are too light: their mass matrix is 0") from None

    def slope(self, t: float, y: Array) -> Array:
        """Return dy/dt of one leg's y = (theta, theta_dot); NaN where the loop is open or singular.

        The error control then rejects a trial step beyond a fold of the loop and shortens it.
        """
        theta_A, theta_E, w_A, w_E = y.tolist()
        if not (math.isfinite(theta_A) and math.isfinite(theta_E)):
            return np.full(4, np.nan)

        try:
            p = self.chain.pose(theta_A, theta_E)
            alpha = self.driven(t, y[:2], y[2:], p, (w_A, w_E))
        except (LoopOpenError, SingularError):
            return np.full(4, np.nan)
        return np.array([w_A, w_E, *alpha])


def _evaluate(law: Law | None, name: str, t: float, q: Array, w: Array) -> Vector | None:
    """Return both coordinates of a law's result, or None without a law."""
    if law is None:
        return None
    value = as_pairs(law(t, q, w), name)
    if not np.isfinite(value).all():
        raise _UnfitError(f"{name} is not finite")
    if value.shape != q.shape:
        value = _broadcast(value, name, q.shape)
    return split(value)


def _broadcast(value: Array, name: str, shape: tuple[int, ...]) -> Array:
    """Return a law's result broadcast to the shape of the legs."""
    try:
        return np.broadcast_to(value, shape)
    except ValueError:
        raise ArgumentError(f"{name} must give shape {shape}, got {value.shape}") from None


def _runge_kutta(plant: _Plant, q: Array, w: Array, h: float, rows: range, steps: int) -> Motion:
    """Return the motion after each number of steps in rows."""
    motion = Motion(h * np.array(rows), *np.empty((2, len(rows), *q.shape)))
    motion.theta[0] = q
    motion.theta_dot[0] = w
    for k in range(steps):
        try:
            # An overflow leaves inf or NaN, which `_check_turn` rejects.
            with np.errstate(over="ignore", invalid="ignore"):
                after, w = _step(plant, k * h, q, w, h)
            _check_turn(after - q)
        except (LoopOpenError, SingularError, _UnfitError) as error:
            raise _diverged(k * h, str(error)) from error
        q = after
        # Membership in a range is arithmetic, not a search.
        if k + 1 in rows:
            row = (k + 1) // rows.step
            motion.theta[row] = q
            motion.theta_dot[row] = w

    return motion


def _check_turn(turn: Array) -> None:
    """Raise unless every motor turned by less than `TURN_MAX` in a step."""
    # Written so that NaN is too large as well.
    lost = np.logical_not((np.abs(turn) < TURN_MAX).all(axis=-1))
    if lost.any():
        raise _UnfitError(
            f"a motor must turn by less than {TURN_MAX:g} rad in a step{at(first_index(lost))}"
        )


def _step(plant: _Plant, t: float, q: Array, w: Array, h: float) -> tuple[Array, Array]:
    """Return the state a step later.

        k1 = f(t, y),  k2 = f(t + h/2, y + h/2 k1),  k3 = f(t + h/2, y + h/2 k2)
        k4 = f(t + h, y + h k3),   y + h/6 (k1 + 2 k2 + 2 k3 + k4)

    of y = (q, w), f = (w, alpha).
    """
    # q needs no slopes of its own: its rate in each stage is the stage's w.
    half = 0.5 * h
    w1 = w
    alpha1 = _stack_accelerations(plant, t, q, w)
    w2 = w + half * alpha1
    alpha2 = _stack_accelerations(plant, t + half, q + half * w1, w2)
    w3 = w + half * alpha2
    alpha3 = _stack_accelerations(plant, t + half, q + half * w2, w3)
    w4 = w + h * alpha3
    alpha4 = _stack_accelerations(plant, t + h, q + h * w3, w4)
    q = q + h / 6.0 * (w1 + 2.0 * (w2 + w3) + w4)
    return q, w + h / 6.0 * (alpha1 + 2.0 * (alpha2 + alpha3) + alpha4)


def _stack_accelerations(plant: _Plant, t: float, q: Array, w: Array) -> Array:
    """Return the accelerations of all legs, (..., 2)."""
    alpha = plant.accelerations(t, q, w)
    return np.array(alpha) if q.ndim == 1 else np.stack(alpha, axis=-1)


def _dop853(plant: _Plant, y: Array, times: Array, rtol: float, atol: float) -> Array:
    """Return the states of one leg at the given times, (N, 4)."""
    solver_of = _find_dop853()
    states = np.empty((len(times), 4))
    row = 1
    reached = float(times[0])
    states[0] = y

    try:
        solver = solver_of(plant.slope, times[0], y, times[-1], rtol=rtol, atol=atol)
        while row < len(times):
            solver.step()
            reached = float(solver.t)
            if solver.status == "failed":
                raise _UnfitError("no step is short enough: are B, C and D in line?")
            inside = int(np.searchsorted(times, reached, side="right"))
            if inside > row:
                # Only for steps with rows in them: the interpolant costs three evaluations.
                states[row:inside] = solver.dense_output()(times[row:inside]).T
                row = inside
    except _UnfitError as error:
        raise _diverged(reached, str(error)) from error
    return states


def _find_dop853() -> type[DOP853]:
    """Return SciPy's integrator, slow to import; ExtraError without SciPy."""
    try:
        from scipy.integrate import DOP853
    except ImportError as error:
        raise ExtraError(
            f"integrate needs SciPy ({error}): pip install 'fivebar-sim[precise]'"
        ) from None
    return DOP853


def _diverged(time: float, why: str) -> DivergedError:
    return DivergedError(f"the motion breaks down at t = {time:g} s: {why}", time)


def _start(theta: ArrayLike, theta_dot: ArrayLike) -> tuple[Array, Array]:
    """Return the state as finite arrays; ArgumentError if it is not finite."""
    q, w = broadcast(
        theta=finite(as_pairs(theta, "theta"), "theta"),
        theta_dot=finite(as_pairs(theta_dot, "theta_dot"), "theta_dot"),
    )
    return q, w
