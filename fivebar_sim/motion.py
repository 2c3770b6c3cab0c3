"""The planned motion: the foot path at every step, and the joint angles that follow it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics, units, workspace
from fivebar_sim.arrays import Array, Bools, at, largest_of_columns
from fivebar_sim.errors import ArgumentError, SingularError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.stops import (
    C_STOP,
    MOTOR_RANGE,
    angle_at_C,
    in_range,
    in_turn,
    stops_at_C,
)
from fivebar_sim.paths import FootPath, Sample

KNEE_STOP = C_STOP
"""Least angle of a knee from straight or folded where targets are projected [rad], the same as for
the angle at C. At the edge itself a side chain is in line, and the joints' rates are infinite."""

FASTEST_SLIDE = 10.0
"""How many times faster than the path's targets their projections may move."""


class Motion(NamedTuple):
    """A planned motion at the times t_k = k h, k = 0..N; angles are continuous in time.

    Attributes:
        time: [s], (N + 1,).
        foot: [m], (N + 1, 2); foot_dot and foot_ddot are its rates.
        q: (theta_A, theta_B, theta_E, theta_D) [rad], (N + 1, 4); q_dot and q_ddot are its rates.
        force: Expected force of the world on the foot [N], (N + 1, 2).
        payload: Point mass that the foot carries [kg].
    """

    time: Array
    foot: Array
    foot_dot: Array
    foot_ddot: Array
    q: Array
    q_dot: Array
    q_ddot: Array
    force: Array
    payload: float

    @property
    def timestep(self) -> float:
        """The time h between two rows [s]."""
        return float(self.time[1])


def plan(
    leg: FiveBar,
    path: FootPath,
    steps: int,
    timestep: float,
    *,
    force: Array | None = None,
    payload: float = 0.0,
) -> Motion:
    """Return the motion of a leg along a path, from the analytic inverse kinematics.

    With `outside = "nearest"`, targets out of reach, or within `edge_margin` of the workspace's
    edge, are projected to the nearest point inside that margin, so that the foot slides along the
    edge. If any target is projected, the rates of foot and joints come from `rates` instead of
    from the path.

    Args:
        leg: The leg; it moves in its own working mode and assembly mode.
        path: The foot's path.
        steps: N.
        timestep: h [s].
        force: Expected force of the world on the foot [N], (N + 1, 2); None: zero.
        payload: Point mass that the foot carries [kg].

    Raises:
        UnreachableError: The path leaves the workspace, needs the other assembly mode, or drives
            a joint past its stop; or a projected target jumps. The message says when and where,
            and for a path out of the workspace how far out. `.index` is the step.
        SingularError: A side chain is straight or folded somewhere on the path; says when and
            where, too.
        ArgumentError: Some target needs a projection and the leg has L6 > 0, for which no margin
            is defined.
    """
    time: Array = np.arange(steps + 1, dtype=np.float64) * timestep
    wanted = path.at(time)
    # Compared by identity below: only projected targets lose their analytic rates.
    foot = _project(leg, wanted, time) if path.outside == "nearest" else wanted
    _check_reach(leg, foot.position, time)
    q, q_dot, q_ddot = _joint_motion(leg, foot, time)
    rest = kinematics.home(leg)
    # Angles come in (-pi, pi]; a motor that goes round must not jump by a turn.
    q = _continuous(leg, rest, q)
    _check_stops(leg, rest, foot.position, time, q)

    if foot is not wanted:
        q_dot, q_ddot = rates(q, timestep)

    force = np.zeros_like(foot.position) if force is None else force
    return Motion(time, *foot, q, q_dot, q_ddot, force, payload)


def poses(leg: FiveBar, foot: Array) -> Array:
    """Return the poses in which a leg rests with its foot at some points, in its own branch.

    Each is the pose that `plan` begins with, of a path that stays at the point.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (n, 2).

    Returns:
        (theta_A, theta_B, theta_E, theta_D) [rad], (n, 4).

    Raises:
        UnreachableError: A point that is out of reach, in the other assembly mode, or beyond a
            joint's stop; `.index` is its row.
        SingularError: Where a side chain is straight or folded.
    """
    rest = kinematics.home(leg)
    still = np.zeros_like(foot)
    at_rest = np.zeros(len(foot))  # every pose is one at t = 0
    _check_reach(leg, foot, at_rest)
    angles = _joint_motion(leg, Sample(foot, still, still), at_rest).q
    q = in_turn(leg, rest, angles, angles)
    q = in_range(q, q, q)
    _check_stops(leg, rest, foot, at_rest, q)
    return q


def edge_margin(leg: FiveBar) -> float:
    """Return the distance that projected targets keep from the edge of the workspace [m].

    It keeps every knee at least g = KNEE_STOP away from straight and folded. It is the largest,
    over both sides, with l and m the links at the knee, of

        l + m - sqrt(l^2 + m^2 + 2 l m cos g)   and   sqrt(l^2 + m^2 - 2 l m cos g) - |l - m|

    For l = m only the first counts: such a side folds onto its motor's axis, inside the workspace.

    Args:
        leg: The leg; L6 = 0.
    """
    margins: list[float] = []
    for near, far in ((leg.L1, leg.L2), (leg.L4, leg.L3)):
        square = near**2 + far**2
        product = 2.0 * near * far * np.cos(KNEE_STOP)
        margins.append(near + far - np.sqrt(square + product))
        if near != far:
            margins.append(np.sqrt(square - product) - abs(near - far))
    return float(max(margins))


def rates(values: Array, timestep: float) -> tuple[Array, Array]:
    """Return first and second time derivatives of sampled values by central differences.

        v_k = (p_k+1 - p_k-1) / 2h,   a_k = (p_k+1 - 2 p_k + p_k-1) / h^2

    At both ends the values are extrapolated linearly: one-sided differences, and a = 0.

    Args:
        values: p at steps of h, (N + 1, n).
        timestep: h [s].
    """
    # One extrapolated row at either end makes the central difference one-sided there.
    before = 2.0 * values[:1] - values[1:2]
    after = 2.0 * values[-1:] - values[-2:-1]
    p = np.concatenate([before, values, after])
    return (p[2:] - p[:-2]) / (2.0 * timestep), np.diff(p, 2, axis=0) / timestep**2


def _project(leg: FiveBar, wanted: Sample, time: Array) -> Sample:
    """Return the targets with those out of reach replaced; the same object if there are none."""
    targets = wanted.position
    if leg.L6 > 0.0:
        # Reachable targets need no projection, and so no margin.
        if workspace.reachable(leg, targets, mode=leg.mode).all():
            return wanted
        raise ArgumentError(f'outside = "nearest" needs a leg with L6 = 0, got {leg.L6:g} m')

    foot = workspace.nearest(leg, targets, margin=edge_margin(leg), mode=leg.mode)
    if np.array_equal(foot, targets):
        return wanted

    moved = _lengths(np.diff(foot, axis=0))
    # A jump from one edge to another is not a slide: the motors could not follow it.
    fastest = _lengths(np.diff(targets, axis=0)).max()
    jumps = np.concatenate([[False], moved > FASTEST_SLIDE * fastest])
    what = f"moves the nearest reachable point more than {FASTEST_SLIDE:g} times as fast as itself"
    _refuse(jumps, foot, time, what)

    return Sample(foot, *rates(foot, float(time[1])))


def _lengths(vectors: Array) -> Array:
    return np.hypot(vectors[:, 0], vectors[:, 1])


def _joint_motion(leg: FiveBar, foot: Sample, time: Array) -> kinematics.JointMotion:
    """Return the joints' motion along a path; see `kinematics.joint_motion`."""
    try:
        return kinematics.joint_motion(leg, *foot)
    except SingularError as error:
        raise singular(error, foot.position, time) from None


def singular(error: SingularError, foot: Array, time: Array) -> SingularError:
    """Return the error of a singular pose with when it is, and where the foot is.

    Args:
        error: The error of a batch of steps.
        foot: F at these steps [m], (N, 2).
        time: Their times [s], (N,).
    """
    # A user's controller may raise it with an index of whatever shape, or with none.
    if len(error.index) != 1 or not 0 <= error.index[0] < len(time):
        return error
    (k,) = error.index
    why = str(error).removesuffix(at(error.index)).rpartition("singular: ")[2]
    return SingularError(
        f"path comes to a singular pose at t = {time[k]:g} s, foot at {_place(foot[k])}: {why}",
        error.index,
    )


def _continuous(leg: FiveBar, rest: Array, q: Array) -> Array:
    """Return angles without jumps by whole turns, starting near the rest pose.

    The knees stay within half a turn in any working mode; the motors may go round.
    """
    q = np.unwrap(q, axis=0)
    q = in_turn(leg, rest, q, q[0])
    return in_range(q, -largest_of_columns(-q), largest_of_columns(q))


def _check_stops(leg: FiveBar, rest: Array, foot: Array, time: Array, q: Array) -> None:
    low, high = stops_at_C(rest)
    angle = angle_at_C(q)
    # A stop lies C_STOP before a singular pose: beyond that pose the assembly mode is the other.
    flipped = (angle < low - C_STOP) | (angle > high + C_STOP)
    _refuse(flipped, foot, time, f"needs the other assembly mode; the leg's is {leg.assembly:+d}")
    stopped = (angle < low) | (angle > high)
    limits = f"{np.degrees(C_STOP):.0f} and {180 - np.degrees(C_STOP):.0f} deg"
    _refuse(stopped, foot, time, f"passes the stops of the angle at C, {limits}")
    for name, theta in (("theta_A", q[:, 0]), ("theta_E", q[:, 2])):
        wound = np.abs(theta) > MOTOR_RANGE
        _refuse(wound, foot, time, f"winds {name} beyond its range of +-360 deg")


def _refuse(bad: Bools, foot: Array, time: Array, what: str) -> None:
    if bad.any():
        k = int(np.argmax(bad))
        raise UnreachableError(
            f"path {what}: at t = {time[k]:g} s, foot at {_place(foot[k])}", (k,)
        )


def _check_reach(leg: FiveBar, foot: Array, time: Array) -> None:
    """Raise if a path leaves the workspace, with the nearest reachable point.

    Raises:
        UnreachableError: The path leaves the workspace; `.index` is the step.
    """
    try:
        kinematics.inverse(leg, foot)
    except UnreachableError as error:
        raise _out_of_reach(leg, foot, time, error.index) from None


def _out_of_reach(
    leg: FiveBar, foot: Array, time: Array, index: tuple[int, ...]
) -> UnreachableError:
    """Return the error of a path that leaves the workspace, with the nearest reachable point."""
    (k,) = index
    lost = f"path out of reach at t = {time[k]:g} s: the foot at {_place(foot[k])}"
    nearest = workspace.nearest(leg, foot[k], mode=leg.mode)
    out = float(np.hypot(*(foot[k] - nearest)))
    # A hundred legs away nobody means metres: 0.08 m read as 80.
    far = np.hypot(*foot[k]) > 100.0 * leg.size
    hint = "; positions are in metres: were these in mm?" if far else ""
    return UnreachableError(
        f"{lost} is {units.text(1e3 * out, 'mm', 3)} out; the nearest reachable point is "
        f"{_place(nearest)}{hint}",
        index,
    )


def _place(point: Array) -> str:
    """Return (x, z) in the unit that fits the larger of both."""
    largest = float(np.abs(point).max())
    # A point at the hip has no size of its own.
    number, unit = units.fitting(max(1e3 * largest, 1.0), "mm")
    x, z = (point * number / max(largest, 1e-3)).tolist()
    return f"({x:.2f}, {z:.2f}) {unit}"
