"""`fivebar list`."""

from __future__ import annotations

import inspect
import shutil
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.errors import ConfigError, unknown

SHIPPED = {
    "scenarios": ("scenarios", "fivebar run NAME"),
    "legs": ("models/legs", '[leg] preset = "NAME", fivebar workspace NAME'),
    "servos": ("models/servos", '[servo] preset = "NAME"'),
    "robots": ("models/robots", 'Robot.load("NAME")'),
}
"""Kinds that are files: their folder, and what their names are for."""

CLASSES = {
    "paths": '[path] kind = "NAME"',
    "controllers": '[controller] name = "NAME"',
}
"""Kinds that are classes, the shipped ones and those of other packages."""

WHATS = (*SHIPPED, *CLASSES)


def list(what: Positional[Annotated[str, arg(metavar="[KIND]")]] = "", /) -> int:
    """List scenarios, legs, servos, robots, paths and controllers.

    Args:
        what: One of these kinds; by default all of them.
    """
    if what and what not in WHATS:
        raise ConfigError(unknown("kind", what, WHATS))
    for kind in (what,) if what else WHATS:
        use = SHIPPED[kind][1] if kind in SHIPPED else CLASSES[kind]
        print(f"{kind}: {use}")  # noqa: T201
        _print(_files(SHIPPED[kind][0]) if kind in SHIPPED else _classes(kind))
    return 0


def _print(found: Mapping[str, str]) -> None:
    """Print names, each with what it is, beside each other."""
    widest = max(map(len, found), default=0)
    indent = " " * (widest + 4)
    columns = max(shutil.get_terminal_size().columns, 60)
    for name, about in found.items():
        line = f"  {name:{widest}}  {about}"
        print(textwrap.fill(line, columns, subsequent_indent=indent))  # noqa: T201
    print()  # noqa: T201


def _files(folder: str) -> dict[str, str]:
    """Return shipped files by name, with the first sentence of the comment at their top."""
    from fivebar_sim.files import resources

    return {name: _comment(path) for name, path in resources.shipped(folder).items()}


def _comment(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return _sentence(" ".join(lines))


def _classes(kind: str) -> dict[str, str]:
    """Return classes by name, with the first sentence of their docstrings."""
    from fivebar_sim import control, paths

    if kind == "paths":
        found = paths.kinds()
    else:
        found = {name: control.find(name) for name in control.known()}
    about = {name: inspect.getdoc(each) or "" for name, each in found.items()}
    return {name: _sentence(about[name].split("\n\n")[0]) for name in sorted(about)}


def _sentence(text: str) -> str:
    """Return the first sentence of a text, on one line."""
    # What a docstring refers to is nowhere near here.
    plain = " ".join(text.split()).split("; see `")[0]
    end = plain.find(". ")
    return plain if end < 0 else plain[: end + 1]
