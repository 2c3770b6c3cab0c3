"""Check that a window can open."""

from __future__ import annotations

import os
import sys

from fivebar_sim.errors import ConfigError


def check(instead: str) -> None:
    """Raise if no window can open.

    Args:
        instead: What works without a screen, for the message.

    Raises:
        ConfigError: The system is Linux, and neither DISPLAY nor WAYLAND_DISPLAY is set.
    """
    if sys.platform == "linux" and not any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    ):
        raise ConfigError(f"no screen here: neither DISPLAY nor WAYLAND_DISPLAY is set; {instead}")
