"""./.venv/bin/python scripts/pd_study.py: a published PD study of the leg `airhockey`, reproduced.

Prints the tables of docs/controllers.md about it, with what a control period of 10 ms makes of its
gains and what gain scheduling makes of that, and draws docs/pd-study.svg. The shipped scenarios
airhockey-pd and airhockey-gain-schedule are what is run, with other settings.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import DivergedError
from fivebar_sim.metrics import tracking_error
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OUT = Path(__file__).resolve().parent.parent / "docs" / "pd-study.svg"
DURATION = 10.0  # [s]
PD = "airhockey-pd"
SCHEDULE = "airhockey-gain-schedule"
LINES = Scenario.load(PD).path.rest  # when the last of the lines ends [s]
FREE = "servo={}"  # no torque limit
THIN = 10  # one of so many steps is drawn
SLOW = "controller.period=0.01"
ERROR = "controller.derivative=error"
SOFTER = ("controller.kp_near=60", "controller.kd_near=0.6", "controller.kd_far=0.6")
NEAR = "controller.kd=1.5"  # the schedule's near gains alone, with kp = 150 and ERROR
MOVED = (
    "path.outside=nearest",
    f"path.points={[[x + 0.4, z] for x, z in Scenario.load(PD).table()['path']['points']]}",
)
JUMP = (  # between two control steps, so that no rate of it is ever a reference
    "path.points=[[0.3, 0.4], [0.3, 0.4001], [-0.2, 0.75], [-0.2, 0.7501]]",
    "path.seconds=[1.002, 0.001, 2.997]",
)

TABLES = {
    "The study: kp [N m/rad], kd = 5 N m s/rad on the measured rate": {
        f"{name}{kp}": (PD, f"controller.kp={kp}", *limit)
        for name, limit in (("kp = ", (FREE,)), ("limited, kp = ", ()))
        for kp in (5, 50, 150)
    },
    "The path moved by 0.4 m in x, to the nearest point in reach": {
        f"moved, kp = {kp}": (PD, f"controller.kp={kp}", FREE, *MOVED) for kp in (5, 50, 150)
    },
    "A control period of 10 ms": {
        "PD": (PD, FREE, SLOW),
        "PD, limited": (PD, SLOW),
        "PD, rate error": (PD, FREE, SLOW, ERROR),
        "PD, rate error, 1 ms": (PD, FREE, ERROR),
        "near gains alone": (PD, FREE, SLOW, ERROR, NEAR),
        "schedule": (SCHEDULE,),
        "schedule, limited": (SCHEDULE, "servo.limit=1.0"),
        "schedule, moved": (SCHEDULE, *MOVED),
        "softer, moved": (SCHEDULE, *SOFTER, *MOVED),
    },
    "A target that jumps by 0.61 m, 10 ms": {
        "near gains, jump": (PD, FREE, SLOW, ERROR, NEAR, *JUMP),
        "schedule, jump": (SCHEDULE, *JUMP),
    },
}
BREAK = ("PD", "PD, rate error")
"""They break down, and a batch goes no further than its first run that does."""

Outcome = Result | DivergedError


def scenario(source: str, *settings: str) -> Scenario:
    """Return a shipped scenario with settings, over the study's time."""
    return Scenario.load(source, [f"duration={DURATION}", *settings])


def outcomes() -> dict[str, Outcome]:
    """Return what came of all runs: of one batch, and of those that break down one by one."""
    plans = {
        name: rollout.plan(scenario(*settings))
        for table in TABLES.values()
        for name, settings in table.items()
    }
    found: dict[str, Outcome] = {}
    for name in BREAK:
        try:
            found[name] = rollout.execute(plans.pop(name))
        except DivergedError as error:
            found[name] = error

    together = rollout.run_all(list(plans.values()), nthread=0)
    return found | dict(zip(plans, together, strict=True))


HEAD = f"""\
{"":22s}period  limit    RMS    max  at the end   peak  saturated  gap max
{"":22s}  [ms]  [N m]   [mm]   [mm]        [mm]  [N m]        [%]     [um]"""


def row(name: str, outcome: Outcome) -> str:
    """Return one line of a table: RMS, max and torques are those of the four lines."""
    if isinstance(outcome, DivergedError):
        return f"{name:22s}left its path at t = {outcome.time:g} s, then broke down"

    s = outcome.scenario
    measured = outcome.metrics
    period = getattr(s.controller, "period", 0.0)
    limit = s.servo.limit
    tracking = measured["tracking"]
    load = measured["load"]
    flips = measured["branch"]["flips"]

    return (
        f"{name:22s}{1e3 * period:6g}{'-' if limit is None else f'{limit:g}':>7s}"
        f"{1e3 * tracking['rms']:7.2f}{1e3 * tracking['max']:7.1f}"
        f"{1e3 * tracking_error(outcome.record)[-1]:12.2f}"
        f"{max(load['torque_peak'].values()):7.2f}"
        f"{50.0 * sum(load['saturated'].values()):11.1f}"
        f"{1e6 * measured['closure']['max']:9.1f}" + (f"  flipped {flips} times" if flips else "")
    )


def report(found: dict[str, Outcome]) -> str:
    """Return all tables."""
    parts = []
    for title, table in TABLES.items():
        parts += [title, HEAD, *(row(name, found[name]) for name in table), ""]
    return "\n".join(parts)


def columns(result: Result, what: str, every: int = THIN) -> Array:
    """Return x and z of "foot" or "target" [m], thinned, (n, 2)."""
    return np.stack([result.record[f"{what}_{axis}"][::every] for axis in "xz"], axis=-1)


def draw_path(ax: Axes, result: Result, title: str) -> None:
    """Draw the foot's path, coloured by time, over its targets."""
    from matplotlib.collections import LineCollection

    ax.plot(*columns(result, "target").T, color="#bbbbbb", lw=4.0, solid_capstyle="round")
    foot = columns(result, "foot")
    time = result.record["time"][::THIN]
    starts = np.arange(0, len(foot) - 1, 5)  # pieces of 50 ms
    coloured = LineCollection(
        [foot[k : k + 6] for k in starts],
        array=np.minimum(time[starts], LINES),
        cmap="plasma",
        clim=(0.0, 1.1 * LINES),  # its last tenth is too pale for the page
        lw=1.5,
        rasterized=True,
    )
    ax.add_collection(coloured)
    ax.plot(*foot[-1], "o", ms=5, mfc="white", mec="#333333")
    rms = 1e3 * result.metrics["tracking"]["rms"]
    ax.set_title(f"{title}: {rms:.3g} mm RMS", fontsize=9)


def draw_moved(ax: Axes, result: Result) -> None:
    """Draw the moved path, with what was asked for."""
    asked = result.scenario.path.at(result.record["time"][::THIN]).position
    ax.plot(*asked.T, ":", color="#555555", lw=1.0)
    draw_path(ax, result, "moved, kp = 150")
    ax.text(0.75, 0.37, "asked for", fontsize=8, color="#555555", ha="center", va="top")


def draw_slow(ax: Axes, found: dict[str, Outcome]) -> Result:
    """Draw the schedule's path, and the PD's until it left it; return that shortened run."""
    error = found["PD"]
    schedule = found["schedule"]
    assert isinstance(error, DivergedError)
    assert isinstance(schedule, Result)
    draw_path(ax, schedule, "schedule at 10 ms")
    _, *settings = TABLES["A control period of 10 ms"]["PD"]
    short = rollout.run(scenario(PD, *settings, f"duration={error.time}"))
    foot = columns(short, "foot", 1)
    ax.plot(*foot.T, color="#2b8a3e", lw=1.0)
    ax.plot(*foot[-1], "x", color="#2b8a3e")
    ax.text(0.35, 0.3, "PD (150, 5)", fontsize=8, color="#2b8a3e", ha="right", va="top")

    return short


def draw_errors(ax: Axes, results: dict[str, Result]) -> None:
    """Draw the foot's distance from its target over time."""
    for (name, result), colour in zip(
        results.items(), ("#1f77b4", "#e67e22", "#2b8a3e", "#c0392b"), strict=True
    ):
        error = 1e3 * tracking_error(result.record)
        time = result.record["time"]
        ax.semilogy(time, error, color=colour, lw=1.0, label=name, rasterized=True)
    ax.set(xlim=(0.0, LINES + 0.5), ylim=(1e-2, 2e4), xlabel="time [s]")
    ax.set_title("foot off its target [mm]", fontsize=9)
    ax.legend(fontsize=7, ncols=2, loc="upper right", handlelength=1.0)
    ax.grid(color="#dddddd", linewidth=0.6)


def draw(found: dict[str, Outcome], out: Path) -> None:
    """Draw the study's three gains, the moved path, and the schedule against the PD."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams.update({"svg.hashsalt": "fivebar", "svg.fonttype": "none", "font.size": 9})
    held = {name: outcome for name, outcome in found.items() if isinstance(outcome, Result)}
    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    axes = figure.subplots(2, 3)

    for ax, kp in zip(axes[0], (5, 50, 150), strict=True):
        draw_path(ax, held[f"kp = {kp}"], f"kp = {kp}")

    draw_moved(axes[1, 0], held["moved, kp = 150"])
    short = draw_slow(axes[1, 1], found)
    for ax, left in zip(axes.flat[:5], (-0.55, -0.55, -0.55, -0.15, -0.55), strict=True):
        ax.set(xlim=(left, left + 1.03), ylim=(0.16, 0.7), xlabel="x [m]", ylabel="z [m]")
        ax.set_aspect("equal")
        ax.grid(color="#dddddd", linewidth=0.6)

    draw_errors(
        axes[1, 2],
        {
            "PD, 1 ms": held["kp = 150"],
            "PD, 10 ms, 1 N m": held["PD, limited"],
            "PD, 10 ms": short,
            "schedule, 10 ms": held["schedule"],
        },
    )
    figure.colorbar(axes[0, 0].collections[0], ax=axes, label="time [s]", ticks=range(5))
    figure.savefig(out, dpi=200, metadata={"Date": None})


def main() -> None:
    """Run, print and draw."""
    found = outcomes()
    print(report(found))
    draw(found, OUT)
    print(f"wrote {OUT.name}")


if __name__ == "__main__":
    main()
