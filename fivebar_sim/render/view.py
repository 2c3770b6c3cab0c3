"""MuJoCo's interactive viewer: a run in real time, or a leg that its sliders move."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import glfw
import mujoco
import numpy as np

from fivebar_sim import model
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.files import resources, tables
from fivebar_sim.geometry import FiveBar
from fivebar_sim.render import scene, screen
from fivebar_sim.render.replay import Replay
from fivebar_sim.scenario import Scenario

INSTEAD = "`fivebar render` draws a run without one"
"""Advice where no window can open."""

SECONDS = 1.0 / 60.0
"""Time between two states shown [s]."""
LATE = 0.1
"""Longest simulated time between two states shown [s]."""
SLIDER = math.radians(60.0)
"""Range of the sliders to either side of the rest pose [rad]."""


def load(source: str) -> FiveBar | Scenario:
    """Return the leg or scenario with a shipped name or in a TOML file.

    Raises:
        ConfigError: The name is unknown, or the file has an illegal value.
    """
    legs = resources.shipped("models/legs")
    scenarios = resources.shipped("scenarios")
    if source in legs:
        return FiveBar.load(source)
    if source in scenarios:
        return Scenario.load(source)

    file = Path(source)
    if file.suffix != ".toml":
        known = unknown("leg or scenario", source, {**legs, **scenarios})
        raise ConfigError(f"{known}; or a path to a .toml")

    table = tables.read(file, "leg or scenario")
    # Every scenario has a path, and no leg has one.
    return Scenario.load(source) if "path" in table else FiveBar.load(source)


def moment(replay: Replay, elapsed: float) -> float:
    """Return the time of the run to show [s]: the whole run once, then its cycle over and over.

    Args:
        replay: The run.
        elapsed: Time on the clock since the start [s].
    """
    start, length = replay.cycle
    end = start + length
    return elapsed if elapsed < end else start + (elapsed - end) % length


def play(replay: Replay, clock: Callable[[], float] = time.monotonic) -> None:
    """Show a run in real time until the window is closed.

    Args:
        replay: The run.
        clock: Returns the time [s].

    Raises:
        ConfigError: No window can be opened.
    """
    camera = scene.fit(replay, aspect=1.0)
    scene.dress(replay, camera)
    data = mujoco.MjData(replay.model)
    with _window(replay.model, data, controls=False) as window:
        with window.lock():
            camera.aim(window.cam)
        start = clock()
        while window.is_running():
            row = replay.row(moment(replay, clock() - start))
            # The viewer draws in a thread of its own, from the same model and data.
            with window.lock():
                data.time = (row + 1) * replay.scenario.sim.timestep
                data.qpos[:] = replay.qpos[row]
                mujoco.mj_forward(replay.model, data)
                window.user_scn.ngeom = 0
                scene.decorate(window.user_scn, replay, row, camera.eye)
                # Past a robot that walks on, the camera would look at an empty floor.
                if replay.walked is not None:
                    window.cam.lookat[:2] = replay.place(row)[:2]
            window.sync()
            time.sleep(SECONDS)


def hold(leg: FiveBar, clock: Callable[[], float] = time.monotonic) -> None:
    """Show a leg in its rest pose, held by servos whose commands are the viewer's sliders.

    Args:
        leg: The leg.
        clock: Returns the time [s].

    Raises:
        ConfigError: No window can be opened.
    """
    built = model.build(leg, servo=Servo())
    data = mujoco.MjData(built)
    mujoco.mj_resetDataKeyframe(built, data, built.key("home").id)
    # The viewer takes the range of a slider from its actuator.
    built.actuator_ctrllimited[:] = True
    built.actuator_ctrlrange[:] = data.ctrl[:, None] + np.array([-SLIDER, SLIDER])
    middle = np.array([0.0, 0.0, (model.HIP_HEIGHT - 0.4) * leg.size])

    with _window(built, data, controls=True) as window:
        with window.lock():
            scene.Camera(middle, 2.0 * leg.size, built.vis.global_.fovy).aim(window.cam)
        start = clock()
        while window.is_running():
            # A slow machine falls behind the clock instead of simulating ever longer.
            due = min(clock() - start, data.time + LATE)
            with window.lock():
                while data.time < due:
                    mujoco.mj_step(built, data)
            window.sync()
            time.sleep(SECONDS)


@contextmanager
def _window(built: mujoco.MjModel, data: mujoco.MjData, *, controls: bool) -> Iterator[Any]:
    """Open the viewer of a model and close it at the end; the caller runs the loop.

    Raises:
        ConfigError: No window can be opened.
    """
    screen.check(INSTEAD)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # Where this fails, MuJoCo's viewer would end the whole process.
        if not glfw.init():
            raise ConfigError("the viewer cannot open a window: the screen does not answer")

    try:
        from mujoco import viewer

        window = viewer.launch_passive(built, data, show_left_ui=False, show_right_ui=controls)
    except (RuntimeError, mujoco.FatalError) as error:
        raise ConfigError(f"the viewer cannot open a window: {error}") from None

    with window:
        yield window
