"""`fivebar view`, with a viewer that has no window: what it is shown, and what is refused."""

from __future__ import annotations

import contextlib
import sys
from typing import Any

import glfw
import mujoco
import mujoco.viewer
import numpy as np
import pytest
from shell import Shell

from fivebar_sim import FiveBar, kinematics
from fivebar_sim.errors import ConfigError
from fivebar_sim.render import view
from fivebar_sim.render.replay import replay
from fivebar_sim.rollout import run
from fivebar_sim.scenario import Scenario


class Window:
    """A viewer's handle that notes what it is shown, and is closed after some frames."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, frames: int) -> None:
        self.model = model
        self.data = data
        self.frames = frames
        self.cam = mujoco.MjvCamera()
        self.user_scn = mujoco.MjvScene(model, 1000)
        self.shown: list[tuple[float, np.ndarray, int]] = []

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.frames = -1

    def lock(self) -> contextlib.nullcontext[None]:
        """Return a lock that is none."""
        return contextlib.nullcontext()

    def is_running(self) -> bool:
        """Return whether the window is still open."""
        return len(self.shown) < self.frames

    def sync(self) -> None:
        """Note what is shown."""
        self.shown.append((self.data.time, self.data.qpos.copy(), self.user_scn.ngeom))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Window]:
    """Return the windows that are opened; each shows four states."""
    windows: list[Window] = []

    def launch(model: mujoco.MjModel, data: mujoco.MjData, **_: Any) -> Window:
        windows.append(Window(model, data, 4))
        return windows[-1]

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(mujoco.viewer, "launch_passive", launch)
    monkeypatch.setattr(view, "SECONDS", 0.0)
    return windows


def ticking(times: list[float]):
    """Return a clock that tells these times, one a call."""
    every = iter(times)
    return lambda: next(every)


def test_a_scenario_is_shown_in_real_time_and_over_and_over(
    shell: Shell, opened: list[Window]
) -> None:
    result = run(Scenario.load("short.toml"))  # ramp 0.1 s, two periods of 0.25 s
    shown = replay(result.scenario, result.record)
    view.play(shown, clock=ticking([7.0, 7.1, 7.5, 7.65, 8.15]))
    (window,) = opened
    assert [time for time, *_ in window.shown] == pytest.approx([0.1, 0.5, 0.4, 0.4])
    for time, qpos, geoms in window.shown:
        assert np.array_equal(qpos, shown.qpos[shown.row(time)])
        assert geoms > 100  # path, trail, target: not piled up from state to state
    assert len({geoms for *_, geoms in window.shown}) == 1
    assert window.cam.azimuth == 90.0
    assert window.frames == -1  # closed


def test_a_leg_is_held_in_its_rest_pose(opened: list[Window]) -> None:
    leg = FiveBar.load("q8bot")
    view.hold(leg, clock=ticking([0.0, 0.05, 0.1, 0.15, 99.0]))
    (window,) = opened
    assert [time for time, *_ in window.shown] == pytest.approx([0.05, 0.1, 0.15, 0.25], abs=2e-3)
    rest = kinematics.home(leg)
    assert np.abs(window.data.qpos - rest).max() < 0.01
    low, high = window.model.actuator_ctrlrange.T
    assert low == pytest.approx(rest[[0, 2]] - np.pi / 3)
    assert high == pytest.approx(rest[[0, 2]] + np.pi / 3)
    assert window.model.actuator_ctrllimited.all()


def test_the_command_shows_what_is_named(shell: Shell, opened: list[Window]) -> None:
    (shell.folder / "leg.toml").write_text("L1 = 0.04\nL2 = 0.06\nL3 = 0.06\nL4 = 0.04\nL5 = 0.03")
    for source, kind in (("doggo", FiveBar), ("leg.toml", FiveBar), ("short.toml", Scenario)):
        assert isinstance(view.load(source), kind)
    assert isinstance(view.load("rail-hop"), Scenario)
    assert shell("view", "leg.toml").status == 0
    assert shell("view", "short.toml").status == 0
    assert len(opened) == 2
    assert shell("view").status == 0
    assert opened[-1].model.stat.extent < 1.0


def test_what_cannot_be_shown_is_one_line(shell: Shell, opened: list[Window]) -> None:
    assert shell.refused("view", "classik").startswith("unknown leg or scenario 'classik'; known: ")
    assert shell.refused("view", "no.toml").startswith("cannot read leg or scenario no.toml: ")
    assert opened == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a screen is always there")
def test_no_screen_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", "")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for source in ("classic", "short.toml"):
        assert shell.refused("view", source).startswith("no screen here: neither DISPLAY nor")


def test_a_window_that_does_not_open_is_one_line(
    opened: list[Window], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("must be run under mjpython")

    monkeypatch.setattr(mujoco.viewer, "launch_passive", fail)
    with pytest.raises(ConfigError, match="cannot open a window: must be run under mjpython"):
        view.hold(FiveBar.load("classic"))
    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(ConfigError, match="cannot open a window: the screen does not answer"):
        view.hold(FiveBar.load("classic"))
