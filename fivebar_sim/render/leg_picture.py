"""Pictures of a leg in a pose, without a run or a screen."""

from __future__ import annotations

import weakref

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.render import gl

WIDTH = 640
HEIGHT = 480
GEOMS = 200
"""Most geoms of a scene."""
FAR = 3.5
DOWN = -9.0
"""Position of the camera: distance in leg sizes, and elevation [degrees]."""


class LegPicture:
    """A GL context with a scene and a camera, which takes pictures of a leg.

    Args:
        model: The leg's model.
        leg: The leg.

    Raises:
        ConfigError: There is no working GL.
    """

    def __init__(self, model: mujoco.MjModel, leg: FiveBar) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._size = leg.size
        self._rect = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
        self._scene = mujoco.MjvScene(model, GEOMS)
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self._camera.azimuth = 90.0
        self._camera.elevation = DOWN
        self._camera.distance = FAR * leg.size
        self._gl = gl.context(gl.find(), WIDTH, HEIGHT)
        # A finalizer runs before Python unloads its modules; `__del__` may come too late for GL.
        self._free = weakref.finalize(self, self._gl.free)

        try:
            self._gl.make_current()
            self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            self._free()
            raise ConfigError(f"cannot draw {WIDTH} x {HEIGHT} pixels here: {error}") from None

        # The default target is a window, and there is none.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)

    def take(self, qpos: Array) -> NDArray[np.uint8]:
        """Return the picture of a pose (nq,), (HEIGHT, WIDTH, 3)."""
        self._data.qpos[:] = qpos
        # Positions are all that a picture needs; mj_forward would solve for forces too.
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._camera.lookat[:] = self._data.body("hip").xpos - (0.0, 0.0, 0.4 * self._size)
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, every, self._scene
        )
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._scene, self._mjr)
        pixels = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._mjr)

        # GL counts rows from the bottom, image files from the top.
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Free the GL context."""
        self._mjr.free()
        self._free()
