"""Write frames to a file: an animated GIF, a film by ffmpeg, or one picture.

Frames are arrays (height, width, 3) of bytes.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.errors import ConfigError

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

Frame = NDArray[np.uint8]

COLOURS = 255
"""Colours of a GIF's palette; the 256th stands for a pixel that did not change."""


def write_png(place: Path, frame: Frame) -> None:
    """Write one picture."""
    from PIL import Image

    Image.fromarray(frame).save(place, format="PNG", optimize=True)


def durations(count: int, seconds: float) -> list[int]:
    """Return how long each frame of a GIF is shown [ms], in multiples of the format's 10 ms.

    Frame k ends at the multiple nearest to (k + 1) seconds / count, so rounding does not add up.

    Args:
        count: Number of frames.
        seconds: Duration of all frames together [s].
    """
    ends = [round(100.0 * seconds * k / count) for k in range(count + 1)]
    return [10 * (end - start) for start, end in pairwise(ends)]


def write_gif(
    place: Path, frames: Iterable[Frame], sample: Iterable[Frame], shown: list[int]
) -> None:
    """Write an animated GIF that repeats forever, with one palette and no dithering.

    Args:
        place: The file.
        frames: The frames, in order.
        sample: Frames from whose colours the palette is made.
        shown: How long each frame is shown [ms].
    """
    from PIL import Image

    # One palette and no dithering: a pixel that does not change keeps its index, and Pillow then
    # stores only the part of a frame that moved.
    palette = Image.fromarray(np.concatenate(list(sample))).quantize(COLOURS)

    def quantize_all() -> Iterator[Picture]:
        for frame in frames:
            yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    every = quantize_all()
    first = next(every)
    first.save(
        place,
        format="GIF",
        save_all=True,
        append_images=every,
        # Pillow takes a list only for several frames.
        duration=shown if len(shown) > 1 else shown[0],
        loop=0,
    )


def write_mp4(place: Path, frames: Iterable[Frame], fps: float) -> None:
    """Write a film by piping the frames to the program ffmpeg.

    Raises:
        ConfigError: There is no ffmpeg, or it fails; the message ends with its own.
    """
    every = iter(frames)
    first = next(every)
    height, width, _ = first.shape
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.9g}"]
    # yuv420p for players that know nothing else; the index in front, so that a browser can start
    # before it has the whole file.
    made = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = ["ffmpeg", "-y", "-loglevel", "error", *raw, "-i", "-", *made, str(place)]

    # Errors go to a file: nobody reads a pipe while frames are written, and a full one blocks.
    with tempfile.TemporaryFile() as errors:
        try:
            program = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=errors)
        except FileNotFoundError:
            raise ConfigError(
                "a .mp4 needs the program ffmpeg (Debian package ffmpeg); a .gif does not"
            ) from None
        try:
            _pour(program, chain([first], every))
        finally:
            # Does nothing after a normal end; an interrupted one must not leave ffmpeg behind.
            program.kill()
            status = program.wait()
        if status != 0:
            errors.seek(0)
            last = errors.read().decode(errors="replace").strip().splitlines()[-1:]
            raise ConfigError(f"ffmpeg failed: {' '.join(last) or f'exit status {status}'}")


def _pour(program: subprocess.Popen[bytes], frames: Iterable[Frame]) -> None:
    """Pipe frames into a program until either ends, then wait for the program's end."""
    assert program.stdin is not None
    try:
        for frame in frames:
            program.stdin.write(frame.tobytes())
    # The program has ended early; its exit status and its errors say why.
    except BrokenPipeError:
        pass
    # Closing writes what is still buffered, so it can fail in the same way.
    with suppress(BrokenPipeError):
        program.stdin.close()
    program.wait()
