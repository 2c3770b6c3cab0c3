"""The foot positions at which B, C and D are in line, as coupler curves."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar, Mode
from fivebar_sim.workspace.coupler import cut, runs, trace
from fivebar_sim.workspace.four_bar import Complex, FourBar


def singular_pieces(leg: FiveBar, mode: Mode) -> list[Complex]:
    """Return the foot positions of a working mode's poses with B, C and D in line, or B = D.

    With L2 and L3 stretched or folded, A, B, D, E is a four-bar that carries the foot.

    Returns:
        Pieces of at least two points, in the complex plane of `extended`: origin A, real axis AE.
    """
    return [piece for sign in (1.0, -1.0) for piece in _pieces(leg, mode, sign)]


def _pieces(leg: FiveBar, mode: Mode, sign: float) -> list[Complex]:
    """Return the pieces of L2 and L3 stretched (sign +1) or folded (-1)."""
    # D from B along BC; a four-bar's coupler is positive, so a negative one is turned round.
    reach = leg.L2 + sign * leg.L3
    flip = -1.0 if reach < 0.0 else 1.0
    bar = FourBar(leg.L1, abs(reach), leg.L4, leg.L5, flip * complex(*leg.foot_offset))
    s_A, s_E = mode

    def side_A(q: Array) -> Array:  # AF x AB, in the frame of L1
        return -s_A * (bar.offset * np.exp(1j * q[..., 1])).imag

    def side_E(q: Array) -> Array:  # EC x ED
        B, D, _ = bar.joints(q)
        C = B + flip * leg.L2 * np.exp(1j * (q[..., 0] + q[..., 1]))
        return s_E * (np.conj(C - leg.L5) * (D - leg.L5)).imag

    slack = 1e-12 * leg.size
    pieces = []
    for q in trace(bar):
        for side in (side_A, side_E):
            q = cut(bar, q, side)
        dq = np.diff(q, axis=0)
        middle = bar.between(q[:-1], dq, np.full(len(dq), 0.5))
        own = (side_A(middle) > slack) & (side_E(middle) > slack * leg.size)
        pieces += [bar.joints(piece)[2] for piece in runs(q, own)]

    return pieces
