"""./.venv/bin/python scripts/load_sharing.py: motor torques of five-bar and serial legs in a gait.

The same foot path and the same ground force for every leg: prints the tables of docs/load.md and
draws docs/load-sharing.svg.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from matplotlib.axes import Axes

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.two_link import SerialLeg
from fivebar_sim.metrics import load
from fivebar_sim.paths import Gait

OUT = Path(__file__).resolve().parent.parent / "docs" / "load-sharing.svg"
STEPS = 2000  # of a gait period
GAIT = Gait(centre=(0.0, -0.080), stride=0.040, lift=0.015, frequency=2.0, duty=0.5, ramp=0.0)
FAST = 5.0  # [Hz]
PUSH = 10.0  # [N], largest vertical ground force: a quadruped of 1.3 kg at this duty
LOADS = {  # horizontal / vertical force, and the largest horizontal one [N] that brakes and drives
    "straight up": (0.0, 0.0),
    "brakes, then drives": (0.0, 2.0),
    "uphill": (0.2, 0.0),
    "downhill": (-0.2, 0.0),
}
SLOPES = np.linspace(-0.6, 0.6, 49)
LIMITS = (0.2, 0.4, 0.6)
SERIAL = "serial, knee back"

Motors = tuple[Array, Array]
"""Angles [rad] and torques [N m] of the two motors, (n, 2) each."""


class Cycle(NamedTuple):
    """A gait period in half steps: every step has its ends and its middle; n = 2 STEPS + 1.

    Attributes:
        path: The gait.
        foot: [m], (n, 2); foot_dot and foot_ddot are its rates.
        stands: Whether the foot stands, (n,).
        cycle: Time since touch-down in periods, in [0, 1), (n,).
    """

    path: Gait
    foot: Array
    foot_dot: Array
    foot_ddot: Array
    stands: Bools
    cycle: Array

    @classmethod
    def of(cls, path: Gait) -> Cycle:
        """Return a period, from the middle of a stance to that of the next."""
        time = np.linspace(0.0, path.period, 2 * STEPS + 1)
        return cls(path, *path.at(time), path.in_stance(time), path.cycle(time))

    def force(self, slope: float = 0.0, shear: float = 0.0) -> Array:
        """Return the ground's force on the foot [N], (n, 2), zero in swing.

        z = PUSH sin(pi s),   x = slope z - shear sin(2 pi s),   s from 0 to 1 in the stance
        """
        s = self.cycle / self.path.duty
        z = PUSH * np.sin(np.pi * s)
        force = np.stack([slope * z - shear * np.sin(2.0 * np.pi * s), z], axis=-1)
        return np.where(self.stands[:, None], force, 0.0)

    def measure(self, motors: Motors) -> dict[str, Any]:
        """Return the load, with the torques in the middle of each step."""
        theta, torque = motors
        return load.measure(
            torque[1::2],
            theta[::2],
            self.path.period / STEPS,
            stance=self.stands[1::2],
            phase=self.cycle[1::2],
        )


Hold = Callable[[Array, Array], Motors]
"""(foot, force) -> what holds the force at the foot, the links at rest and without weight."""


def five_bar(leg: FiveBar) -> Hold:
    """Return a five-bar's: tau = -J^T F."""

    def hold(foot: Array, force: Array) -> Motors:
        theta = np.unwrap(kinematics.inverse(leg, foot), axis=0)
        return theta, dynamics.statics(leg, theta, force)

    return hold


def serial(knee: int, *, belt: bool) -> Hold:
    """Return that of the serial leg with classic's links; a belt's motor turns with the tibia."""
    leg = SerialLeg(CLASSIC.L1, CLASSIC.L2, knee)

    def hold(foot: Array, force: Array) -> Motors:
        theta = np.unwrap(leg.inverse(foot), axis=0)
        motors = np.cumsum(theta, axis=-1) if belt else theta
        return motors, leg.static_torques(theta, force, belt=belt)

    return hold


CLASSIC = FiveBar.load("classic")
EXTENDED = FiveBar.load("extended")
LEGS = {
    "classic": five_bar(CLASSIC),
    "extended": five_bar(EXTENDED),
    SERIAL: serial(-1, belt=False),
    "serial, knee forward": serial(1, belt=False),
    "belt, knee back": serial(-1, belt=True),
    "belt, knee forward": serial(1, belt=True),
}
DRAWN = {
    "classic": "#1f77b4",
    "extended": "#8c6bb1",
    SERIAL: "#c0392b",
    "belt, knee back": "#e67e22",
}


def heat(measured: dict[str, Any]) -> float:
    """Return the mean of tau_A^2 + tau_E^2 [(N m)^2]."""
    return sum(rms**2 for rms in measured["torque_rms"].values())


def work(measured: dict[str, Any], sign: str) -> float:
    """Return the work of both motors [J]: "positive", "negative" or "net"."""
    return sum(motor[sign] for motor in measured["work"].values())


HEAD = """\
                      peak A    E  RMS A    E   heat  share A heat A  work +   net  against transfer
                        [mN m]      [mN m]    [1e-3]       [%]           [mJ]        [%]     [mJ]"""


def row(name: str, m: dict[str, Any]) -> str:
    """Return one line of a table."""
    peak = m["torque_peak"]
    rms = m["torque_rms"]
    opposing = m["opposing"]
    net = round(1e3 * work(m, "net"), 1) + 0.0  # no -0.0
    return (
        f"{name:22s}{1e3 * peak['A']:6.0f}{1e3 * peak['E']:5.0f}{1e3 * rms['A']:7.0f}"
        f"{1e3 * rms['E']:5.0f}{1e3 * heat(m):7.1f}{100 * m['share_A']:9.1f}"
        f"{100 * m['thermal_share_A']:7.1f}{1e3 * work(m, 'positive'):8.1f}{net:6.1f}"
        f"{100 * opposing['fraction']:9.0f}{1e3 * opposing['energy']:9.1f}"
    )


def held(gait: Cycle) -> str:
    """Return the table of the legs at rest in every pose, over the stance."""
    lines = ["In stance, the links without weight and inertia", HEAD]
    off = 0.0
    for title, (slope, shear) in LOADS.items():
        lines.append(title)
        world = slope * PUSH * GAIT.stride * 2.0 / np.pi  # -integral F . dx, none of it by shear
        for name, hold in LEGS.items():
            measured = gait.measure(hold(gait.foot, gait.force(slope, shear)))["stance"]
            lines.append(row(f"  {name}", measured))
            off = max(off, abs(work(measured, "net") - world))
    lines.append(f"The net work is -integral F . dx for every leg: off by {1e3 * off:.0e} mJ.")
    return "\n".join(lines)


def in_motion(leg: FiveBar, gait: Cycle) -> Motors:
    """Return the motors of a five-bar under the force straight up, weight and inertia included."""
    motion = kinematics.joint_motion(leg, gait.foot, gait.foot_dot, gait.foot_ddot)
    q, rate, acceleration = (values[:, ::2] for values in motion)
    return np.unwrap(q, axis=0), dynamics.inverse(leg, q, rate, acceleration, gait.force())


def moving() -> str:
    """Return the tables of the five-bars over whole periods, at rest and in motion."""
    lines = ["Over the whole period, force straight up", HEAD]
    shares = ["Share of A in eighths of the period from touch-down [%]"]
    fast = msgspec.structs.replace(GAIT, frequency=FAST)
    for name, leg in (("classic", CLASSIC), ("extended", EXTENDED)):
        still = Cycle.of(GAIT)
        lines.append(row(f"{name}, at rest", still.measure(LEGS[name](still.foot, still.force()))))
        for path in (GAIT, fast):
            gait = Cycle.of(path)
            measured = gait.measure(in_motion(leg, gait))
            title = f"{name}, {path.frequency:g} Hz"
            lines.append(row(title, measured))
            parts = measured["phase"]["share_A"]
            shares.append(f"{title:22s}" + "".join(f"{100 * part:6.1f}" for part in parts))

    return "\n".join([*lines, *shares])


def draw_stance(ax: Axes, gait: Cycle) -> None:
    """Draw both motors' torques over the stance, classic against serial."""
    stands = gait.stands
    s = gait.cycle[stands] / gait.path.duty
    order = np.argsort(s)
    for name, motors in (("classic", ("A", "E")), (SERIAL, ("hip", "knee"))):
        torque = 1e3 * LEGS[name](gait.foot, gait.force())[1][stands][order]
        for side, (motor, style) in enumerate(zip(motors, ("-", "--"), strict=True)):
            label = f"{name.split(',')[0]}: {motor}"
            ax.plot(100 * s[order], torque[:, side], style, color=DRAWN[name], label=label)
    ax.set(title="force straight up", xlabel="stance [%]", ylabel="torque [mN m]")
    ax.set_ylim(top=480.0)  # room for the legend
    ax.legend(fontsize=8, ncols=2)


def over_slopes(gait: Cycle) -> dict[str, Array]:
    """Return of every leg the larger peak [N m] and the heat [(N m)^2] at all SLOPES, (2, n)."""
    found = {}
    for name, hold in LEGS.items():
        stances = [gait.measure(hold(gait.foot, gait.force(s)))["stance"] for s in SLOPES.tolist()]
        found[name] = np.array([[max(m["torque_peak"].values()), heat(m)] for m in stances]).T
    return found


def worst(found: dict[str, Array]) -> str:
    """Return the table of the worst direction of force, within limits to both sides."""
    lines = [
        "Worst direction of the force with |x / z| up to:",
        f"{'':22s}peak [mN m], heat [1e-3 (N m)^2]",
    ]
    for name, values in found.items():
        cells = []
        for limit in LIMITS:
            within = np.abs(SLOPES) <= limit + 1e-9
            peak, most = 1e3 * values[:, within].max(axis=1)
            cells.append(f"{limit:.1f}: {peak:4.0f} {most:6.1f}")
        lines.append(f"{name:22s}" + "    ".join(cells))

    for what, more in zip(
        ("a higher peak", "more heat"), found["classic"] - found[SERIAL], strict=True
    ):
        k = np.flatnonzero(np.diff(np.sign(more)))
        roots = SLOPES[k] - more[k] * (SLOPES[k + 1] - SLOPES[k]) / (more[k + 1] - more[k])
        ends = " and ".join(f"{root:.2f}" for root in roots)
        lines.append(f"classic has {what} than {SERIAL} only for x / z between {ends}.")
    return "\n".join(lines)


def draw_slopes(peaks: Axes, heats: Axes, found: dict[str, Array]) -> None:
    """Draw the larger peak and the heat over the direction of the force."""
    for name, colour in DRAWN.items():
        peaks.plot(SLOPES, 1e3 * found[name][0], color=colour)
        heats.plot(SLOPES, 1e3 * found[name][1], color=colour, label=name)
    peaks.set(title="larger peak of the two", xlabel="force, x / z", ylabel="torque [mN m]")
    heats.set(title="heat of both", xlabel="force, x / z", ylabel="tau^2 [1e-3 (N m)^2]")
    heats.legend(fontsize=8)
    for ax in (peaks, heats):
        ax.set_ylim(bottom=0.0)


def draw(gait: Cycle, found: dict[str, Array], out: Path) -> None:
    """Draw the three panels."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams.update({"svg.hashsalt": "fivebar", "svg.fonttype": "none", "font.size": 9})
    figure = Figure(figsize=(10.0, 3.4), layout="constrained")
    axes = figure.subplots(1, 3)
    draw_stance(axes[0], gait)
    draw_slopes(axes[1], axes[2], found)
    for ax in axes:
        ax.grid(color="#dddddd", linewidth=0.6)
    figure.savefig(out, metadata={"Date": None})


def main() -> None:
    """Measure, print and draw."""
    gait = Cycle.of(GAIT)
    found = over_slopes(gait)
    print(f"{held(gait)}\n\n{worst(found)}\n\n{moving()}")
    draw(gait, found, OUT)
    print(f"wrote {OUT.name}")


if __name__ == "__main__":
    main()
