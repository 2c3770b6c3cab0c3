"""Pictures of a leg or a robot in a pose, without a run or a screen."""

from __future__ import annotations

import copy
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.render import gl

WIDTH = 640
HEIGHT = 480
LARGEST = 8192
"""Most pixels along a side."""
GEOMS = 400
"""Most geoms of a scene."""
FAR = 3.5
"""Distance of the camera in sizes of the leg or the robot."""


class Camera(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where the camera of an environment's pictures stands, as in MuJoCo's free camera.

    Attributes:
        azimuth: Its direction about the vertical [deg]; 90 looks along the hip's axis.
        elevation: How far it looks up [deg].
        distance: From the point that it looks at [m]; None for 3.5 times the leg's size, or the
            robot's length.
        lookat: That point (x, y, z) [m]; None for one below the hip, or a robot's trunk, which it
            then follows.
    """

    azimuth: float = 90.0
    elevation: float = -9.0
    distance: float | None = None
    lookat: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        check_number("camera.azimuth", self.azimuth, "deg", low=-360.0, high=360.0)
        check_number("camera.elevation", self.elevation, "deg", low=-90.0, high=90.0)
        if self.distance is not None:
            check_number("camera.distance", self.distance, "m", low=0.0, strict=True)
        if self.lookat is None:
            return
        if not isinstance(self.lookat, (tuple, list)) or len(self.lookat) != 3:
            raise ArgumentError(f"camera.lookat must be (x, y, z) in m, got {self.lookat!r}")
        for k, part in enumerate(self.lookat):
            check_number(f"camera.lookat[{k}]", part, "m")


class Subject(NamedTuple):
    """What a camera looks at where nothing else is said.

    Attributes:
        body: The body that it follows.
        below: How far below that body's origin it looks [m].
        distance: Its distance [m].
    """

    body: str
    below: float
    distance: float


class Picture:
    """A scene and a camera, which take pictures.

    Args:
        model: The model.
        subject: What they are of.
        camera: Where the camera stands.
        width: Width of the pictures [pixels].
        height: Height of the pictures [pixels].

    Raises:
        ConfigError: There is no working GL.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        subject: Subject,
        camera: Camera = Camera(),  # noqa: B008 - it is frozen
        *,
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        # A copy, whose buffer for pictures is as large as they are.
        model = copy.copy(model)
        model.vis.global_.offwidth = width
        model.vis.global_.offheight = height
        # Drawn anew for each picture: MuJoCo's 4096 would take most of the time of a small one.
        model.vis.quality.shadowsize = min(2 * max(width, height), model.vis.quality.shadowsize)
        self._model = model
        self._data = mujoco.MjData(model)
        self._subject = subject
        self._lookat = camera.lookat
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(model, GEOMS)
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self._camera.azimuth = camera.azimuth
        self._camera.elevation = camera.elevation
        self._camera.distance = camera.distance or subject.distance
        self._gl = gl.context()

        try:
            self._gl.make_current()
            self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise ConfigError(f"cannot draw {width} x {height} pixels here: {error}") from None

    def take(self, qpos: Array) -> NDArray[np.uint8]:
        """Return the picture of a pose (nq,), (height, width, 3)."""
        self._data.qpos[:] = qpos
        # Positions are all that a picture needs; mj_forward would solve for forces too.
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        subject = self._subject
        below = self._data.body(subject.body).xpos - (0.0, 0.0, subject.below)
        self._camera.lookat[:] = below if self._lookat is None else self._lookat
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, every, self._scene
        )
        # Another picture of this thread, or another library, may have drawn since.
        self._gl.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        mujoco.mjr_render(self._rect, self._scene, self._mjr)
        pixels = np.empty((self._rect.height, self._rect.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._mjr)

        # GL counts rows from the bottom, image files from the top.
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Free what the scene holds in the GL context."""
        self._gl.make_current()
        self._mjr.free()
