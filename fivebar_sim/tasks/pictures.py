"""What the pictures of environments look like, and the options of a reset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco

from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.geometry import FiveBar
from fivebar_sim.render.leg_picture import FAR, LARGEST, Camera, Picture, Subject
from fivebar_sim.robots import Robot
from fivebar_sim.tasks import options


class Pictures(NamedTuple):
    """What the pictures of an environment look like.

    Attributes:
        camera: Where the camera stands.
        width, height: Size of a picture [pixels].
    """

    camera: Camera
    width: int
    height: int

    @classmethod
    def of(cls, camera: Any, width: Any, height: Any) -> Pictures:
        """Return them, checked.

        Raises:
            ArgumentError: A value of the wrong type or out of range.
        """
        for name, side in (("width", width), ("height", height)):
            if options.check_whole(name, side, 1) > LARGEST:
                raise ArgumentError(f"{name} must be in [1, {LARGEST}] pixels, got {side!r}")
        placed = options.as_struct("camera", {} if camera is None else camera, Camera)
        return cls(placed, int(width), int(height))

    def of_leg(self, model: mujoco.MjModel, leg: FiveBar) -> Picture:
        """Return what takes them of a leg."""
        # Far enough for all of the leg, which hangs from the hip.
        return self._of(model, Subject("hip", 0.4 * leg.size, FAR * leg.size))

    def of_robot(self, model: mujoco.MjModel, robot: Robot) -> Picture:
        """Return what takes them of a robot."""
        size = robot.length
        return self._of(model, Subject("trunk", 0.2 * size, FAR * size))

    def _of(self, model: mujoco.MjModel, subject: Subject) -> Picture:
        return Picture(model, subject, self.camera, width=self.width, height=self.height)


def check_render_mode(render_mode: Any, known: tuple[str, ...]) -> None:
    """Raise unless a render mode is one of those known, or None.

    Raises:
        ArgumentError: It is not.
    """
    if render_mode is not None and render_mode not in known:
        raise ArgumentError(unknown("render_mode", str(render_mode), known))


def check_reset_options(given: Any, known: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the options of a reset.

    Raises:
        ArgumentError: Not a table, or one with an unknown key.
    """
    if given is not None and not isinstance(given, Mapping):
        raise ArgumentError(f"options of reset must be None or a table, got {given!r}")
    for name in given or {}:
        if name not in known:
            legal = unknown("option of reset", str(name), known)
            raise ArgumentError(legal if known else f"reset has no options, got {name!r}")
    return dict(given or {})
