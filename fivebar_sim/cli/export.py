"""`fivebar export`."""

from __future__ import annotations

from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.errors import ConfigError


def export(
    leg: Positional[Annotated[str, arg(metavar="LEG")]],
    /,
    *,
    c: Annotated[str | None, arg(metavar="DIR")] = None,
) -> int:
    """Write a leg as a C library for a microcontroller.

    docs/firmware.md has what the library can do.

    Args:
        leg: A preset's name or a leg's TOML file.
        c: Folder for fivebar_leg.h, fivebar_leg.c, an example sketch and what Arduino and
            PlatformIO ask for. An earlier export there is replaced.
    """
    from fivebar_sim.firmware import export as firmware_export
    from fivebar_sim.geometry import FiveBar

    if c is None:
        raise ConfigError("say what to export: --c DIR")
    chosen = FiveBar.load(leg)
    place = firmware_export.write(chosen, c)
    print(f"{chosen.name}: written as C to {place}")  # noqa: T201
    return 0
