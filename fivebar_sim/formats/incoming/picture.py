"""Draws a leg as it was understood: links, joints with the file's names, masses, the foot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.formats.incoming.loop import hinge_name
from fivebar_sim.formats.incoming.understood import Understood
from fivebar_sim.render import palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = (".svg", ".png", ".pdf")

BESIDE = 14.0
"""Distance of a name from what it names [pt]."""


def check(out: Path) -> None:
    """Raise unless a picture can have the name.

    Raises:
        ConfigError: Another kind of file.
    """
    if out.suffix.lower() not in FORMATS:
        raise ConfigError(f"cannot draw {out}: the picture must end in {', '.join(FORMATS)}")


def write(seen: Understood, out: Path) -> None:
    """Draw a leg in its rest pose.

    Args:
        seen: The leg.
        out: The picture, .svg, .png or .pdf.

    Raises:
        ConfigError: An unknown kind of picture, or a file that cannot be written.
    """
    check(out)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    # A name with two $ is not a formula; text stays text.
    style: dict[Any, Any] = {
        "text.parse_math": False,
        "svg.fonttype": "none",
        "svg.hashsalt": "fivebar",
    }
    with rc_context(style), whole_file.stage(out) as place:
        figure = Figure(figsize=(7.0, 6.0), layout="constrained")
        _draw(figure.add_subplot(), seen)
        figure.savefig(place, dpi=150, metadata={"Date": None} if out.suffix == ".svg" else None)


def _colour(name: str) -> str:
    return palette.COLOURS[name].light


def _draw(ax: Axes, seen: Understood) -> None:
    """Draw the links, what is at their joints, and where their masses are."""
    leg = seen.leg
    q = kinematics.home(leg)
    p = kinematics.chain_points(leg, q)
    A, E = kinematics.bases(leg)
    middle = np.mean([A, p.B, p.C_left, p.D, E], axis=0)
    ax.plot(*(1e3 * np.array([A, E])).T, color=_colour("ink"), lw=5.0, solid_capstyle="round")
    spans = ((A, p.B, "A"), (p.B, p.C_left, "B"), (p.D, p.C_left, "D"), (E, p.D, "E"))
    for k, ((inner, outer, name), link) in enumerate(zip(spans, leg.links, strict=True)):
        ax.plot(*(1e3 * np.array([inner, outer])).T, color=_colour(name), lw=3.0)
        along = (outer - inner) / np.hypot(*(outer - inner))
        com = inner + link.com[0] * along + link.com[1] * np.array([-along[1], along[0]])
        label = "centres of mass" if k == 0 else None
        ax.plot(*(1e3 * com), "P", color=_colour("ink"), ms=7.0, mec="white", label=label)
        words = f"L{k + 1}  {1e3 * np.hypot(*(outer - inner)):.4g} mm, {1e3 * link.mass:.4g} g"
        at = 0.5 * (inner + outer)
        _write(ax, at, at - middle, words, _colour(name))

    if leg.L6 > 0.0:
        ax.plot(*(1e3 * np.array([p.C_left, p.F])).T, color=_colour("B"), lw=3.0)
    ax.plot(*(1e3 * p.F), "o", color=_colour("foot"), ms=10.0, label=f"foot: {seen.foot.name}")
    for k, at in enumerate((A, p.B, p.C_left, p.D, E)):
        ax.plot(*(1e3 * at), "o", color=_colour("ink"), mfc="white", ms=7.0)
        words = f"{'ABCDE'[k]}: {hinge_name(seen.source, seen.loop, k)}"
        away = at - middle
        # Coaxial motors are at one place: one name stands to the left and one to the right.
        if leg.L5 == 0.0 and k in (0, 4):
            away = np.array([-1.0 if k == 0 else 1.0, 1.5])
        _write(ax, at, away, words, _colour("ink"), weight="bold")

    ax.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]", title=f"{leg.name}, at rest")
    ax.margins(0.5, 0.15)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8, frameon=False)


def _write(
    ax: Axes, at: Array, away: Array, words: str, colour: str, *, weight: str = "normal"
) -> None:
    """Write beside a point, in a direction where no link is."""
    way = away / max(float(np.hypot(*away)), 1e-12)
    side = "left" if way[0] > 0.0 else "right"

    ax.annotate(
        words,
        (1e3 * float(at[0]), 1e3 * float(at[1])),
        (BESIDE * float(way[0]), BESIDE * float(way[1])),
        textcoords="offset points",
        color=colour,
        weight=weight,
        fontsize=9.0,
        ha=side,
        va="center",
    )
