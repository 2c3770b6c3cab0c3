"""The rest pose of a leg, as far from every singularity as possible."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import GeometryError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import bases, branch, chain_points
from fivebar_sim.kinematics.planar import angle_between, cross, dot
from fivebar_sim.kinematics.reach import points_at, solve
from fivebar_sim.kinematics.stops import in_turn

GRID = 121
"""Number of foot positions tried along x and along z."""


def home(leg: FiveBar) -> Array:
    """Return the rest pose: the foot straight below or above O, far from every singularity.

    Of the foot positions on x = 0 it takes the one that maximises the least sine of the angles at B
    (between AB and BF), D and C; of equal ones the lowest. If no foot position on x = 0 is on the
    leg's branch, it searches the whole plane.

    Args:
        leg: The leg.

    Returns:
        (theta_A, theta_B, theta_E, theta_D) [rad], each in (-pi, pi], (4,).

    Raises:
        GeometryError: No pose has both the leg's working mode and its assembly mode.
    """
    # A copy, since callers may write into it.
    return _home(leg).copy()


# A run, a plan and a model each ask for the rest pose, and most of the time of the same few legs.
@lru_cache(maxsize=256)
def _home(leg: FiveBar) -> Array:
    """Return what `home` does."""
    for feet in _grids(leg):
        pose = _best(leg, feet)
        if pose is not None:
            return pose
    raise GeometryError(
        f"no pose has working mode {leg.mode} and assembly mode {leg.assembly} at once"
    )


def hanging(leg: FiveBar) -> Array:
    """Return the rest pose of a leg that stands: `home`, over feet below the hip if it is not.

    Args:
        leg: The leg.

    Returns:
        (theta_A, theta_B, theta_E, theta_D) [rad], in the turns of `home`, (4,); `home` itself
        where the leg does not reach below its hip.

    Raises:
        GeometryError: As `home`.
    """
    rest = home(leg)
    if chain_points(leg, rest).F[1] < 0.0:
        return rest
    return _hanging(leg).copy()


@lru_cache(maxsize=256)
def _hanging(leg: FiveBar) -> Array:
    """Return what `hanging` does, of a leg whose rest pose is above its hip."""
    rest = _home(leg)
    for feet in _grids(leg):
        pose = _best(leg, feet[feet[:, 1] < 0.0])
        if pose is not None:
            return in_turn(leg, rest, pose[None], pose)[0]
    return rest


def _grids(leg: FiveBar) -> tuple[Array, Array]:
    """Return the foot positions that are tried: a column through O, then the whole plane."""
    line = np.linspace(-1.0, 1.0, GRID) * (leg.size + leg.L5)
    column = np.stack([np.zeros(GRID), line], axis=-1)
    plane = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    return column, plane


def _best(leg: FiveBar, foot: Array) -> Array | None:
    """Return the best pose (4,) of some foot positions (n, 2), or None if none is on the branch."""
    theta, ok = solve(leg, foot, leg.mode)
    found = ok.all(axis=-1)
    p = points_at(leg, foot[found], theta[found])
    A, E = bases(leg)
    AB = p.B - A
    BC = p.C_left - p.B
    BF = p.F - p.B
    ED = p.D - E
    DC = p.C_right - p.D
    # A pose is as far from singular as its worst angle; the other assembly mode is not an option.
    sines = np.abs([_sine(AB, BF), _sine(ED, DC), _sine(BC, DC)]).min(axis=0)
    sines[branch(leg, p).assembly != leg.assembly] = 0.0
    if not sines.size or not sines.max() > 0.0:
        return None

    # Rounded, since equally good positions differ by rounding errors, which must not choose.
    best = int(np.argmax(sines.round(9)))
    theta_A, theta_E = theta[found][best]
    theta_B = angle_between(AB[best], BC[best])
    theta_D = angle_between(ED[best], DC[best])

    return np.array([theta_A, theta_B, theta_E, theta_D])


def _sine(a: Array, b: Array) -> Array:
    return cross(a, b) / np.sqrt(dot(a, a) * dot(b, b))
