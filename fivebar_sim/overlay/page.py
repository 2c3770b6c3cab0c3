"""The HTML page of a comparison: log over run, what is apart, what explains it."""

from __future__ import annotations

import math
import os
from pathlib import Path
from urllib.parse import quote

from fivebar_sim import units
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.overlay.compare import UNITS, Channel, Compared, Judged
from fivebar_sim.report import draw, html, look
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.look import colour

SCALES = {
    "rad": (57.29577951308232, "deg"),
    "m": (1e3, "mm"),
    "N m": (1e3, "mN m"),
    "A": (1e3, "mA"),
}
"""What numbers are shown in."""

TITLES = {
    "theta": ("Angles", "the motors' angles"),
    "torque": ("Torques", "the motors' torques"),
    "current": ("Currents", "the motors' currents"),
}


def write(
    found: Compared, limits: list[Judged], place: Path, recording: Path | None = None
) -> None:
    """Write the page of a comparison.

    Args:
        found: The comparison.
        limits: Its limits.
        place: A file that ends in .html.
        recording: Its Rerun recording, which the page links; None for none.

    Raises:
        ConfigError: The place does not end in .html, or cannot be written.
    """
    if place.suffix.lower() != ".html":
        raise ConfigError(f"cannot write {place}: a page must end in .html")
    with look.project_style():
        link = "" if recording is None else link_to(recording, place)
        text = page(found, limits, figures(found), link)
    whole_file.write(place, text.encode("utf-8", "backslashreplace"))


def link_to(recording: Path, place: Path) -> str:
    """Return a paragraph with a link from a page to a recording."""
    # Both may be moved together: the way from one to the other stays.
    way = Path(os.path.relpath(recording.absolute(), place.absolute().parent)).as_posix()
    return (
        f'<p>Both legs move in <a href="{html.text(quote(way))}">{html.text(recording.name)}</a>, '
        "which <code>rerun</code> opens.</p>"
    )


def page(found: Compared, limits: list[Judged], drawn: list[Drawn], link: str = "") -> str:
    """Return the page with its figures and a link; call it within `look.project_style`."""
    name = Path(found.log.where).name
    how = "was sent the log's commands" if found.is_played else "ran the scenario's own motion"
    about = (
        f"The log {name} over a run of {found.scenario.name}, which {how}: the "
        f"{found.scenario.words}. The log is {shown(found.delay, 's')} later than the run; that is "
        f"taken out before the two are compared, in {len(found.time)} rows."
    )

    parts = [f"<header>\n<h1>{html.text(f'{name} over {found.scenario.name}')}</h1>"]
    if limits:
        ok = all(limit.ok for limit in limits)
        parts.append(f"<p>{html.judgement('pass' if ok else 'fail')}</p>")
    parts.append(f"<p>{html.text(about)}</p>{link}\n</header>")

    # What was mended while the log was read.
    parts += [f"<p>{html.text(f'Note: {said}.')}</p>" for said in found.log.remarks]
    if limits:
        parts.append(html.section("Limits", _limits(limits)))
    parts.append(html.section("How far apart", _apart(found)))
    parts.append(html.section("What explains it", _explained(found)))
    parts.append(html.section("Log over run", html.figures(drawn)))
    return html.page(f"{name} over {found.scenario.name}", parts)


def shown(value: float, unit: str) -> str:
    """Return a number as people read it: angles in degrees, lengths in mm."""
    if math.isnan(value):
        return "-"
    scale, name = SCALES.get(unit, (1.0, unit))
    return units.text(scale * value, name, 3)


def unit_of(key: str) -> str:
    """Return the unit of a key of `compare.KEYS`."""
    name, _, part = key.partition(".")
    if part == "explained":
        return ""
    return "s" if name == "delay" else UNITS[name]


def _limits(limits: list[Judged]) -> str:
    rows = []
    for limit in limits:
        unit = unit_of(limit.key)
        high = shown(limit.high, unit)
        bound = f"<= {high}" if limit.low == -math.inf else f"{shown(limit.low, unit)} to {high}"
        rows.append((html.key(limit.key), bound, shown(limit.value, unit), html.verdict(limit.ok)))
    return html.table("The model fits if all of these hold.", ("", "limit", "value", ""), rows)


def _apart(found: Compared) -> str:
    """Return the table of what is apart."""
    rows = []
    for name, channel in found.channels.items():
        parts = channel.parts
        numbers = [shown(parts[part], UNITS[name]) for part in ("rms", "bias", "max")]
        rows.append((name, *numbers, percent(parts["explained"])))
    head = ("", "RMS", "bias", "largest", "motion explained")
    return html.table("Log less run, the delay taken out.", head, rows, stacked=True)


def percent(part: float) -> str:
    """Return a part of 1 in percent."""
    return "-" if math.isnan(part) else f"{100.0 * part:.4g} %"


def _explained(found: Compared) -> str:
    """Return the table of what is left after each thing that explains a difference."""
    rows = []
    for name, channel in found.channels.items():
        unit = UNITS[name]
        gain = "-" if math.isnan(channel.gain) else f"{channel.gain:.4g}"
        numbers = [shown(value, unit) for value in left(channel)]
        rows.append((name, *numbers, gain))

    head = ("", "as logged", "delay out", "bias out", "gain out", "gain")

    caption = (
        "RMS of log less run, and what is left of it after the delay, the bias and a factor on "
        "the run's motion are taken out, one after the other. The last column but one is what the "
        "model does not explain."
    )
    return html.table(caption, head, rows, stacked=True)


def left(channel: Channel) -> tuple[float, float, float, float]:
    """Return the RMS of a difference: all, without delay, without bias too, without gain too."""
    parts = channel.parts
    bias = parts["bias"]
    varied = math.sqrt(max(parts["rms"] ** 2 - bias**2, 0.0))
    return channel.undelayed, parts["rms"], varied, channel.left


def figures(found: Compared) -> list[Drawn]:
    """Return the figures; call it within `look.project_style`."""
    drawn = [_foot(found)]
    for kind, (title, what) in TITLES.items():
        if f"{kind}_A" in found.channels and f"{kind}_E" in found.channels:
            drawn.append(_over_time(found, kind, title, what))
    return drawn


def _over_time(found: Compared, kind: str, title: str, what: str) -> Drawn:
    """Draw a quantity of both motors, log over run, and their difference below."""
    figure, panels = draw.panels(2, 1, 2, 1, height=6.4)
    scale, unit = SCALES[UNITS[f"{kind}_A"]]
    for k, motor in enumerate("AE"):
        channel = found.channels[f"{kind}_{motor}"]
        time = found.time if len(channel.log) == len(found.time) else _own_time(found, channel)
        above = panels[2 * k]
        draw.line(above, time, scale * channel.log, "ink", label="log" if k == 0 else None)
        draw.line(above, time, scale * channel.run, motor, label=f"run, {motor}")
        draw.line(panels[2 * k + 1], time, scale * channel.difference, "foot")
        above.set(ylabel=f"{motor} [{unit}]")
        panels[2 * k + 1].set(ylabel=f"log - run [{unit}]")

    figure.legend(loc="outside upper center", ncols=3)
    apart = " and ".join(
        shown(found.channels[f"{kind}_{motor}"].parts["rms"], UNITS[f"{kind}_{motor}"])
        for motor in "AE"
    )
    return Drawn(
        kind,
        title,
        f"The log over the run: {what}, and log less run below them. RMS of the difference: "
        f"{apart}.",
        f"Lines of {what} over time, log and run; RMS of the difference {apart}.",
        figure,
    )


def _own_time(found: Compared, channel: Channel):
    """Return times for a channel with fewer samples than rows: evenly over them."""
    import numpy as np

    return np.linspace(found.time[0], found.time[-1], len(channel.log))


def _foot(found: Compared) -> Drawn:
    """Draw the foot's way in the log and in the run."""
    figure, ax = draw.plane(4.2)
    x = found.channels["foot_x"]
    z = found.channels["foot_z"]
    ax.plot(1e3 * x.log, 1e3 * z.log, color=colour("ink"), lw=1.0, label="log")
    ax.plot(1e3 * x.run, 1e3 * z.run, color=colour("foot"), lw=1.0, label="run")
    figure.legend(loc="outside upper center", ncols=2)

    # Of both directions together.
    apart = math.hypot(x.parts["rms"], z.parts["rms"])
    return Drawn(
        "foot-path",
        "Foot path",
        f"The foot at the log's angles, by the scenario's link lengths, over the run's foot. RMS "
        f"distance: {shown(apart, 'm')}.",
        f"The foot's way in the log and in the run; RMS distance {shown(apart, 'm')}.",
        figure,
    )
