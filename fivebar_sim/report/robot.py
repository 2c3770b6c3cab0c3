"""The page of a robot's run: verdict, limits, figures, load of each leg, metrics, scenario.

And the figures of a page that compares several.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.limits import has, look_up
from fivebar_sim.metrics.tracking import tracking_error
from fivebar_sim.report import comparison, draw, html, single
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.robot_figures import figures, robot_of
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import of_leg, trunk
from fivebar_sim.robots.floor import load
from fivebar_sim.robots.hips.motors import MOTORS
from fivebar_sim.robots.measure import Trunk, heading, lean
from fivebar_sim.runs.stored import StoredRun

__all__ = ["compared", "figures", "page"]

OF_HIP = (
    ("rms", ("torque", " RMS"), "load.torque_rms.A"),
    ("peak", ("torque", " peak"), "load.torque_peak.A"),
    ("work", ("work given by", ""), "load.work.A.positive"),
    ("heat", ("heat", ""), "load.heat.A"),
)
"""Of each motor of a hip: key behind its name, label around its letter, and the metric as below."""

ROWS = (
    ("torque_rms.A", "torque A RMS", "load.torque_rms.A"),
    ("torque_rms.E", "torque E RMS", "load.torque_rms.E"),
    ("torque_peak.A", "torque A peak", "load.torque_peak.A"),
    ("torque_peak.E", "torque E peak", "load.torque_peak.E"),
    *(
        (f"{motor.does}_{key}", f"{label[0]} {motor.letter}{label[1]}", unit)
        for motor in MOTORS
        for key, label, unit in OF_HIP
    ),
    ("share_A", "load share A", "load.share_A"),
    ("share_of_robot", "part of all torque", "load.share_A"),
    ("weight_share", "part of the weight", "load.share_A"),
    ("saturated.A", "A saturated", "load.saturated.A"),
    ("saturated.E", "E saturated", "load.saturated.E"),
    ("heat.A", "heat A", "load.heat.A"),
    ("heat.E", "heat E", "load.heat.E"),
    ("duty", "time in stance", "ground.stance_share"),
    ("slip", "slip", "ground.slip"),
    ("force_peak", "force peak", "ground.force_max.z"),
    ("tracking_rms", "tracking RMS", "tracking.rms"),
)
"""Rows of the table of legs: key in the table, label, and the metric whose unit it has."""


def page(run: StoredRun, drawn: list[Drawn]) -> str:
    """Return the page of a robot's run with its figures; call it within `look.project_style`."""
    parts = [
        _head(run),
        html.section("Limits", single.limits(run), single.guarded(run)),
        html.section("What happened", html.figures(drawn)),
        html.section("How the legs shared the load", _legs(run)),
        html.section("All metrics", single.metrics(run)),
        html.section("What was run", *single.what(run)),
    ]
    return html.page(f"{run.scenario.name}: {run.measured.verdict}", parts)


def _head(run: StoredRun) -> str:
    """Return the heading of a robot's run."""
    scenario = run.scenario
    window = scenario.window
    h = scenario.sim.timestep
    robot = robot_of(run)
    about = (
        f"The robot {robot.name} of {units.text(1e3 * robot.mass, 'g')}, with four legs "
        f"{robot.leg.name}, follows a path of kind {scenario.path.__struct_config__.tag} in the "
        f"scene {scenario.scene.kind}{_lying(scenario.scene)}, driven by the controller "
        f"{scenario.controller_name}, for "
        f"{scenario.duration:g} s in steps of {1e3 * h:g} ms. It is measured in the window from "
        f"{window.start * h:.4g} s to {window.stop * h:.4g} s, what is called (run) over the whole "
        f"run; a number without a leg's name is that of all legs together."
    )

    return single.head(run, about)


def _lying(scene: object) -> str:
    """Return what lies on the floor of a scene, and what the robot carries, in words."""
    if not isinstance(scene, Floor):
        return ""
    carried = f", carrying {units.text(1e3 * scene.payload.mass, 'g')}" * (load(scene) > 0.0)
    return f"{scene.ground.words}{carried}"


def _legs(run: StoredRun) -> str:
    """Return the table of what each leg did."""
    rows = [
        (label, *(shown(unit, look_up(run.metrics, f"legs.{leg}.{key}")) for leg in LEGS))
        for key, label, unit in ROWS
        if has(run.metrics, f"legs.{LEGS[0]}.{key}")
    ]
    window = run.measured.window
    caption = f"Over the measured window, {window.begin:.4g} to {window.end:.4g} s."
    return html.table(caption, ("", *LEGS), rows, stacked=True)


def compared(runs: Sequence[StoredRun]) -> list[Drawn]:
    """Return the figures of robots' runs overlaid; call it within `look.project_style`."""
    drawn = [comparison.lines(runs, *each) for each in PLOTS]
    free = [run for run in runs if trunk(run.record) is not None]
    return [_ways(free), *drawn] if free else drawn[1:]


def _ways(runs: Sequence[StoredRun]) -> Drawn:
    """Draw the trunks' ways from above."""
    figure, ax = draw.plane(3.6 + comparison.NAME * len(runs))
    ax.set(xlabel="x [mm]", ylabel="y [mm]")
    for k, run in enumerate(runs):
        body = trunk(run.record)
        assert body is not None
        x, y, _ = 1e3 * body.position.T
        ax.plot(x, y, gid="run", **comparison.style(k, runs))

    called = comparison.names(runs)
    comparison.legend(figure, ax, called)
    return Drawn(
        "from-above",
        "Paths from above",
        "The way of each trunk; x is where it faced at the start.",
        f"The paths of the trunks of {', '.join(called)} from above.",
        figure,
    )


def _of_trunk(measure: Callable[[Trunk], Array]) -> Callable[[StoredRun], Array]:
    """Return a function of a run that measures its trunk, NaN where it is held."""

    def column(run: StoredRun) -> Array:
        body = trunk(run.record)
        return np.full(len(run.record["time"]), np.nan) if body is None else measure(body)

    return column


def _forces(run: StoredRun) -> Array:
    """Return the vertical force on all feet [N], NaN where they are held in the air."""
    nothing = np.full(len(run.record["time"]), np.nan)
    return np.sum([run.record.get(f"{leg}_ground_z", nothing) for leg in LEGS], axis=0)


def _torque(run: StoredRun) -> Array:
    """Return the torque of all eight motors, RMS [mN m]."""
    squares = [run.record[f"{leg}_torque_{motor}"] ** 2 for leg in LEGS for motor in "AE"]
    return 1e3 * np.sqrt(np.mean(squares, axis=0))


def _error(run: StoredRun) -> Array:
    """Return how far the worst foot is from its target [mm]."""
    return 1e3 * np.max([tracking_error(of_leg(run.record, leg)) for leg in LEGS], axis=0)


PLOTS: tuple[tuple[str, str, str, dict[str, comparison.Column], bool], ...] = (
    (
        "pose",
        "The trunks",
        "Height of the trunk's origin, angle between its z axis and the vertical, where it faces.",
        {
            "height [mm]": _of_trunk(lambda body: 1e3 * body.position[:, 2]),
            "lean [deg]": _of_trunk(lambda body: np.degrees(lean(body.quaternion))),
            "heading [deg]": _of_trunk(lambda body: np.degrees(heading(body.quaternion))),
        },
        False,
    ),
    (
        "torque",
        "Torques and forces",
        "Torque of all eight motors, RMS at every moment, and the floor's force on all feet.",
        {"torque [mN m]": _torque, "force along z [N]": _forces},
        False,
    ),
    (
        "tracking-error",
        "Tracking error",
        "Distance of the worst foot from its target, the largest value of each interval.",
        {"|foot - target| [mm]": _error},
        True,
    ),
)
