"""OpenGL without a screen: EGL, or else OSMesa, whichever works.

`mujoco.Renderer` uses what MUJOCO_GL said when mujoco was first imported, and by default a GL that
needs a screen. Here the choice is made when a context is requested.
"""

from __future__ import annotations

import atexit
import importlib
import os
import subprocess
import sys
import threading
from functools import cache
from typing import Any

from fivebar_sim.errors import ConfigError

WAYS = {"egl": "libegl1", "osmesa": "libosmesa6"}
"""MuJoCo's names for GL without a screen on Linux, in the order of trial, with Debian packages."""

TRIAL = """
import mujoco
from mujoco.{way} import GLContext
context = GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""


@cache
def works(way: str) -> bool:
    """Return whether one of `WAYS` can draw on this machine.

    It is tried in a separate process: a failed attempt cannot be undone within a process, and a
    driver may crash.
    """
    # -P: a mujoco.py in the user's folder must not be imported for MuJoCo.
    trial = [sys.executable, "-P", "-c", TRIAL.format(way=way)]
    try:
        return subprocess.run(trial, capture_output=True, timeout=60).returncode == 0
    # A driver that hangs is as useless as one that fails.
    except subprocess.TimeoutExpired:
        return False


def check_available() -> None:
    """Raise unless pictures can be drawn off screen.

    Raises:
        ConfigError: None of `WAYS` works; names the Debian packages.
    """
    find()


def find() -> str:
    """Return the first of `WAYS` that works; on systems other than Linux "native", MuJoCo's own.

    If MUJOCO_GL names one of them, only that one is tried.

    Raises:
        ConfigError: None of them works; the message names the Debian packages.
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


def context() -> Any:
    """Return this thread's GL context, an object with make_current; all its pictures share it.

    In a context of its own each of them would compile its shaders anew: in software that takes ten
    times as long as to draw. MuJoCo draws into a buffer of the picture's size, whatever the size
    of the context. Make it current, and the picture's buffer the target, before each use.

    Raises:
        ConfigError: There is no working GL, or OpenGL was already loaded with another platform, as
            dm_control may do.
    """
    # A forked process makes its own: the driver's threads have stayed behind.
    key = (os.getpid(), find())
    if key not in _HELD.contexts:
        _HELD.contexts[key] = _made(key[1])
    return _HELD.contexts[key]


class _Held(threading.local):
    """The contexts of a thread: in two threads at once none can be current."""

    def __init__(self) -> None:
        self.contexts: dict[tuple[int, str], Any] = {}


_HELD = _Held()


def _made(way: str) -> Any:
    """Return a new context; the process frees it at its end."""
    module = "mujoco.gl_context" if way == "native" else f"mujoco.{way}"
    try:
        # The import loads OpenGL for this platform, which a process can do only once.
        made = importlib.import_module(module).GLContext(64, 64)
    except ImportError as error:
        raise ConfigError(
            f"cannot draw: OpenGL is already loaded for another platform than {way}; set "
            f"MUJOCO_GL={way} before anything is imported"
        ) from error

    # Registered after that import, so it runs before MuJoCo shuts GL down; `__del__` is too late.
    atexit.register(_free, made, os.getpid())
    return made


def _free(made: Any, owner: int) -> None:
    """Free a context, unless this is a fork of the process that made it."""
    if os.getpid() != owner:
        return
    try:
        made.free()
    except Exception:
        # dm_control, if it was imported after the context was made, has shut GL down by now and so
        # freed it: `__del__` must not try again.
        made._context = None


def set_mujoco_gl() -> None:
    """Set MUJOCO_GL where there is no screen, so that later imports use the GL that works.

    dm_control would otherwise load OpenGL for a screen, and a process can load it only once.
    """
    screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform != "linux" or screen or os.environ.get("MUJOCO_GL"):
        return
    try:
        os.environ["MUJOCO_GL"] = find()
    # Without any GL dm_control can still simulate, if it does not look for one.
    except ConfigError:
        os.environ["MUJOCO_GL"] = "disable"
