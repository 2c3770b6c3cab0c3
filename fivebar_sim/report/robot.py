"""The page of a robot's run: verdict, limits, figures, load of each leg, metrics, scenario."""

from __future__ import annotations

from fivebar_sim import units
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.limits import has, look_up
from fivebar_sim.report import html, single
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.robot_figures import figures, robot_of
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.floor import load
from fivebar_sim.runs.stored import StoredRun

__all__ = ["figures", "page"]

ROWS = (
    ("torque_rms.A", "torque A RMS", "load.torque_rms.A"),
    ("torque_rms.E", "torque E RMS", "load.torque_rms.E"),
    ("torque_peak.A", "torque A peak", "load.torque_peak.A"),
    ("torque_peak.E", "torque E peak", "load.torque_peak.E"),
    ("side_rms", "torque S RMS", "load.torque_rms.A"),
    ("side_peak", "torque S peak", "load.torque_peak.A"),
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
