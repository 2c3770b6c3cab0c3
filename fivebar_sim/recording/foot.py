"""The foot of a recording: its target path, where it should be now, and the trail behind it.

The target lies in the hip frame and moves with the hip; the trail stays where the foot has been.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.recording.leg import HIP, in_space
from fivebar_sim.recording.look import Colour, Look, shade
from fivebar_sim.recording.poses import DrawnMotion

if TYPE_CHECKING:
    import rerun as rr

TARGET = f"{HIP}/target"
TARGET_PATH = f"{HIP}/target_path"
TRAIL_SECONDS = 0.6
"""How long the trail of the foot stays [s]."""
BACKGROUND: Colour = (24, 26, 30)
"""The colour into which the trail fades."""


class Band(NamedTuple):
    """A part of the trail, by its age.

    Attributes:
        entity: Path of the entity under the run's root.
        oldest: Age of its far end [s].
        newest: Age of its near end [s].
        fresh: 1 beside the foot, falling to 0 where the trail ends.
    """

    entity: str
    oldest: float
    newest: float
    fresh: float


TRAIL = tuple(
    Band(f"foot_trail/{k}", TRAIL_SECONDS * (k + 1) / 6, TRAIL_SECONDS * k / 6, 1.0 - k / 6)
    for k in range(6)
)
"""The trail fades in steps: each band is drawn over its own ages, thinner and darker."""


def log_foot(stream: rr.RecordingStream, target: Array, look: Look) -> None:
    """Log the whole target path (n, 2) [m] as one line, and the style of target and trail."""
    import rerun as rr

    # Styles are logged once, static; `send_foot` sends the positions alone.
    green = look.colour(shade("target"))
    path = rr.LineStrips3D([in_space(target)], radii=rr.Radius.ui_points(1.5), colors=[green])
    stream.log(f"{look.root}{TARGET_PATH}", path, static=True)
    needle = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(2.0), colors=[green])
    stream.log(f"{look.root}{TARGET}", needle, static=True)

    for band in TRAIL:
        line = rr.LineStrips3D.from_fields(
            radii=rr.Radius.ui_points(0.5 + 2.0 * band.fresh),
            colors=[fade(look.colour(shade("foot")), band.fresh)],
        )
        stream.log(f"{look.root}{band.entity}", line, static=True)


def fade(colour: Colour, fresh: float) -> Colour:
    """Return a colour between the background (fresh = 0) and itself (fresh = 1)."""
    red, green, blue = (
        round(fresh * own + (1.0 - fresh) * behind)
        for own, behind in zip(colour, BACKGROUND, strict=True)
    )
    return red, green, blue


def send_foot(
    stream: rr.RecordingStream,
    leg: FiveBar,
    moved: DrawnMotion,
    look: Look,
    times: list[rr.TimeColumn],
) -> None:
    """Send the target and the trail, as columns.

    A row of the trail is the line from the row before to this one.
    """
    # A needle across the leg plane, so that the target shows on both sides of the foot's ball.
    tip = np.array([0.0, 2.5 * leg.foot_radius, 0.0])
    target = in_space(moved.target)
    foot = in_space(moved.world_foot)
    needle = _lines(target - tip, target + tip)
    stream.send_columns(f"{look.root}{TARGET}", times, needle)
    # Made once: all bands show the same steps, each at its own age.
    trail = _lines(np.concatenate([foot[:1], foot[:-1]]), foot)
    for band in TRAIL:
        stream.send_columns(f"{look.root}{band.entity}", times, trail)


def _lines(begin: Array, end: Array) -> list[rr.ComponentColumn]:
    """Return a line in each row, from a point to another one, (n, 3) each."""
    import pyarrow
    import rerun as rr

    # Rerun stores positions in single precision.
    ends = np.stack([begin, end], axis=1).astype(np.float32)
    kind = rr.components.LineStrip3DBatch(ends[:1]).as_arrow_array().type
    inner = rr.components.Position3DBatch(ends.reshape(-1, 3)).as_arrow_array()
    # Rerun itself would count the points of each line by themselves, in Python.
    offsets = np.arange(0, len(inner) + 1, 2, dtype=np.int32)
    strips = pyarrow.ListArray.from_arrays(offsets, inner, type=kind)
    return list(rr.LineStrips3D.columns(strips=strips))
