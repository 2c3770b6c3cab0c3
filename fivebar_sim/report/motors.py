"""Figures of the motors: angles and setpoints, speeds, power, torque against speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.metrics.columns import motors as columns
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.report import axes, draw, numbers
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.look import colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def angles(run: StoredRun) -> Drawn:
    """Draw the angles of both motors with what they were sent."""
    figure, both = draw.panels(1, 1, height=4.6)
    sent = numbers.drive(run) == "position"
    cut = False

    for ax, motor in zip(both, MOTORS, strict=True):
        lines = {"angle": np.degrees(run.record[f"theta_{motor}"])}
        draw.line(ax, run.record["time"], lines["angle"], motor, lw=2.4, label=f"angle {motor}")
        if sent:
            lines["setpoint"] = np.degrees(run.record[f"ctrl_{motor}"])
            label = "setpoints" if motor == "E" else None
            draw.line(ax, run.record["time"], lines["setpoint"], "ink", lw=0.9, label=label)
        cut |= _over_time(ax, run, f"angle {motor} [deg]", *lines.values())

    figure.legend(loc="outside upper center", ncols=3)
    what = "and the setpoints that the servos got (thin)" if sent else "driven by torque"
    return Drawn(
        "angles",
        "Joint angles",
        f"The angles of L1 at A and of L4 at E from the x axis, {what}.{axes.CUT * cut}",
        f"Lines of the angles of A and E over time, {what}.",
        figure,
    )


def speeds(run: StoredRun) -> Drawn:
    """Draw the speeds of both motors."""
    lines = {motor: run.record[f"theta_dot_{motor}"] for motor in MOTORS}
    figure, cut = _both(run, "speed [rad/s]", lines)
    window = run.scenario.window
    most = " and ".join(f"{np.abs(lines[motor][window]).max():.3g} rad/s" for motor in MOTORS)
    no_load = run.scenario.servo.speed
    line = "" if no_load is None else f" The servo turns at {no_load:.3g} rad/s without load."
    return Drawn(
        "speeds",
        "Motor speeds",
        f"The rates of A and E; at most {most} in the measured time.{line}{axes.CUT * cut}",
        f"Lines of the speeds of A and E over time; at most {most}.",
        figure,
    )


def power(run: StoredRun) -> Drawn:
    """Draw the mechanical power of both motors."""
    given = {motor: numbers.power(run, motor) for motor in MOTORS}
    largest = max(float(np.abs(watts).max()) for watts in given.values())
    _, unit = units.fitting(1e3 * largest, "mW")
    lines = {motor: watts / units.size(unit) for motor, watts in given.items()}
    figure, cut = _both(run, f"power [{unit}]", lines)
    figure.axes[0].axhline(0.0, color=colour("muted"), lw=0.8)
    work = " and ".join(
        shown("load.work.A.net", look_up(run.metrics, f"load.work.{motor}.net")) for motor in MOTORS
    )
    return Drawn(
        "power",
        "Motor power",
        f"Torque times speed: above 0 the motor drives, below it brakes. A and E gave {work} in "
        f"the measured time.{axes.CUT * cut}",
        f"Lines of the mechanical power of A and E over time; they gave {work}.",
        figure,
    )


def torque_speed(run: StoredRun) -> Drawn:
    """Draw torque against speed in the measured time, inside what the servo can give."""
    figure, (ax,) = draw.panels(1, height=2.9)

    window = run.scenario.window
    fastest, largest = (
        float(np.abs(columns(run.record, name)[window]).max()) for name in ("theta_dot", "torque")
    )
    _, unit = units.fitting(1e3 * largest, "mN m")
    for motor in MOTORS:
        speed = run.record[f"theta_dot_{motor}"][window]
        torque = run.record[f"torque_{motor}"][window] / units.size(unit)
        rows = np.union1d(draw.envelope(speed), draw.envelope(torque))
        ax.plot(speed[rows], torque[rows], color=colour(motor), lw=1.2, label=f"motor {motor}")

    fastest = 1.1 * fastest or 1.0
    note = _torque_speed_line(ax, run, fastest, largest, unit)
    ax.set(xlabel="speed [rad/s]", ylabel=f"torque [{unit}]", xlim=(-fastest, fastest))
    figure.legend(loc="outside upper center", ncols=3)
    return Drawn(
        "torque-speed",
        "Torque against speed",
        f"Each motor's torque at its speed, in the measured time.{note}",
        f"The motors' torque against their speed; at most "
        f"{units.text(1e3 * largest, 'mN m', 3)}.{note}",
        figure,
    )


def _torque_speed_line(ax: Axes, run: StoredRun, fastest: float, largest: float, unit: str) -> str:
    """Draw the torque that a servo has at each speed, if it is near; return a sentence about it."""
    limit = run.scenario.servo.limit
    if limit is None:
        return " The servo has no limit."
    said = f"{shown('load.torque_peak.A', limit)} at rest"
    if limit > numbers.IN_VIEW * largest:
        return f" The servo's limit, {said}, is outside the picture."

    ends = np.array([-fastest, fastest])
    low, high = numbers.band_at(run, ends)
    for edge, label in ((low, None), (high, "servo's limit")):
        ax.plot(ends, edge / units.size(unit), "-.", color=colour("muted"), lw=1.2, label=label)
    return f" Dash-dotted: the most that the servo gives at each speed, {said}."


def _both(run: StoredRun, label: str, lines: dict[str, Array]) -> tuple[Figure, bool]:
    """Return a figure with a line of each motor over time, and whether one is cut."""
    figure, (ax,) = draw.panels(1, height=2.9)
    for motor, values in lines.items():
        draw.line(ax, run.record["time"], values, motor, label=f"motor {motor}")
    cut = _over_time(ax, run, label, *lines.values())
    figure.legend(loc="outside upper center", ncols=2)
    return figure, cut


def _over_time(ax: Axes, run: StoredRun, label: str, *lines: Array) -> bool:
    """Scale axes over time by what is measured; return whether a line is cut."""
    draw.shade_unmeasured(ax, run)
    ax.set(ylabel=label, ylim=axes.measured_range(run, *lines))
    return axes.mark_cut(ax, run, *lines)
