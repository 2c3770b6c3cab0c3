"""Figures over time: tracking error, torques, load share, loop gap, ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.metrics import ground, tracking
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.recording.plots import SHARE_WINDOW
from fivebar_sim.recording.poses import points
from fivebar_sim.report import axes, draw, numbers
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.look import colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def tracking_error(run: StoredRun) -> Drawn:
    """Draw the tracking error with its RMS and 95th percentile."""
    error = tracking.tracking_error(run.record)
    most = numbers.percentile(run)
    rms = look_up(run.metrics, "tracking.rms") or 0.0
    scale, unit = draw.length_unit(float(error[run.scenario.window].max()))
    figure, (ax,) = draw.panels(1, height=2.9)
    draw.line(ax, run.record["time"], scale * error, "foot")
    levels = {"RMS": shown("tracking.rms", rms), "95 %": shown("tracking.rms", most)}

    for value, style, name in ((rms, "--", "RMS"), (most, ":", "95 %")):
        label = f"{name}: {levels[name]}"
        ax.axhline(scale * value, color=colour("ink"), ls=style, lw=1.4, label=label)

    draw.shade_unmeasured(ax, run)
    top = draw.ceiling(scale * error[run.scenario.window])
    ax.set(ylabel=f"|foot - target| [{unit}]", ylim=(0.0, top))
    cut = axes.mark_cut(ax, run, scale * error)
    figure.legend(loc="outside upper center", ncols=2)

    return Drawn(
        "tracking-error",
        "Tracking error",
        "Distance of the foot from its target. Shaded: not measured (the ramp from rest, and the "
        "time after the last whole period)." + axes.CUT * cut,
        f"Line of the tracking error over time; RMS {levels['RMS']}, 95 % of the steps below "
        f"{levels['95 %']}.",
        figure,
    )


def error_parts(run: StoredRun) -> Drawn:
    """Draw the tracking error along x and along z."""
    window = run.scenario.window
    error = points(run.record, "foot") - points(run.record, "target")
    scale, unit = draw.length_unit(float(np.abs(error[window]).max()))
    lines = (scale * error).T
    figure, (ax,) = draw.panels(1, height=2.9)

    for values, tint, name in zip(lines, ("foot", "ink"), "xz", strict=True):
        draw.line(ax, run.record["time"], values, tint, label=f"along {name}")

    draw.shade_unmeasured(ax, run)
    ax.set(ylabel=f"foot - target [{unit}]", ylim=axes.measured_range(run, *lines))
    cut = axes.mark_cut(ax, run, *lines)
    figure.legend(loc="outside upper center", ncols=2)
    most = " and ".join(shown("tracking.max", part) for part in np.abs(error[window]).max(axis=0))
    return Drawn(
        "error-parts",
        "Tracking error along x and z",
        f"How far the foot is ahead of its target (x) and above it (z): at most {most} in the "
        f"measured time.{axes.CUT * cut}",
        f"Lines of the tracking error along x and z over time; at most {most}.",
        figure,
    )


def torque(run: StoredRun) -> Drawn:
    """Draw the torques of A and E with RMS, peak, share, and the servo's limit."""
    figure, both = draw.panels(1, 1, height=4.6)
    window = run.scenario.window
    # One scale for both motors, or an idle one would look as busy as the other.
    largest = max(float(np.abs(run.record[f"torque_{motor}"][window]).max()) for motor in MOTORS)
    cut = False
    for ax, motor in zip(both, MOTORS, strict=True):
        cut |= _torque(ax, run, motor, largest)

    share = look_up(run.metrics, "load.share_A")
    limit = run.scenario.servo.limit
    note = ""
    if limit is not None:
        inside = limit <= numbers.IN_VIEW * largest
        note = f" The servo's limit is {shown('load.torque_peak.A', limit)} at rest" + (
            ": dash-dotted, for the rate at each time." if inside else ", outside the picture."
        )

    rms, peak = (
        " and ".join(
            shown(f"load.torque_{kind}.{m}", look_up(run.metrics, f"load.torque_{kind}.{m}"))
            for m in MOTORS
        )
        for kind in ("rms", "peak")
    )
    return Drawn(
        "torque",
        "Motor torques",
        f"What the motors at A and E applied; dashed: plus and minus RMS; ring: the peak.{note}"
        f"{axes.CUT * cut}",
        f"Lines of the torques of A and E over time; RMS {rms}, peak {peak}, share of A "
        f"{shown('load.share_A', share)}.",
        figure,
    )


def _torque(ax: Axes, run: StoredRun, motor: str, largest: float) -> bool:
    """Draw the torque of one motor; `largest` [N m] sets the scale. Return whether it is cut."""
    time = run.record["time"]
    fitted, unit = units.fitting(1e3 * largest, "mN m")
    scale = fitted / largest if largest > 0.0 else 1e3
    tau = scale * run.record[f"torque_{motor}"]
    window = run.scenario.window
    rms, peak = (look_up(run.metrics, f"load.torque_{kind}.{motor}") for kind in ("rms", "peak"))
    part = look_up(run.metrics, "load.share_A")
    part = 1.0 - part if part is not None and motor == "E" else part
    draw.line(ax, time, tau, motor)

    for side in (-1.0, 1.0):
        ax.axhline(side * scale * (rms or 0.0), color=colour("ink"), ls="--", lw=1.0)

    # The metrics count the window only, so the ring must not mark a peak of the ramp.
    top = window.start + int(np.abs(tau[window]).argmax())
    ax.plot(time[top], tau[top], "o", mfc="none", mec=colour("ink"), ms=8, mew=1.4)
    room = 1.15 * scale * largest or 1.0
    limit = run.scenario.servo.limit
    band = numbers.torque_band(run, motor)

    if band is not None and limit is not None and limit <= numbers.IN_VIEW * largest:
        for edge in band:
            draw.line(ax, time, scale * edge, "muted", ls="-.", lw=1.0)
            room = max(room, 1.05 * scale * float(np.abs(edge[window]).max()))

    draw.shade_unmeasured(ax, run)
    levels = f"RMS {shown('load.torque_rms.A', rms)}, peak {shown('load.torque_peak.A', peak)}"
    ax.set(ylabel=f"torque {motor} [{unit}]", ylim=(-room, room))
    ax.set_title(f"{motor}: {levels}, share {shown('load.share_A', part)}", loc="left")
    return axes.mark_cut(ax, run, tau)


def load_share(run: StoredRun) -> Drawn:
    """Draw A's share of the load in a moving window."""
    whole = look_up(run.metrics, "load.share_A")
    average = shown("load.share_A", whole)
    figure, (ax,) = draw.panels(1, height=2.6)
    draw.line(ax, run.record["time"], 100.0 * numbers.share(run), "A", lw=1.6)
    ax.axhline(50.0, color=colour("muted"), lw=1.0)

    if whole is not None:
        label = f"over the measured time: {average}"
        ax.axhline(100.0 * whole, color=colour("ink"), ls="--", lw=1.2, label=label)
        figure.legend(loc="outside upper center")

    draw.shade_unmeasured(ax, run)
    ax.set(ylabel="load share of A [%]", ylim=(0.0, 100.0))
    return Drawn(
        "load-share",
        "Load share",
        f"A's part of the torque impulse within {1e3 * SHARE_WINDOW:g} ms; 50 % is an even share. "
        "There is no line where neither motor has a torque.",
        f"Line of A's share of the load over time; {average} over the measured time.",
        figure,
    )


def loop_gap(run: StoredRun) -> Drawn:
    """Draw the loop's gap at C."""
    gap = run.record["gap"]
    rms, most = (shown(key, look_up(run.metrics, key)) for key in ("closure.rms", "closure.max"))
    scale, unit = draw.length_unit(float(gap.max()))
    figure, (ax,) = draw.panels(1, height=2.4)
    draw.line(ax, run.record["time"], scale * gap, "ink")
    ax.set(ylabel=f"gap at C [{unit}]", ylim=(0.0, draw.ceiling(scale * gap)))
    ax.set_xlim(0.0, run.record["time"][-1])

    return Drawn(
        "loop-gap",
        "Loop gap",
        f"Distance between the ends of L2 and L3 at C, where the simulation closes the loop: "
        f"{rms} RMS, {most} at most, over the whole run.",
        f"Line of the loop gap over time; RMS {rms}, largest {most}.",
        figure,
    )


def ground_contact(run: StoredRun) -> Drawn | None:
    """Draw the ground's force, the foot's height and the stance; None without a ground."""
    if "ground_z" not in run.record:
        return None

    time = run.record["time"]
    stands = ground.stands(run.record)
    height = 1e3 * ground.height(run.scenario.leg, run.record)
    figure, both = draw.panels(3, 2, height=4.4)

    for name, axis in (("force", "z"), ("muted", "x")):
        values: Array = run.record[f"ground_{axis}"]
        draw.line(both[0], time, values, name, label=f"force along {axis}")

    draw.line(both[1], time, height, "ink")
    for ax in both:
        draw.shade_stance(ax, time, stands)

    both[0].set(ylabel="force on the foot [N]")
    both[1].set(ylabel="foot height [mm]", xlim=(0.0, time[-1]))
    figure.legend(loc="outside upper center", ncols=2)
    share = shown("ground.stance_share", look_up(run.metrics, "ground.stance_share"))

    return Drawn(
        "ground",
        "Ground",
        "The ground's force on the foot, and the height of the foot's ball above the floor. "
        f"Shaded: the foot stands ({share} of the measured time).",
        f"Lines of the ground's force along z and x and of the foot's height over time; in stance "
        f"{share} of the measured time.",
        figure,
    )
