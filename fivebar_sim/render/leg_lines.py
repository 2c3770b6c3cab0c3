"""The lines of a leg: both motors' chains, and the edge of what it reaches."""

from __future__ import annotations

import numpy as np

from fivebar_sim import kinematics, motion, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar

COARSE = 0.004
"""Finest detail of an edge, as a part of the leg's size."""


def edges(leg: FiveBar) -> list[Array]:
    """Return the edge of what a leg reaches in its own mode [m], (n, 2) each."""
    try:
        curves = workspace.boundary(leg, mode=leg.mode)
    # A leg whose sides never meet reaches nothing: the page still shows the others.
    except FiveBarError:
        return []
    return [thinned(curve, COARSE * leg.size) for curve in curves]


def chains(leg: FiveBar, foot: Array | None) -> dict[str, Array]:
    """Return the points of both motors' chains [m], (n, 2) each.

    Args:
        leg: The leg.
        foot: Where its foot is [m]; at rest (None), as where it cannot be.
    """
    q = kinematics.home(leg)
    if foot is not None:
        try:
            q = motion.poses(leg, foot[None])[0]
        # Beyond a stop, which a search may allow: at rest then.
        except FiveBarError:
            pass
    joints = kinematics.chain_points(leg, q)
    A, E = kinematics.bases(leg)
    left = [A, joints.B, joints.C_left]
    if leg.L6 > 0.0:
        left.append(joints.F)
    return {"A": np.array(left), "E": np.array([E, joints.D, joints.C_right])}


def thinned(curve: Array, tolerance: float) -> Array:
    """Return a curve with fewer points, none of which is farther from it than a tolerance.

    Args:
        curve: (n, 2).
        tolerance: [m].
    """
    kept = [0, len(curve) - 1]
    pending = [(0, len(curve) - 1)]
    # By Douglas and Peucker; not recursive, since curves may have thousands of points.
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        inner = curve[first + 1 : last]
        along = curve[last] - curve[first]
        length = float(np.hypot(*along))
        off = inner - curve[first]
        away = np.hypot(*off.T) if length == 0.0 else np.abs(off @ [-along[1], along[0]]) / length
        worst = int(np.argmax(away))
        if away[worst] > tolerance:
            middle = first + 1 + worst
            kept.append(middle)
            pending += [(first, middle), (middle, last)]
    return curve[sorted(set(kept))]
