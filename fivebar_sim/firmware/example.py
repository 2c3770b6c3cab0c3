"""The gait table of the example sketch: a short trot about the leg's rest pose."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import GeometryError
from fivebar_sim.firmware.elementary import Real
from fivebar_sim.firmware.kinematics import inverse
from fivebar_sim.firmware.leg import Leg, of
from fivebar_sim.firmware.servo import FirmwareServo
from fivebar_sim.firmware.source import number
from fivebar_sim.firmware.status import Status
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import chain_points
from fivebar_sim.kinematics.home import hanging
from fivebar_sim.paths.gait import Gait

ROWS = 50
RATE = 50.0
"""Rows of the table, and rows a second [Hz]: a hobby servo takes one pulse in 20 ms."""

STRIDE = 0.3
"""Length of the longest stance line that is tried, as a part of the leg's size."""

PULSES = (500, 2500)
"""Pulses of a hobby servo at 0 and at 180 deg [us]."""

HALVINGS = 8


def header(leg: FiveBar) -> str:
    """Return gait.h: the table as C, in both arithmetics, and servos that it fits.

    Raises:
        GeometryError: The leg cannot take even a small step about its rest pose.
    """
    path, rows = table(of(leg, np.float32), leg)
    exact = _angles(of(leg, np.float64), leg, path)
    assert exact is not None, "double arithmetic reaches what float does"
    rows_of_double = "".join(_row(row) for row in exact)
    rows_of_float = "".join(_row(row) for row in rows)
    servos = "".join(
        f"\nstatic const fivebar_servo SERVO_{side} = {{\n"
        f"    {_constant(servo.offset)}, {servo.direction}, {_constant(servo.low)}, "
        f"{_constant(servo.high)}, {servo.first}, {servo.last}}};\n"
        for side, servo in zip("AE", servos_of(rows), strict=True)
    )

    return (
        "/* A gait of one second, one row of (theta_A, theta_E) [rad] every 20 ms. */\n"
        "#include <fivebar_leg.h>\n\n"
        f"static const fivebar_real ROWS[{ROWS}][2] = {{\n"
        f"#ifdef FIVEBAR_DOUBLE\n{rows_of_double}#else\n{rows_of_float}#endif\n}};\n\n"
        f"static const fivebar_gait GAIT = {{ROWS, {ROWS}, {_constant(RATE)}, 1}};\n\n"
        "/* Hobby servos of 180 deg whose middle is that of the gait: turn the horns to fit. */"
        f"{servos}"
    )


def servos_of(rows: Real) -> tuple[FirmwareServo, FirmwareServo]:
    """Return hobby servos whose mid-range is the middle of a gait's angles (n, 2)."""
    middle = 0.5 * (rows.min(axis=0).astype(float) + rows.max(axis=0).astype(float))
    A, E = (
        FirmwareServo(round(0.5 * np.pi - angle, 4), 1, 0.0, np.pi, *PULSES)
        for angle in middle.tolist()
    )
    return A, E


def table(firmware: Leg, leg: FiveBar) -> tuple[Array, Real]:
    """Return the feet of the longest gait that fits [m], and its angles [rad], both (ROWS, 2)."""
    x, z = chain_points(leg, hanging(leg)).F.tolist()
    for halvings in range(HALVINGS):
        stride = STRIDE * leg.size / 2**halvings
        gait = Gait(centre=(x, z), stride=stride, lift=0.3 * stride, frequency=1.0)
        path = gait.nominal(np.arange(ROWS) / RATE).position
        rows = _angles(firmware, leg, path)
        if rows is not None:
            return path, rows
    raise GeometryError(f"the leg {leg.name} has no room for a gait about its rest pose")


def _angles(firmware: Leg, leg: FiveBar, path: Array) -> Real | None:
    """Return the angles of a path, continuous, or None if they do not fit two hobby servos."""
    theta, status = inverse(firmware, path, *leg.mode)
    if (status != Status.OK).any():
        return None
    rows = np.unwrap(theta.astype(float), axis=0)
    # The table is periodic: its end must be where it began, and no servo turns farther than pi.
    closes = np.abs(rows[0] - rows[-1]).max() < 0.5 * np.pi
    fits = (rows.max(axis=0) - rows.min(axis=0)).max() < np.pi
    return rows.astype(theta.dtype) if closes and fits else None


def _row(row: Real) -> str:
    return f"    {{{number(row[0])}, {number(row[1])}}},\n"


def _constant(value: float) -> str:
    """Return a constant that C takes in either arithmetic."""
    return f"(fivebar_real){number(np.float64(value))}"
