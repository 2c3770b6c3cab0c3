"""Which OpenGL is used without a screen: the first that works, or the one that is asked for."""

from __future__ import annotations

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
