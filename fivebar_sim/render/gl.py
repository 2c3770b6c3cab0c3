"""A GL to draw with, without a screen: EGL, or else OSMesa; found by trying.

`mujoco.Renderer` takes the one that MUJOCO_GL named when mujoco was first imported, and without
that one that needs a screen. Here the context is chosen when it is asked for.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from functools import cache
from typing import Any

from fivebar_sim.errors import ConfigError

WAYS = {"egl": "libegl1", "osmesa": "libosmesa6"}
"""MuJoCo's names of what draws without a screen on Linux, the first is tried first; each with its
Debian package."""

TRIAL = """
import mujoco
from mujoco.{way} import GLContext
context = GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""


@cache
def works(way: str) -> bool:
    """Return whether one of `WAYS` draws here.

    It is tried in a process of its own: a failed one cannot be undone within a process, nor can
    a driver that crashes.
    """
    trial = [sys.executable, "-c", TRIAL.format(way=way)]
    try:
        return subprocess.run(trial, capture_output=True, timeout=60).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def find() -> str:
    """Return the first of `WAYS` that works; on other systems than Linux "native", MuJoCo's own.

    MUJOCO_GL may name one: then it is that one or none.

    Raises:
        ConfigError: None works; names the Debian packages.
    """
    if sys.platform != "linux":
        return "native"

    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    if asked in WAYS:
        if works(asked):
            return asked
        raise ConfigError(
            f"cannot draw: MUJOCO_GL={asked} does not work here; install the Debian package "
            f"{WAYS[asked]}, or unset MUJOCO_GL"
        )

    for way in WAYS:
        if works(way):
            return way

    raise ConfigError(
        f"cannot draw: neither EGL nor OSMesa works here; install the Debian package "
        f"{' or '.join(WAYS.values())}"
    )


def context(way: str, width: int, height: int) -> Any:
    """Return MuJoCo's GL context for pictures of a size in pixels; it has make_current and free.

    Args:
        way: What `find` returned.
        width: [pixels].
        height: [pixels].

    Raises:
        ConfigError: OpenGL was loaded for something else before, as dm_control does it.
    """
    module = "mujoco.gl_context" if way == "native" else f"mujoco.{way}"
    try:
        return importlib.import_module(module).GLContext(width, height)
    except ImportError as error:
        raise ConfigError(
            f"cannot draw: OpenGL is loaded for something else than {way} in this process; set "
            f"MUJOCO_GL={way} before anything is imported"
        ) from error


def settle() -> None:
    """Let what is imported later draw as we do where there is no screen: set MUJOCO_GL.

    dm_control would otherwise load OpenGL for a screen, and no process can load it twice.
    """
    screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform != "linux" or screen or os.environ.get("MUJOCO_GL"):
        return
    try:
        os.environ["MUJOCO_GL"] = find()
    except ConfigError:
        os.environ["MUJOCO_GL"] = "disable"
