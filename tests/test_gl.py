"""Which OpenGL is used without a screen: the first that works, or the one that is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fivebar_sim.errors import ConfigError
from fivebar_sim.render import gl


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere MuJoCo's own GL is used")
def test_a_gl_is_found_by_trying(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "works", lambda way: True)
    assert gl.find() == "egl"
    monkeypatch.setattr(gl, "works", lambda way: way == "osmesa")
    assert gl.find() == "osmesa"
    monkeypatch.setenv("MUJOCO_GL", "EGL")
    with pytest.raises(ConfigError, match=r"MUJOCO_GL=egl does not work .* libegl1, or unset"):
        gl.find()
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert gl.find() == "osmesa"
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    monkeypatch.setattr(gl, "works", lambda way: False)
    with pytest.raises(ConfigError, match="install the Debian package libegl1 or libosmesa6"):
        gl.find()


def test_what_does_not_work_is_found_out() -> None:
    assert not gl.works("no_such_way")


MADE_FIRST = """
from fivebar_sim.render import gl

gl.set_mujoco_gl()
gl.context()
from dm_control import _render
"""


@pytest.mark.long
def test_a_process_ends_in_silence_where_dm_control_shuts_gl_down_first() -> None:
    pytest.importorskip("dm_control", reason="dm-control has no wheel for this Python")
    ended = subprocess.run(
        [sys.executable, "-c", MADE_FIRST], capture_output=True, text=True, check=True
    )
    assert ended.stderr == ""
