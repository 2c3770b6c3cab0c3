"""Which way a model's leg is bent: its working mode and assembly mode, from a pose that closes."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, GeometryError
from fivebar_sim.formats.incoming.flat import Plane, Posed
from fivebar_sim.formats.incoming.loop import CLOSING, Loop
from fivebar_sim.formats.incoming.source import Source
from fivebar_sim.formats.incoming.weigh import ends
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.planar import cross, wrap

ROUNDS = 60
"""Steps of Newton's method towards a closed pose."""

CLOSED = 1e-12
"""Gap of a closed loop, in leg sizes."""

AJAR = 0.01
"""Gap below which a pose counts as one that closes, in leg sizes."""

BENT = 1e-3
"""Sine of the angle between two links below which they count as in line."""


def angles(source: Source, loop: Loop, plane: Plane, pose: Array) -> Array:
    """Return (theta_A, theta_B, theta_E, theta_D) of a model in a pose [rad], (4,).

    Args:
        source: The model.
        loop: Its loop.
        plane: The leg's plane.
        pose: The pose, (nq,); the loop may be open.
    """
    posed = Posed(source, loop, pose)
    psi = {0: 0.0}
    for link in (1, 2, 3, 4):
        inner, outer = ends(posed, plane, link)
        psi[link] = float(np.arctan2(*(outer - inner)[::-1]))

    hinges = ((0, 0, 1), (1, 1, 2), (4, 0, 4), (3, 4, 3))
    turned = [psi[out] - psi[inn] + posed.bent(plane, k, inn) for k, inn, out in hinges]
    return wrap(np.array(turned))


def settle(source: Source, loop: Loop, plane: Plane, leg: FiveBar) -> tuple[FiveBar, str | None]:
    """Return a leg in the working mode and assembly mode of its source, and a doubt.

    Args:
        source: The model.
        loop: Its loop.
        plane: The leg's plane.
        leg: The leg, in any mode.

    Raises:
        ConfigError: No pose closes the loop.
    """
    for pose, doubt in _tries(source, loop, plane, leg):
        q = _closed(leg, angles(source, loop, plane, pose))
        if q is None or _in_line(leg, q):
            continue
        found = kinematics.branch(leg, kinematics.chain_points(leg, q))
        mode = (int(found.s_A), int(found.s_E))
        return dataclasses.replace(leg, mode=mode, assembly=int(found.assembly)), doubt

    usual = sorted(MODES, key=lambda mode: mode != FiveBar.mode)
    for mode, assembly in itertools.product(usual, (-1, 1)):
        candidate = dataclasses.replace(leg, mode=mode, assembly=assembly)
        try:
            kinematics.home(candidate)
        except GeometryError:
            continue
        return candidate, (
            f"links are in line in every pose of the file: the working mode {mode} and the "
            f"assembly mode {assembly} are a guess"
        )
    raise ConfigError(f"{source.path}: no pose closes the loop")


def _tries(
    source: Source, loop: Loop, plane: Plane, leg: FiveBar
) -> Iterator[tuple[Array, str | None]]:
    """Yield poses next to which the loop may close, the best first, with what to doubt of them."""
    for pose in source.poses:
        if _gap(leg, angles(source, loop, plane, pose)) < AJAR * leg.size:
            yield pose, None

    model = source.model
    middle = source.poses[-1].copy()
    guided = [k for k in loop.hinges if k != CLOSING and model.jnt_limited[k]]
    for joint in guided:
        middle[model.jnt_qposadr[joint]] = model.jnt_range[joint].mean()
    # The knees' ranges tell which way they bend; those of motors do not.
    if set(guided) - {loop.hinges[0], loop.hinges[4]}:
        yield middle, None
    for pose in source.poses:
        yield pose, "no pose of the file closes the loop: the modes are those of the next that does"


def _gap(leg: FiveBar, q: Array) -> float:
    """Return the gap of the loop [m]."""
    points = kinematics.chain_points(leg, q)
    return float(np.hypot(*(points.C_left - points.C_right)))


def _closed(leg: FiveBar, q: Array) -> Array | None:
    """Return the closed pose next to a pose, by the least turns of all joints; None if none is."""
    q = q.copy()
    for _ in range(ROUNDS):
        points = kinematics.chain_points(leg, q)
        gap = points.C_left - points.C_right
        if np.hypot(*gap) <= CLOSED * leg.size:
            return q

        A, E = kinematics.bases(leg)
        arms = [points.C_left - A, points.C_left - points.B]
        arms += [E - points.C_right, points.D - points.C_right]
        slopes = np.array([[-arm[1] for arm in arms], [arm[0] for arm in arms]])
        q -= np.linalg.lstsq(slopes, gap, rcond=None)[0]
    return None


def _in_line(leg: FiveBar, q: Array) -> bool:
    """Return whether two links that meet at B, C or D are in line."""
    p = kinematics.chain_points(leg, q)
    A, E = kinematics.bases(leg)
    pairs = ((p.B - A, p.F - p.B), (p.D - E, p.C_right - p.D), (p.D - p.B, p.C_left - p.B))
    sines = [
        abs(float(cross(one, other))) / max(float(np.hypot(*one) * np.hypot(*other)), 1e-300)
        for one, other in pairs
    ]
    return min(sines) < BENT
