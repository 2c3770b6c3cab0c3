"""Draw a run as a GIF, a film or a picture, with MuJoCo's renderer, with or without a screen.

The poses come from the record's qpos; nothing is simulated again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.render import caption, gl, scene
from fivebar_sim.render import frames as render_files
from fivebar_sim.render.frames import Frame
from fivebar_sim.render.replay import Replay, Span

FORMATS = (".gif", ".mp4", ".png")
FASTEST = {".gif": 50.0, ".mp4": 240.0, ".png": 240.0}
"""Highest frame rate [1/s]; viewers slow down a GIF with more frames a second."""
LEAST = 64
MOST = 4096
"""Least and greatest width and height [pixels]."""
MOST_GIF = 250_000_000
MOST_FRAMES = 100_000
"""Most pixels of all frames of a GIF, which are held in memory; most frames of a film."""
SAMPLES = 8
"""Number of frames from which a GIF's palette is made, at most."""


class Film(NamedTuple):
    """How to draw a run.

    Attributes:
        width: Width of the picture [pixels].
        height: Height of the picture [pixels].
        fps: Frames a second.
        speed: Simulated time over the time on screen; 1 is real time.
        at: Time of a single picture [s]; None: the middle of the run.
    """

    width: int = 640
    height: int = 480
    fps: float = 30.0
    speed: float = 1.0
    at: float | None = None


def span(replay: Replay, suffix: str) -> Span:
    """Return the part of a run that is drawn into a file with this suffix.

    A GIF shows the last whole period of a periodic path, so that it repeats without a jump. A film,
    and the GIF of a path that is not periodic, show the whole run.
    """
    return replay.cycle if suffix == ".gif" else replay.whole


def moments(part: Span, film: Film) -> list[float]:
    """Return the times of the frames [s], evenly spaced from the start, without the end.

    Their number is length fps / speed, rounded, and at least one.
    """
    count = max(1, round(part.length * film.fps / film.speed))
    return [part.start + part.length * k / count for k in range(count)]


def check(replay: Replay, out: Path, film: Film) -> None:
    """Raise unless a run can be drawn like this.

    Raises:
        ConfigError: An unknown kind of file, or a number out of range.
    """
    kind = out.suffix.lower()
    if kind not in FORMATS:
        raise ConfigError(f"cannot draw {out}: the picture must end in {', '.join(FORMATS)}")

    check_number("fps", film.fps, "1/s", low=0.1, high=FASTEST[kind], error=ConfigError)
    check_number("speed", film.speed, "", low=1e-4, high=1e4, error=ConfigError)
    for name in ("width", "height"):
        pixels = getattr(film, name)
        check_number(name, pixels, "pixels", low=LEAST, high=MOST, error=ConfigError)
        # yuv420p, which every player reads, halves the colours' resolution in both directions.
        if kind == ".mp4" and pixels % 2:
            raise ConfigError(f"{name} of a .mp4 must be even, got {pixels}")

    if film.at is not None:
        if kind != ".png":
            raise ConfigError(f"at is the time of a single .png, got {out}")
        check_number("at", film.at, "s", low=0.0, high=replay.duration, error=ConfigError)

    wanted = span(replay, kind).length * film.fps / film.speed
    most = MOST_GIF // (film.width * film.height) if kind == ".gif" else MOST_FRAMES
    if kind != ".png" and not wanted <= most:
        raise ConfigError(
            f"a {kind} of {film.width} x {film.height} may have up to {most} frames, got "
            f"{wanted:.0f}: use a lower fps, a higher speed or another kind of file"
        )


def write(replay: Replay, out: Path, film: Film) -> int:
    """Draw a run into a file, which appears only when it is complete; return the number of frames.

    Args:
        replay: The run.
        out: The file; .gif, .mp4 or .png.
        film: How to draw it.

    Raises:
        ConfigError: `check` refuses it, there is no GL or no ffmpeg, or the file cannot be
            written.
    """
    check(replay, out, film)
    kind = out.suffix.lower()
    part = span(replay, kind)
    times = moments(part, film)

    if kind == ".png":
        times = [0.5 * replay.duration if film.at is None else film.at]

    with whole_file.stage(out) as place, stage(replay, film.width, film.height) as drawn:
        # A generator: a film of 100,000 frames would not fit into memory.
        frames = (drawn.frame(time) for time in times)
        if kind == ".png":
            render_files.write_png(place, next(frames))
        elif kind == ".mp4":
            render_files.write_mp4(place, frames, film.fps)
        else:
            # Evenly over the film, so that colours that show only at times are in the palette.
            sample = {time: drawn.frame(time) for time in times[:: -(-len(times) // SAMPLES)]}
            # Each of them is a frame too, and kept until its turn comes.
            frames = (sample.pop(time) if time in sample else drawn.frame(time) for time in times)
            shown = render_files.durations(len(times), part.length / film.speed)
            render_files.write_gif(place, frames, list(sample.values()), shown)
    return len(times)


class Stage:
    """A scene and a camera, which draw the moments of a run with a caption.

    Args:
        replay: The run.
        width: Width of the picture [pixels].
        height: Height of the picture [pixels].
    """

    def __init__(self, replay: Replay, width: int, height: int) -> None:
        seen = height - caption.strip_height(width, height)
        self.camera = scene.fit(replay, width / seen)
        self._caption = caption.Caption(replay, self.camera, width, height)
        self._replay = replay
        self._rect = mujoco.MjrRect(0, 0, width, seen)
        scene.dress(replay, self.camera, max(width, height))
        model = replay.model
        # MjrContext allocates its offscreen buffer by these, so they are set before it is made.
        model.vis.global_.offwidth = width
        model.vis.global_.offheight = height
        self._data = mujoco.MjData(model)
        self.scene = mujoco.MjvScene(model, scene.GEOMS)
        self._option = mujoco.MjvOption()
        self._view = mujoco.MjvCamera()
        self.camera.aim(self._view)
        self._gl = gl.context()

        try:
            self._gl.make_current()
            self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise ConfigError(f"cannot draw {width} x {height} pixels here: {error}") from None

    def frame(self, time: float) -> Frame:
        """Return the picture of the run at a time [s], (height, width, 3)."""
        row = self._replay.row(time)
        model = self._replay.model
        data = self._data
        data.qpos[:] = self._replay.qpos[row]
        mujoco.mj_forward(model, data)
        here = self.camera._replace(centre=self.camera.centre + self._replay.place(row))
        here.aim(self._view)
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, self._view, every, self.scene)
        scene.decorate(self.scene, self._replay, row, here.eye)
        # Another picture of this thread, or another library, may have drawn since.
        self._gl.make_current()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        mujoco.mjr_render(self._rect, self.scene, self._mjr)
        pixels = np.empty((self._rect.height, self._rect.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._mjr)

        # GL counts rows from the bottom, image files from the top.
        return self._caption.write(np.ascontiguousarray(pixels[::-1]), row)

    def close(self) -> None:
        """Free what the scene holds in the GL context."""
        self._gl.make_current()
        self._mjr.free()


@contextmanager
def stage(replay: Replay, width: int, height: int) -> Iterator[Stage]:
    """Open a stage and close it at the end.

    Raises:
        ConfigError: There is no working GL.
    """
    opened = Stage(replay, width, height)
    try:
        yield opened
    finally:
        opened.close()
