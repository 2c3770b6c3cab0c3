"""Write a leg's page: the files of this folder in one, with the leg's numbers."""

from __future__ import annotations

import base64
import json
import math
import re
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tomli_w

from fivebar_sim import firmware, kinematics
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources, whole_file
from fivebar_sim.geometry import FiveBar, read_table
from fivebar_sim.page.bundle import bundle
from fivebar_sim.render import palette

HERE = Path(__file__).resolve().parent

KEYS = ("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt")
"""The numbers that the sliders move."""

LARGEST = 10.0
"""Length of the force's arrow at its standard length [N]; it may be pulled twice as far."""

FORCE = (3.0, 5.0)
"""The first force on the foot [N], z away from the hip: its arrow does not lie on the leg."""

SOFT = {"grid": ("#dde1e6", "#31373f"), "wash": ("#e9edf0", "#23292f")}
"""Colours of what lies behind the lines, light and dark."""


def page(source: str | Path) -> str:
    """Return the page of a leg.

    Args:
        source: A preset's name or a leg's TOML file.

    Raises:
        ConfigError: An unknown or wrong leg.
        GeometryError: A leg that the firmware cannot hold, or without a pose on its branch.
    """
    leg = FiveBar.load(source)
    # Raises where the page's arithmetic cannot hold the leg.
    firmware.of(leg)
    # In JSON only "<" could end the script that holds it.
    begin = json.dumps(start(leg, source)).replace("<", "\\u003c")
    modules = {path.stem: path.read_text(encoding="utf-8") for path in HERE.glob("*.js")}
    parts = {
        "title": f"{escape(leg.name)}: a five-bar leg",
        "name": escape(leg.name),
        "written": f"Written by fivebar-sim {version('fivebar-sim')}.",
        "style": _filled(_read("page.css"), {"light": _variables(0), "dark": _variables(1)}),
        "start": begin,
        "wasm": base64.b64encode((HERE / "leg.wasm").read_bytes()).decode(),
        "script": bundle(modules, "main"),
    }
    return _filled(_read("page.html"), parts)


def write(source: str | Path, out: Path) -> None:
    """Write the page of a leg; the same leg gives the same bytes.

    Raises:
        ConfigError: An unknown or wrong leg, or a file that cannot be written.
    """
    if out.suffix.lower() != ".html":
        raise ConfigError(f"cannot write {out}: a page must end in .html")
    whole_file.write(out, page(source))


def _read(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8").strip()


def _filled(text: str, parts: dict[str, str]) -> str:
    """Return a text with its {{name}} replaced, each once: what is put in is not looked at."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], text)


def _variables(dark: int) -> str:
    """Return the colours as CSS variables, light (0) or dark (1)."""
    pairs = {"paper": palette.PAPER[:2], **{k: v[:2] for k, v in palette.COLOURS.items()}, **SOFT}
    return " ".join(f"--{name}: {pair[dark]};" for name, pair in pairs.items())


def start(leg: FiveBar, source: str | Path) -> dict[str, Any]:
    """Return what the script begins with."""
    preset = str(source) if str(source) in resources.shipped("models/legs") else None
    moved = {*KEYS, "mode", "assembly", "name"}
    rest = {key: value for key, value in read_table(source).items() if key not in moved}
    foot = kinematics.chain_points(leg, kinematics.home(leg)).F.tolist()
    return {
        "name": leg.name,
        "preset": preset,
        # The other keys of a leg's own file go into a scenario as they are.
        "rest": [] if preset else tomli_w.dumps(rest).splitlines(),
        "lengths": [getattr(leg, key) for key in KEYS],
        "signs": list(leg.mode),
        "foot": foot,
        "force": [FORCE[0], math.copysign(FORCE[1], foot[1])],
        "largest": LARGEST,
    }
