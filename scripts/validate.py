"""./.venv/bin/python scripts/validate.py [--quick]: MuJoCo against an independent reference.

Prints the tables of docs/validation.md and draws docs/validation.svg, in about two minutes; --quick
leaves out timesteps and places, and draws nothing. The measurements live in tests/validation_*.py.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import validation_air as air
import validation_chain as chain
import validation_flip as flip
import validation_friction as friction
import validation_stance as stance
from validation_air import Key

from fivebar_sim.control.servo import Servo
from fivebar_sim.integrator import Integrator
from fivebar_sim.regression.convergence import plans, study
from fivebar_sim.scenario import Scenario

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "validation.svg"
CONSOLE = Console(width=132)
HELD: tuple[tuple[str, Servo, Integrator, float], ...] = (
    ("stiff", flip.STIFF, "discrete", 1e-3),
    ("soft", flip.SOFT, "discrete", 1e-3),
    ("soft", flip.SOFT, "implicitfast", 2.5e-4),
)
COLOURS = ("#1f77b4", "#e6821e", "#2ca02c", "#8c564b", "#d62728", "#9467bd")
Errors = dict[Key, air.Error]


def show(title: str, columns: str, rows: list[list[str]]) -> None:
    """Print a table; columns are separated by |, the first one is text."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, column in enumerate(columns.split("|")):
        table.add_column(
            escape(column.strip()), justify="left" if i == 0 else "right", no_wrap=True
        )
    for row in rows:
        table.add_row(*row)
    CONSOLE.print(escape(title), table, sep="")


def percent(part: float) -> str:
    """Return a part of 1 as percent, three digits."""
    return f"{100.0 * part:.3g}"


def um(length: float) -> str:
    """Return metres as micrometres, three digits."""
    return f"{1e6 * length:.3g}" if length < 0.999e-3 else f"{1e6 * length:.0f}"


def inverse_dynamics() -> None:
    """Print bar a."""
    found = {preset: chain.inverse_dynamics(preset) for preset in air.PRESETS}
    rows = [[preset, *(f"{error:.0e}" for error in errors)] for preset, errors in found.items()]
    show(
        "a. dynamics.inverse, 50 random motions and foot forces: largest relative difference",
        "preset | oracle | MuJoCo's open tree, loop eliminated",
        rows,
    )


def energy(timesteps: tuple[float, ...]) -> dict[str, chain.Swing]:
    """Print bar b; return what is drawn."""
    drawn = {"reference": chain.true_swing()}
    kept = drawn["reference"]
    rows = [["reference", "", f"{kept.ripple:.0e}", f"{kept.drift:.0e}", "0", "0"]]
    rate = float(chain.squared_rates().mean())

    for integrator in air.INTEGRATORS:
        for h in timesteps:
            swing = chain.swing(integrator, h)
            if h in (1e-3, 2.5e-4):
                drawn[f"{integrator}, {1e3 * h:g} ms"] = swing
            told = rate * h if integrator == "discrete" else 0.0
            parts = [percent(swing.ripple), percent(swing.drift)]
            rows.append([integrator, f"{1e3 * h:g}", *parts, f"{swing.decay:.3g}", f"{told:.3g}"])

    show(
        "b. energy of classic on undamped springs, 10 s, in parts of what swings",
        "integrator | h [ms] | first 0.1 s [%] | first to last second [%] | decay [1/s] | w^2 h",
        rows,
    )
    return drawn


def convergence(timesteps: tuple[float, ...]) -> Errors:
    """Print bar c and the air part of d."""
    found: Errors = {}
    for preset in air.PRESETS:
        found |= air.measure(
            [
                Key(preset, integrator, law, h)
                for integrator in air.INTEGRATORS
                for law in air.FEEDFORWARDS
                for h in timesteps
            ]
        )

    series = list(dict.fromkeys(key._replace(timestep=0.0) for key in found))
    rows = []
    for kind in series:
        errors = {h: found[kind._replace(timestep=h)] for h in timesteps}
        feet = {h: e.foot for h, e in errors.items()}
        cells = [um(foot) if foot > 1e-8 else f"{1e6 * foot:.1g}" for foot in feet.values()]
        orders = [
            air.order({h: getattr(e, name) for h, e in errors.items()})
            for name in ("foot", "late", "start", "gap")
        ]
        rows.append([", ".join(kind[:3]), *cells, *(f"{p:.2f}" for p in orders)])

    steps = " | ".join(f"{1e3 * h:g} ms" for h in timesteps)
    show(
        "c. foot off the oracle's [um], and orders in h of foot, torque (late, start) and loop gap",
        f"preset, integrator, feedforward | {steps} | foot | late | start | gap",
        rows,
    )
    rows = []
    for kind in series:
        e, last = (found[kind._replace(timestep=h)] for h in (1e-3, min(timesteps)))
        parts = [percent(p) for p in (e.rms, e.late, e.start, last.late, e.sensor, last.sensor)]
        rows.append([", ".join(kind[:3]), *parts, percent(e.share), um(e.gap)])

    show(
        f"c, d. motor torque in the air at 1 ms (fine: at {1e3 * min(timesteps):g} ms), worse "
        "of A and E, in % of the oracle's RMS",
        "run | RMS | late | start | late, fine | sensor | sensor, fine | share [pp] | gap [um]",
        rows,
    )
    return found


def squats(timesteps: tuple[float, ...]) -> None:
    """Print the stance part of d."""
    rows = []
    for preset in stance.HANGING:
        steps = timesteps if preset == "classic" else (1e-3,)
        keys = [(Key(preset, i, "velocity", h), False) for i in air.INTEGRATORS for h in steps]
        keys += [(Key(preset, "discrete", "velocity", h), True) for h in (1e-3, min(timesteps))]
        for key, hard in keys:
            e = stance.measure(key, hard=hard)
            cells = [percent(p) for p in (e.rms, e.late, e.force)]
            lengths = [um(x) for x in (e.depth, e.hip, e.foot_x, e.gap)]
            name = f"{preset}, {key.integrator}" + (", hard contact" if hard else "")
            rows.append([name, f"{1e3 * key.timestep:g}", *cells, *lengths])

    show(
        "d. squat on a frictionless floor: torque and N in % of the oracle's RMS, lengths in um",
        "run | h [ms] | RMS | late | N | sunk in | hip, rest | foot x | gap",
        rows,
    )
    rows = []
    for impratio in (100, 1000, 10000):
        g = stance.grip(Key("classic", "discrete", "velocity", 1e-3), impratio)
        off = 100 * g.side_off / g.side
        cells = [percent(g.error.rms), percent(g.error.late), f"{g.side:.2f}", f"{off:.1f}"]
        rows.append([f"classic, impratio = {impratio}", *cells, f"{1e6 * g.creep:.0f}"])

    show(
        "d. squat with friction 1, discrete, 1 ms, against a ball that rolls without slip",
        "run | RMS [%] | late [%] | side force [N] | off [%] | creep [um/s]",
        rows,
    )


def with_friction() -> None:
    """Print the part of bar d that a contact with friction decides, and real servos."""
    runs = {
        "discrete, 1 ms": friction.mujoco("discrete", 1e-3, stance.DURATION),
        "discrete, 1 ms, impratio 100": friction.mujoco(
            "discrete", 1e-3, stance.DURATION, impratio=100.0
        ),
        "discrete, 1 ms, noslip_iterations 3": friction.mujoco(
            "discrete", 1e-3, stance.DURATION, noslip=3
        ),
        "implicitfast, 1 ms": friction.mujoco("implicitfast", 1e-3, stance.DURATION),
        "implicitfast, 0.1 ms": friction.mujoco("implicitfast", 1e-4, stance.DURATION),
        "implicitfast, 0.1 ms, impratio 100": friction.mujoco(
            "implicitfast", 1e-4, stance.DURATION, impratio=100.0
        ),
        "implicitfast, 0.1 ms, noslip_iterations 3": friction.mujoco(
            "implicitfast", 1e-4, stance.DURATION, noslip=3
        ),
        "discrete, 0.0625 ms, hard, impratio 1e4": friction.mujoco(
            "discrete", 6.25e-5, stance.DURATION, impratio=1e4, hard=True
        ),
        "springs of 2e4 N/m": friction.coulomb(stance.DURATION, 2e4, 20.0),
        "springs of 1e6 N/m": friction.coulomb(stance.DURATION, 1e6, 100.0),
    }
    known = friction.coulomb(stance.DURATION, 4e6, 300.0)
    rows = []
    for name, found in {**runs, "springs of 4e6 N/m": known}.items():
        off = [f"{100 * (x / y - 1):+.1f}" for x, y in zip(found, known, strict=True)]
        load = [f"{100 * found.share:.1f}", f"{1e3 * found.A:.1f}", f"{1e3 * found.E:.1f}"]
        rows.append([name, *load, *off])

    show(
        "d. squat with friction 1: A's share [%], RMS torques [mN m], and what they are off [%]",
        "contact | share | A | E | share off | A off | E off",
        rows,
    )
    keys = ("load.torque_rms.A", "load.torque_rms.E", "load.share_A", "tracking.rms")
    rows = []
    for name in ("q8bot-xl330", "hobby-servo-circle"):
        found = study(plans(Scenario.load(name), 4, "discrete")).metrics
        rows.append([name, *(percent(found[key].error or 0.0) for key in keys)])

    show(
        "d. bus, gear friction and torque-speed line: off what timesteps down to 1/16 ms go to [%]",
        "scenario, 1 ms | A RMS | E RMS | share | tracking RMS",
        rows,
    )


def at_rest() -> None:
    """Print bars e and f."""
    rows = []
    for preset in stance.HANGING:
        cells = []
        for integrator in air.INTEGRATORS:
            for aside in (0.0, 0.1):
                tau, need, carried = stance.static(preset, integrator, aside)
                cells.append(percent(air.worst(tau - need) / air.worst(need)))
            cells.append(percent(abs(carried - 1.0)))
        rows.append([preset, *cells])

    show(
        "e. standing still, 1 ms [%]: torque off dynamics.inverse, N off the weight",
        "preset | discrete | aside | N | implicitfast | aside | N",
        rows,
    )
    gaps = {integrator: stance.gaps(integrator) for integrator in air.INTEGRATORS}
    rows = [[name, *(um(gaps[i][name]) for i in air.INTEGRATORS)] for name in gaps["discrete"]]
    show(
        "f. largest loop gap of classic at 1 ms [um]",
        "run | discrete | implicitfast",
        rows,
    )


def flips(cells: int) -> None:
    """Print bar g."""
    rows = []
    for preset in stance.HANGING:
        for name, servo, integrator, h in HELD:
            for up in (-1.0, 1.0):
                c = flip.push(preset, up, servo, integrator, h, cells)
                where = "; ".join(f"{1e3 * x:.0f} {1e3 * z:.0f}" for x, z in c.flipped)
                numbers = [c.places, c.assembly, c.mode, c.broken, f"{1e3 * c.moved:.2f}"]
                run = f"{preset}, {name}, {integrator}, {up * flip.FORCE:+.0f} N"
                rows.append([run, *map(str, numbers), um(c.gap), where])

    show(
        "g. 80 N at every reachable place: at how many the leg flips",
        "run | places | assembly | knee | broken | moved [mm] | gap [um] | flipped at [mm]",
        rows,
    )
    rows = []
    for preset in stance.HANGING:
        for integrator in air.INTEGRATORS:
            m = stance.drop(preset, integrator).metrics
            gap = um(m["closure"]["max"])
            force = f"{m['ground']['force_max']['z']:.0f}"
            rows.append([f"{preset}, {integrator}", str(m["branch"]["flips"]), gap, force])

    show("g. landing from 50 cm, 1 ms", "run | flips | gap [um] | N max [N]", rows)


def draw(errors: Errors, swings: dict[str, chain.Swing]) -> None:
    """Draw the foot's error over the timestep, and the energy over time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams.update({"svg.hashsalt": "fivebar", "svg.fonttype": "none", "font.size": 9})
    figure = Figure(figsize=(10.0, 6.6), layout="constrained")
    grid = figure.add_gridspec(2, 3)
    for column, law in enumerate(air.FEEDFORWARDS):
        ax = figure.add_subplot(grid[0, column])
        for preset, colour in zip(air.PRESETS, COLOURS, strict=True):
            for integrator, style in zip(air.INTEGRATORS, ("o-", "x--"), strict=True):
                feet = [1e6 * errors[Key(preset, integrator, law, h)].foot for h in air.TIMESTEPS]
                label = preset if integrator == "discrete" else None
                steps = [1e3 * h for h in air.TIMESTEPS]
                ax.loglog(steps, feet, style, color=colour, ms=3.5, lw=1.0, label=label)
        ax.set(title=f'feedforward "{law}"', xlabel="timestep [ms]")
        ax.set_xticks([1e3 * h for h in air.TIMESTEPS], [f"{1e3 * h:g}" for h in air.TIMESTEPS])
        ax.minorticks_off()
        ax.grid(color="#dddddd", linewidth=0.6)
        if column == 0:
            ax.set_ylabel("foot off the reference [um]")
            ax.legend(fontsize=7, title="o discrete, x implicitfast", title_fontsize=7)

    ax = figure.add_subplot(grid[1, :])
    for (name, swing), colour in zip(swings.items(), COLOURS, strict=False):
        block = round(0.05 / float(swing.time[1] - swing.time[0]))
        means = swing.energy[: len(swing.energy) // block * block].reshape(-1, block).mean(axis=1)
        ax.plot(0.05 * (np.arange(len(means)) + 0.5), means, color=colour, lw=1.0, label=name)

    ax.set(title="energy on undamped springs, means of 50 ms", xlabel="time [s]")
    ax.set_ylabel("part of the start's")
    ax.set_ylim(0.0, 1.4)
    ax.grid(color="#dddddd", linewidth=0.6)
    ax.legend(fontsize=8, ncols=len(swings), loc="upper right")
    figure.savefig(OUT, metadata={"Date": None})
    print(f"wrote {OUT.relative_to(ROOT)}")


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description="Compare MuJoCo with an independent reference.")
    parser.add_argument("--quick", action="store_true", help="fewer timesteps and places")
    quick = parser.parse_args().quick
    steps = (1e-3, 5e-4) if quick else air.TIMESTEPS
    inverse_dynamics()
    swings = energy(steps)
    errors = convergence(steps)
    squats(steps)
    with_friction()
    at_rest()
    flips(6 if quick else 14)

    if not quick:
        draw(errors, swings)


if __name__ == "__main__":
    main()
