"""What a picture of a run says: the letters A and E, and below it time, scale and colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.render.frames import Frame
from fivebar_sim.render.palette import COLOURS, PAPER
from fivebar_sim.render.replay import Replay
from fivebar_sim.render.scene import Camera, trail_seconds

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

SMALLEST = 9
"""Least height of letters [pixels]."""

BAR = 0.2
"""Longest length of the scale bar, as a part of the picture's width."""


class Entry(NamedTuple):
    """A colour of the picture and what has it."""

    colour: str
    label: str


def letter_height(width: int, height: int) -> int:
    """Return the height of letters in a picture of a size [pixels]."""
    return max(SMALLEST, min(width // 44, height // 30))


def strip_height(width: int, height: int) -> int:
    """Return the height of the strip below the leg [pixels]."""
    return round(1.8 * letter_height(width, height))


def legend(replay: Replay) -> list[Entry]:
    """Return the colours to explain."""
    entries = [
        Entry("target", "target"),
        Entry("foot", f"foot, last {trail_seconds(replay):.2g} s"),
    ]
    largest = float(np.hypot(*replay.ground.T).max())
    if replay.walked is not None:
        # Of a robot's feet neither targets nor trails are drawn: they would hide the legs.
        entries = []
        largest = float(np.linalg.norm(replay.walked.forces, axis=-1).max())
    if largest > 0.0:
        entries.append(Entry("force", f"ground, max {largest:.3g} N"))
    return entries


class Caption:
    """Writes on the frames of a run.

    Args:
        replay: The run.
        camera: The camera that sees the leg.
        width: Width of the picture [pixels].
        height: Height of the picture with its strip [pixels].
    """

    def __init__(self, replay: Replay, camera: Camera, width: int, height: int) -> None:
        from PIL import Image, ImageDraw, ImageFont

        self._replay = replay
        self._camera = camera
        self._letters = letter_height(width, height)
        self._font = ImageFont.load_default(self._letters)
        self._seen = (width, height - strip_height(width, height))
        self._strip = Image.new("RGB", (width, strip_height(width, height)), PAPER.light)
        longest = f"t = {replay.duration:.3f} s"
        draw = ImageDraw.Draw(self._strip)
        x = self._letters + draw.textlength(longest, self._font) + self._letters
        x = self._draw_scale(draw, x)
        for entry in legend(replay):
            x = self._draw_entry(draw, x, entry)

    def write(self, frame: Frame, row: int) -> Frame:
        """Return the frame of a row with its letters, above its strip.

        Args:
            frame: The leg as the camera sees it, (height without the strip, width, 3).
            row: Row of the record.
        """
        from PIL import Image, ImageDraw

        whole = Image.new("RGB", (self._strip.width, self._seen[1] + self._strip.height))
        whole.paste(Image.fromarray(frame))
        whole.paste(self._strip, (0, self._seen[1]))
        draw = ImageDraw.Draw(whole)
        time = (row + 1) * self._replay.scenario.sim.timestep
        middle = self._seen[1] + self._strip.height / 2
        self._text(draw, self._letters, middle, f"t = {time:.3f} s", "ink", "lm")
        if self._replay.walked is None:
            self._draw_letters(draw, row)
        return np.asarray(whole)

    def _draw_letters(self, draw: ImageDraw, row: int) -> None:
        """Write A to the left of its motor and E to the right: coaxial motors are at one place."""
        hip = np.array([0.0, self._replay.hip[row]])
        bases = kinematics.bases(self._replay.scenario.leg)
        half = 0.7 * self._letters
        gap = half + self._pixels_per_metre() * 1.5 * self._replay.scenario.leg.radius
        for letter, base, side in zip(MOTORS, bases, (-1.0, 1.0), strict=True):
            x, y = self._camera.pixel(base + hip, *self._seen)
            x += side * gap
            box = (x - half, y - half, x + half, y + half)
            # On paper of its own: behind it are links, the hip and the sky.
            draw.rounded_rectangle(box, 0.3 * half, PAPER.light)
            self._text(draw, x, y, letter, letter, "mm")

    def _draw_scale(self, draw: ImageDraw, x: float) -> float:
        """Draw the scale bar from x on; return where it ends."""
        length = round_length(BAR * self._seen[0] / self._pixels_per_metre())
        end = x + self._pixels_per_metre() * length
        middle = self._strip.height / 2
        tick = 0.3 * self._letters
        label = f"{1e3 * length:g} mm"
        after = end + 0.5 * self._letters + draw.textlength(label, self._font)
        if after > self._strip.width:
            return x

        ink = COLOURS["ink"].light
        thick = max(1, self._letters // 8)
        draw.line([(x, middle), (end, middle)], ink, thick)
        for edge in (x, end):
            draw.line([(edge, middle - tick), (edge, middle + tick)], ink, thick)
        self._text(draw, end + 0.5 * self._letters, middle, label, "ink", "lm")
        return after + self._letters

    def _draw_entry(self, draw: ImageDraw, x: float, entry: Entry) -> float:
        """Draw an entry of the legend from x on, if it fits; return where the next may begin."""
        text = x + 1.3 * self._letters
        after = text + draw.textlength(entry.label, self._font)
        if after > self._strip.width:
            return float(self._strip.width)
        middle = self._strip.height / 2
        half = 0.4 * self._letters
        box = (x, middle - half, x + 2.0 * half, middle + half)
        draw.ellipse(box, COLOURS[entry.colour].light)
        self._text(draw, text, middle, entry.label, "ink", "lm")
        return after + self._letters

    def _text(self, draw: ImageDraw, x: float, y: float, text: str, colour: str, at: str) -> None:
        draw.text((x, y), text, COLOURS[colour].light, self._font, at)

    def _pixels_per_metre(self) -> float:
        """Return the scale in the leg plane, at the centre of the picture."""
        return float(self._camera.scale(self._seen[1]))


def round_length(most: float) -> float:
    """Return the largest of 1, 2 and 5 times 10^n that is at most a length [m]."""
    decade = 10.0 ** np.floor(np.log10(most))
    return float(decade * max(n for n in (1.0, 2.0, 5.0) if n * decade <= most * (1.0 + 1e-9)))
