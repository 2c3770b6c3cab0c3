"""`fivebar import`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe
from fivebar_sim.errors import ConfigError

if TYPE_CHECKING:
    from fivebar_sim.formats.incoming.understood import Understood


def import_(
    file: Positional[Annotated[Path, arg(metavar="FILE")]],
    /,
    *,
    out: Annotated[Maybe[Path], arg(metavar="LEG.toml")] = None,
    picture: Annotated[Maybe[Path], arg(metavar="SVG|PNG")] = None,
    motors: Annotated[Maybe[str], arg(metavar="A,E")] = None,
    foot: Annotated[Maybe[str], arg(metavar="NAME")] = None,
    closures: Annotated[Maybe[Path], arg(metavar="YAML")] = None,
    loop: Annotated[Maybe[str], arg(metavar="NAME")] = None,
) -> int:
    """Understand the five-bar leg of an MJCF or URDF, as a preset.

    What each part of the file is to a leg is printed, and what could not be taken over.
    docs/how-to/bring-a-model.md has examples.

    Args:
        file: An MJCF whose loop an equality connect or weld closes, or a URDF with a YAML of its
            closures beside it.
        out: The preset; without it nothing is written.
        picture: Where the leg is drawn as it was understood, .svg, .png or .pdf.
        motors: The driven joints, or their actuators, A first (default: the joints with motors, A
            left of E).
        foot: The site, geom or body that is the foot (default: one with foot in its name, else what
            is farthest from the knee).
        closures: The YAML of a URDF's closed loops (default: the one of its name beside it).
        loop: Which loop, where there are several: the equality's name, or a link of the pair.
    """
    from fivebar_sim.files import whole_file
    from fivebar_sim.formats.incoming import picture as drawing
    from fivebar_sim.formats.incoming import preset
    from fivebar_sim.formats.incoming.understood import understand

    if out is not None and out.suffix != ".toml":
        raise ConfigError(f"cannot write {out}: the preset must end in .toml")
    if picture is not None:
        drawing.check(picture)
    seen = understand(file, closures=closures, motors=_pair(motors), foot_name=foot, loop_name=loop)
    _print(seen)
    if picture is not None:
        drawing.write(seen, picture)
        print(f"drawn in {picture}")  # noqa: T201
    if out is not None:
        whole_file.write(out, preset.text(seen))
        print(f"{seen.leg.name}: written as a preset to {out}")  # noqa: T201
    return 0


def _pair(motors: str | None) -> tuple[str, str] | None:
    """Return the names of two motors."""
    if motors is None:
        return None
    names = [name.strip() for name in motors.split(",")]
    if len(names) != 2 or not all(names):
        raise ConfigError(f"--motors takes two names, A,E; got {motors!r}")
    return names[0], names[1]


def _print(seen: Understood) -> None:
    """Print what was understood as a table, then what was not taken over."""
    from rich.markup import escape
    from rich.table import Table

    from fivebar_sim.cli.common import screen
    from fivebar_sim.cli.console import WIDEST
    from fivebar_sim.formats.incoming import preset

    table = Table(title=escape(f"{seen.source.path.name} as a five-bar leg"))
    for head in ("part", "in the file", "understood as"):
        table.add_column(head)
    for row in preset.rows(seen):
        table.add_row(*map(escape, row))
    console = screen()
    # A pipe or a file has no width; rich would assume 80 columns and break lines.
    if not console.is_terminal:
        console.width = WIDEST
    console.print(table)
    for note in preset.notes(seen):
        console.print(escape(f"not taken over: {note}"), soft_wrap=True)
