"""The figures of a robot's run: its path from above, its gait, forces, torques, trunk."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.metrics.tracking import tracking_error
from fivebar_sim.report import axes, draw
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.look import colour
from fivebar_sim.robots import LEGS, Floor, Robot, places
from fivebar_sim.robots.columns import of_leg, trunk
from fivebar_sim.robots.floor import load
from fivebar_sim.robots.measure import Trunk, heading, lean
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FELT = 160
"""Points along each side of the ground's map."""

CONTOUR_LINES = 4
"""Heights at which uneven ground is outlined."""

CONTOURS = " Thin: contours of the ground."

OUTLINES = 6
"""Outlines of the trunk along its path."""

NAMED = dict(zip(LEGS, ("run-1", "run-2", "run-3", "run-4"), strict=True))
"""The colours of the legs."""


def robot_of(run: StoredRun) -> Robot:
    """Return the robot of a run."""
    assert isinstance(run.scenario, RobotScenario)
    return run.scenario.robot


def figures(run: StoredRun) -> list[Drawn]:
    """Return the figures of a robot's run; call it within `look.project_style`."""
    body = trunk(run.record)
    drawn = [] if body is None else [from_above(run, body), gait(run), forces(run), pose(run, body)]
    return [*drawn, torques(run), errors(run)]


def from_above(run: StoredRun, body: Trunk) -> Drawn:
    """Draw the path of the trunk from above, and where the feet stood."""
    figure, ax = draw.plane(3.6)
    ax.set(xlabel="x [mm]", ylabel="y [mm]")
    robot = robot_of(run)
    for leg in LEGS:
        record = of_leg(run.record, leg)
        stood = record["ground_z"] > 0.0
        x, y, _ = 1e3 * places.feet(body, robot.hips[leg], record)[stood].T
        # As dots: what a foot slides is a line, what it stands on is one of them.
        some = draw.envelope(x) if len(x) else slice(None)
        ax.plot(x[some], y[some], ".", color=colour(NAMED[leg]), ms=2.5, label=leg)

    uneven = _contours(ax, run, body)
    x, y, _ = 1e3 * body.position.T
    ax.plot(x, y, color=colour("ink"), lw=1.6)
    turned = heading(body.quaternion)
    for k in np.linspace(0, len(x) - 1, OUTLINES).astype(int):
        outline = _outline(robot, float(turned[k])) + np.array([x[k], y[k]])
        last = k == len(x) - 1
        ax.plot(*outline.T, color=colour("ink" if last else "muted"), lw=1.4 if last else 0.8)
    figure.legend(loc="outside upper center", ncols=4, markerscale=4)

    went = " and ".join(f"{1e3 * abs(v):.0f} mm" for v in body.position[-1, :2])
    return Drawn(
        "from-above",
        "Path from above",
        "The trunk's way (line) with its outline at equal times, the last one dark; x is where it "
        "faced at the start. Dots: where each foot touched the floor. A foot that slides draws a "
        f"line.{CONTOURS * uneven}",
        f"The trunk's path from above, with the feet's prints; it ends {went} from the start along "
        "x and y.",
        figure,
    )


def _contours(ax: Axes, run: StoredRun, body: Trunk) -> bool:
    """Draw where uneven ground is equally high, around the trunk's way; return whether it is."""
    scene = run.scenario.scene
    if not isinstance(scene, Floor) or scene.ground.level:
        return False

    reach = robot_of(run).length
    ends = [(line.min() - reach, line.max() + reach) for line in body.position[:, :2].T]
    x, y = np.meshgrid(*(np.linspace(low, high, FELT) for low, high in ends))
    heights = scene.ground.heights(x, y)
    if np.ptp(heights) > 0.0:
        between = np.linspace(heights.min(), heights.max(), CONTOUR_LINES + 2)[1:-1]
        ax.contour(
            1e3 * x, 1e3 * y, heights, between, colors=[colour("muted")], linewidths=0.4, alpha=0.7
        )
    return True


def _outline(robot: Robot, turned: float) -> Array:
    """Return the outline of the trunk's box from above, with its nose [mm], (n, 2)."""
    length, width, _ = robot.trunk.size
    x = np.array([-0.5, 0.5, 0.65, 0.5, -0.5, -0.5]) * length + robot.trunk.center[0]
    y = np.array([-0.5, -0.5, 0.0, 0.5, 0.5, -0.5]) * width + robot.trunk.center[1]
    cos = np.cos(turned)
    sin = np.sin(turned)
    return 1e3 * np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def gait(run: StoredRun) -> Drawn:
    """Draw when each foot stands: the gait diagram."""
    figure, (ax,) = draw.panels(1, height=2.4)
    time = run.record["time"]
    for row, leg in enumerate(reversed(LEGS)):
        down = run.record[f"{leg}_ground_z"] > 0.0
        flips = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]])))
        edges = np.concatenate([[0.0], time])[flips].reshape(-1, 2)
        spans = [(start, stop - start) for start, stop in edges.tolist()]
        ax.broken_barh(spans, (row - 0.35, 0.7), facecolors=colour(NAMED[leg]), lw=0)

    draw.shade_unmeasured(ax, run)
    ax.set(yticks=range(4), yticklabels=LEGS[::-1], ylim=(-0.6, 3.6))
    ax.grid(visible=False, axis="y")
    duty = ", ".join(
        f"{leg} {100.0 * (look_up(run.metrics, f'legs.{leg}.duty') or 0.0):.0f} %" for leg in LEGS
    )
    return Drawn(
        "gait",
        "Gait diagram",
        f"When each foot stands. Part of the measured time: {duty}. Shaded: not measured.",
        f"Bars over time for each of the four feet while it stands; {duty} of the measured time.",
        figure,
    )


def forces(run: StoredRun) -> Drawn:
    """Draw the vertical force on each foot."""
    figure, panels = draw.panels(1, 1, 1, 1, height=5.0)
    lines = [run.record[f"{leg}_ground_z"] for leg in LEGS]
    top = draw.ceiling(np.concatenate([line[run.scenario.window] for line in lines]))
    cut = False
    for ax, leg, line in zip(panels, LEGS, lines, strict=True):
        draw.line(ax, run.record["time"], line, NAMED[leg])
        draw.shade_unmeasured(ax, run)
        ax.set(ylabel=f"{leg} [N]", ylim=(0.0, top))
        cut |= axes.mark_cut(ax, run, line)

    scene = run.scenario.scene
    carried = load(scene) if isinstance(scene, Floor) else 0.0
    weight = (robot_of(run).mass + carried) * 9.81
    share = ", ".join(
        f"{leg} {_percent(look_up(run.metrics, f'legs.{leg}.weight_share'))}" for leg in LEGS
    )
    return Drawn(
        "forces",
        "Forces of the floor",
        f"Vertical force on each foot; the robot weighs {weight:.3g} N. Parts of the whole: "
        f"{share}.{axes.CUT * cut}",
        f"Four lines of vertical force over time; {share} of it all.",
        figure,
    )


def _percent(part: float | None) -> str:
    return "undefined" if part is None else f"{100.0 * part:.0f} %"


def pose(run: StoredRun, body: Trunk) -> Drawn:
    """Draw height, lean and heading of the trunk."""
    figure, panels = draw.panels(1, 1, 1, height=4.2)
    time = run.record["time"]
    assert isinstance(run.scenario, RobotScenario)
    pushes = run.scenario.pushes
    drawn = (
        ("height [mm]", 1e3 * body.position[:, 2], "ink"),
        ("lean [deg]", np.degrees(lean(body.quaternion)), "foot"),
        ("heading [deg]", np.degrees(heading(body.quaternion)), "A"),
    )
    for ax, (label, values, name) in zip(panels, drawn, strict=True):
        draw.line(ax, time, values, name)
        draw.shade_unmeasured(ax, run)
        for push in pushes:
            ax.axvspan(push.time, push.end, color=colour("force"), alpha=0.25, lw=0, label="push")
        ax.set(ylabel=label)

    table = run.metrics["robot"]
    said = ", ".join(
        f"{word} {shown(f'robot.{key}', table[key])}"
        for word, key in (("leans up to", "lean"), ("bobs by", "bob"), ("turns by", "turn_rate"))
    )
    shaded = ""
    if pushes:
        after = table["recovery"]
        over = "never" if after is None else f"after {shown('robot.recovery', after)}"
        shaded = f" Dark bands: pushes. It is up again {over}."
    return Drawn(
        "pose",
        "The trunk",
        f"Height of its origin, angle between its z axis and the vertical, and where it faces. In "
        f"the measured time it {said}.{shaded}",
        f"Lines of height, lean and heading over time; it {said}.",
        figure,
    )


def torques(run: StoredRun) -> Drawn:
    """Draw the torques of all eight motors."""
    figure, panels = draw.panels(1, 1, 1, 1, height=5.4)
    lines = {leg: [1e3 * run.record[f"{leg}_torque_{m}"] for m in "AE"] for leg in LEGS}
    every = [line for pair in lines.values() for line in pair]
    low, high = axes.measured_range(run, *every)
    cut = False
    for ax, leg in zip(panels, LEGS, strict=True):
        for values, motor in zip(lines[leg], "AE", strict=True):
            draw.line(ax, run.record["time"], values, motor, label=motor)
        draw.shade_unmeasured(ax, run)
        ax.set(ylabel=f"{leg} [mN m]", ylim=(low, high))
        cut |= axes.mark_cut(ax, run, *lines[leg])
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=2)

    shares = ", ".join(
        f"{leg} {_percent(look_up(run.metrics, f'legs.{leg}.share_of_robot'))}" for leg in LEGS
    )
    return Drawn(
        "torques",
        "Torques of each leg",
        f"Torques of A and E, all to one scale. Parts of all torque impulse: {shares}."
        f"{axes.CUT * cut}",
        f"Four panels with the torques of A and E over time; {shares} of all.",
        figure,
    )


def errors(run: StoredRun) -> Drawn:
    """Draw how far each foot is from its target."""
    figure, (ax,) = draw.panels(1, height=2.9)
    lines = {leg: 1e3 * tracking_error(of_leg(run.record, leg)) for leg in LEGS}

    for leg in LEGS:
        draw.line(ax, run.record["time"], lines[leg], NAMED[leg], label=leg)
    draw.shade_unmeasured(ax, run)
    window = run.scenario.window
    top = draw.ceiling(np.concatenate([line[window] for line in lines.values()]))
    ax.set(ylabel="|foot - target| [mm]", ylim=(0.0, top))
    cut = axes.mark_cut(ax, run, *lines.values())
    figure.legend(loc="outside upper center", ncols=4)
    rms = shown("tracking.rms", look_up(run.metrics, "tracking.rms"))
    return Drawn(
        "tracking-error",
        "Tracking error of each foot",
        f"Distance of each foot from its target, in its hip frame; RMS of all {rms}."
        f"{axes.CUT * cut}",
        f"Four lines of tracking error over time; RMS {rms}.",
        figure,
    )
