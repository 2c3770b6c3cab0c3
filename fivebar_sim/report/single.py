"""The page of one run: verdict, limits, figures, all metrics, the scenario and its command."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

import msgspec

from fivebar_sim import units
from fivebar_sim.checks import is_finite
from fivebar_sim.metrics import guards, tracking
from fivebar_sim.metrics.catalogue import BY_KEY, SHOWN, shown
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.metrics.limits import bounds, look_up
from fivebar_sim.report import html, in_plane, motors, numbers, over_time
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.html import plain, text
from fivebar_sim.runs import directory
from fivebar_sim.runs.side_by_side import when
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.scenario.leg_words import leg_words

TIMES = {
    "load.opposing.first": "motors opposed first, after the window's begin",
    "branch.first_flip": "first branch flip",
}
"""Times of metrics.json that are no metrics, and what happened then; None for never."""


ANEW = (
    "metrics.json is missing: all numbers here are computed anew from rollout.parquet and "
    "scenario.toml. Where the run comes from, and the steps in which MuJoCo's solver did not "
    "converge, are in no column, but beside them in that file. The forces of loop, gear friction "
    "and ends of travel follow from Newton's law, so the guard on energy trusts them"
)
"""What readers of a run without metrics.json must know."""


def figures(run: StoredRun) -> list[Drawn]:
    """Return the figures of a run; call it within `look.project_style`."""
    drawn = [
        # On a wide screen two figures stand side by side, so neighbours are of similar height.
        in_plane.foot_path(run),
        in_plane.leg_moments(run),
        over_time.tracking_error(run),
        over_time.error_parts(run),
        over_time.torque(run),
        motors.angles(run),
        motors.speeds(run),
        motors.power(run),
        motors.torque_speed(run),
        over_time.load_share(run),
        over_time.ground_contact(run),
        over_time.loop_gap(run),
    ]
    return [one for one in drawn if one is not None]


def page(run: StoredRun, drawn: list[Drawn]) -> str:
    """Return the page of a run with its figures; call it within `look.project_style`."""
    scenario = run.scenario
    parts = [
        _head(run),
        html.section("Limits", limits(run), guarded(run)),
        html.section("What happened", html.figures(drawn)),
        html.section("How the motors shared the load", _load(run), *_phase(run)),
        html.section("All metrics", metrics(run)),
        html.section("What was run", *what(run)),
    ]
    return html.page(f"{scenario.name}: {run.measured.verdict}", parts)


def _head(run: StoredRun) -> str:
    """Return the heading of a leg's run."""
    scenario = run.scenario
    window = scenario.window
    h = scenario.sim.timestep
    words = leg_words(scenario.leg, scenario.servo.armature)
    about = (
        f"The {words}{',' * (',' in words)} follows a path of kind "
        f"{scenario.path.__struct_config__.tag} in the scene {scenario.scene.kind}, driven by the "
        f"controller {scenario.controller_name}, for {scenario.duration:g} s in steps of "
        f"{1e3 * h:g} ms. Tracking and load are measured in the window from "
        f"{window.start * h:.4g} s to {window.stop * h:.4g} s, what is called (run) over the whole "
        f"run."
    )

    remark = tracking.astray(scenario.leg, run.record, window)
    return head(run, about, [] if remark is None else [remark])


def head(run: StoredRun, about: str, warnings: Sequence[str] = ()) -> str:
    """Return the heading of a run's page.

    Args:
        run: The run.
        about: What was run, in a few sentences.
        warnings: What its reader must know.
    """
    tripped = [f'<p class="fail">{text(said)}</p>' for said in guards.tripped(run.measured.guards)]
    if run.anew:
        warnings = [*warnings, ANEW]

    return "\n".join(
        [
            f"<header>\n<h1>{text(run.scenario.name)}</h1>",
            f"<p>{html.judgement(run.measured.verdict)}</p>",
            *tripped,
            *(f"<p>{text(f'Warning: {said}.')}</p>" for said in warnings),
            f"<p>{text(about)}</p>\n</header>",
        ]
    )


def limits(run: StoredRun) -> str:
    """Return the table of limits: bound, value, and whether it holds."""
    rows = [
        (SHOWN[limit.key][0], bounds(limit), shown(limit.key, limit.value), html.verdict(limit.ok))
        for limit in numbers.limits(run)
    ]
    if not rows:
        return "<p>No limits are set: the run is not judged, but fails if a guard trips.</p>"
    return html.table(
        "The run passes if all of these hold.", ("metric", "limit", "value", ""), rows
    )


def guarded(run: StoredRun) -> str:
    """Return the guards, folded to one line; open if one tripped."""
    guarded = run.measured.guards
    lost = [guard.name for guard in guarded if not guard.ok]
    rows: list[tuple[str, str, html.Cell]] = []

    for guard in guarded:
        rule = guards.RULES[guard.name]
        # An undefined value is none, where the row would show a 0.
        worst = "undefined" if guard.value is None else rule.show(guard.value)
        rows.append((f"{rule.name}: {guard.bound}", worst, html.verdict(guard.ok)))

    said = f"Guards: all {len(guarded)} hold"
    if lost:
        said = f"Guards: {len(lost)} of {len(guarded)} tripped: {', '.join(lost)}"
    caption = "Each guard rejects the run as soon as its sentence is true."
    table = html.table(caption, ("guard", "worst value", ""), rows)
    return html.folded(said, table, is_open=bool(lost))


def _load(run: StoredRun) -> str:
    """Return the table of both motors' load, and how much they opposed each other."""
    named = {
        "load.torque_rms": "torque RMS",
        "load.torque_peak": "torque peak",
        "whole.torque_peak": "torque peak (run)",
        "speed_peak": "speed peak",
        "whole.speed_peak": "speed peak (run)",
        "power_peak": "power peak",
        "whole.power_peak": "power peak (run)",
        "load.work.{}.positive": "work given",
        "load.work.{}.negative": "work taken",
        "load.work.{}.net": "work net",
        "load.saturated": "time saturated",
    }
    rows: list[tuple[str, str, str]] = []
    for key, label in named.items():
        pair = [key.format(m) if "{}" in key else f"{key}.{m}" for m in MOTORS]
        A, E = (
            f"{shown(each, look_up(run.metrics, each))}{when(run.metrics, BY_KEY[each])}"
            for each in pair
        )
        rows.append((label, A, E))

    for key, label in (("load.share_A", "load share"), ("load.thermal_share_A", "thermal share")):
        part = look_up(run.metrics, key)
        rows.append((label, shown(key, part), shown(key, None if part is None else 1.0 - part)))

    limit = run.scenario.servo.limit
    if limit is not None:
        # The servo has to give the peak of the whole run, wherever the window begins.
        peaks = [look_up(run.metrics, f"whole.torque_peak.{motor}") or 0.0 for motor in MOTORS]
        A, E = (shown("load.share_A", peak / limit) for peak in peaks)
        rows.append((f"peak (run), of the servo's {shown('load.torque_peak.A', limit)}", A, E))

    fraction, energy = (
        shown(key, look_up(run.metrics, key))
        for key in ("load.opposing.fraction", "load.opposing.energy")
    )
    note = (
        f"One motor drove while the other braked in {fraction} of the steps; {energy} went from "
        "one to the other."
    )
    window = run.measured.window
    caption = (
        f"Over the measured window, {window.begin:.4g} to {window.end:.4g} s; "
        "(run): over the whole run."
    )
    return html.table(caption, ("", "A", "E"), rows) + f"\n<p>{text(note)}</p>"


def _phase(run: StoredRun) -> list[str]:
    """Return the load over the gait's cycle, if the path has one."""
    phase = run.measured.load.phase
    if phase is msgspec.UNSET:
        return []

    share = phase.share_A
    rms = phase.torque_rms
    rows = [
        (
            f"{100.0 * k / len(share):.4g} to {100.0 * (k + 1) / len(share):.4g} %",
            shown("load.torque_rms.A", rms.A[k]),
            shown("load.torque_rms.E", rms.E[k]),
            shown("load.share_A", part),
        )
        for k, part in enumerate(share)
    ]
    head = ("of the cycle", "torque A RMS", "torque E RMS", "load share A")

    return [html.table("Over the cycle of the path.", head, rows)]


def metrics(run: StoredRun) -> str:
    """Return the table of every metric: for people, and as in metrics.json."""
    rows = []
    for key, value in numbers.flat_metrics(run).items():
        # The load over the cycle, and that of each leg of a robot, have their own tables.
        if key.startswith(("load.phase.", "legs.")):
            continue
        label, read = _words(key, value)
        rows.append((label, read, plain(value), html.key(key)))

    return html.table(
        "As in metrics.json, there in SI units; (run): over the whole run.",
        ("metric", "value", "SI", "key"),
        rows,
        stacked=True,
    )


def _words(key: str, value: Any) -> tuple[str, str]:
    """Return the name of a number of metrics.json for people, and the number in their unit."""
    # Metrics in stance have the units and words of their namesakes over all steps.
    alike = key.replace("load.stance.", "load.")
    peak = key.replace("whole.at.", "whole.")
    label = key.rpartition(".")[2].replace("_", " ")

    if alike in SHOWN and (value is None or is_finite(value)):
        label = SHOWN[alike][0]
        return f"{label}, in stance" if alike != key else label, shown(alike, value)
    if peak in SHOWN:
        return f"{SHOWN[peak][0]}: when", f"{plain(value)} s"
    if key.startswith("window."):
        return f"window, {label}", f"{plain(value)} s"
    if alike in TIMES:
        label = TIMES[alike]
        value = "never" if value is None else units.text(value, "s")
    return label + (", in stance" if alike != key else ""), plain(value)


def what(run: StoredRun) -> list[str]:
    """Return the command, the provenance of the numbers, and the resolved scenario."""
    # Quoted for a shell: a run directory may have blanks in its name.
    again = shlex.join(["fivebar", "run", f"{numbers.name_of(run)}/scenario.toml"])
    rows = [(key, plain(value)) for key, value in run.measured.provenance.items()]
    return [
        "<p>To run it again, in the folder that contains the run directory:</p>",
        f"<pre><code>{html.escape(again)}</code></pre>",
        html.table("Where the numbers come from.", ("", ""), rows),
        "<p>The scenario with all defaults, scenario.toml:</p>",
        f'<pre tabindex="0"><code>{html.escape(directory.as_toml(run.scenario))}</code></pre>',
    ]
