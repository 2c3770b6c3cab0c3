"""Frames into a file: an animated GIF, a film by ffmpeg, or one picture.

Frames are arrays (height, width, 3) of bytes; only the changed parts of a GIF's are kept.
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
"""Of a GIF's palette; the 256th stands for a pixel that did not change."""


def write_png(place: Path, frame: Frame) -> None:
    """Write one picture."""
    from PIL import Image

    Image.fromarray(frame).save(place, format="PNG", optimize=True)


def durations(count: int, seconds: float) -> list[int]:
    """Return how long each of a GIF's frames is shown [ms], in its unit of 10 ms.

    Frame k ends at the 10 ms nearest to (k + 1) seconds / count: the error does not add up.

    Args:
        count: Frames.
        seconds: Of all together [s].
    """
    ends = [round(100.0 * seconds * k / count) for k in range(count + 1)]
    return [10 * (end - start) for start, end in pairwise(ends)]


def write_gif(
    place: Path, frames: Iterable[Frame], sample: Iterable[Frame], shown: list[int]
) -> None:
    """Write an animated GIF that starts over for ever, with one palette and no dithering.

    Args:
        place: The file.
        frames: In order.
        sample: Frames whose colours the palette is made for.
        shown: How long each is shown [ms].
    """
    from PIL import Image

    palette = Image.fromarray(np.concatenate(list(sample))).quantize(COLOURS)

    def mapped() -> Iterator[Picture]:
        for frame in frames:
            yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    every = mapped()
    first = next(every)
    first.save(
        place,
        format="GIF",
        save_all=True,
        append_images=every,
        duration=shown if len(shown) > 1 else shown[0],
        loop=0,
    )


def write_mp4(place: Path, frames: Iterable[Frame], fps: float) -> None:
    """Write a film through a pipe to the program ffmpeg.

    Raises:
        ConfigError: There is no ffmpeg, or it gives up; says what it said.
    """
    every = iter(frames)
    first = next(every)
    height, width, _ = first.shape
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:.9g}"]
    made = ["-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = ["ffmpeg", "-y", "-loglevel", "error", *raw, "-i", "-", *made, str(place)]

    with tempfile.TemporaryFile() as said:
        try:
            program = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said)
        except FileNotFoundError:
            raise ConfigError(
                "a .mp4 needs the program ffmpeg (Debian package ffmpeg); a .gif does not"
            ) from None
        try:
            _pour(program, chain([first], every))
        finally:
            program.kill()  # no more than a formality after its end
            status = program.wait()
        if status != 0:
            said.seek(0)
            last = said.read().decode(errors="replace").strip().splitlines()[-1:]
            raise ConfigError(f"ffmpeg failed: {' '.join(last) or f'exit status {status}'}")


def _pour(program: subprocess.Popen[bytes], frames: Iterable[Frame]) -> None:
    """Write frames into a program until they end or it does, and wait for its end."""
    assert program.stdin is not None
    try:
        for frame in frames:
            program.stdin.write(frame.tobytes())
    except BrokenPipeError:  # it gave up, and says why
        pass
    with suppress(BrokenPipeError):  # of what was not yet written
        program.stdin.close()
    program.wait()
