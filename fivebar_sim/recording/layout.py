"""The layout that a recording opens with: leg and verdict on the left, plots on the right."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.recording.foot import BACKGROUND, TRAIL
from fivebar_sim.recording.leg import in_space
from fivebar_sim.recording.look import Look
from fivebar_sim.recording.plots import Series
from fivebar_sim.recording.poses import Room

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.blueprint.api import VisualizerLike
    from rerun.encodings import EntityPathLike

SUMMARY = "summary"


def contents(
    stage: Room,
    looks: Sequence[Look],
    plots: Sequence[Sequence[Series]],
    follow: str | None = None,
) -> rrb.Container:
    """Return the views of all runs.

    Args:
        stage: The space that the legs need.
        looks: The look of each run.
        plots: The plots of each run.
        follow: The entity that the camera follows; None: it stands still.
    """
    import rerun.blueprint as rrb

    # Runs share their plots, and a plot that one run alone has is shown too.
    first: dict[str, Series] = {}
    for each in (line for lines in plots for line in lines):
        first.setdefault(each.plot, each)
    views = [plot_view(plot, looks) for plot in first.values()]
    text = rrb.TextDocumentView(origin=SUMMARY, name="Verdict")
    left = rrb.Vertical(leg_view(stage, looks, follow), text, row_shares=[3, 2])
    return rrb.Horizontal(left, rrb.Grid(*views, grid_columns=2), column_shares=[2, 3])


def leg_view(stage: Room, looks: Sequence[Look], follow: str | None = None) -> rrb.Spatial3DView:
    """Return the 3D view: from the front, slightly above, all of the motion in sight."""
    import rerun.blueprint as rrb

    centre = in_space(0.5 * (stage.low + stage.high))
    distance = 1.4 * float(np.max(stage.high - stage.low)) + 0.1 * stage.size
    trails: dict[EntityPathLike, VisualizerLike | Iterable[VisualizerLike]] = {
        f"/{look.root}{entity}": ages for look in looks for entity, ages in _trail().items()
    }

    return rrb.Spatial3DView(
        origin="/",
        name="Leg",
        background=[*BACKGROUND, 255],
        eye_controls=rrb.EyeControls3D(
            position=centre + distance * np.array([0.25, -1.0, 0.25]),
            look_target=centre,
            tracking_entity=follow,
        ),
        line_grid=False,
        overrides=trails,
    )


@cache
def _trail() -> dict[str, rrb.VisibleTimeRanges]:
    """Return the stretch of time before the cursor that each band of the trail shows.

    Made once: for Rerun they are slow to make, and they are the same in all recordings.
    """
    import rerun.blueprint as rrb

    return {
        band.entity: rrb.VisibleTimeRanges(
            timeline="sim_time",
            start=rrb.TimeRangeBoundary.cursor_relative(nanos=_ago(band.oldest)),
            end=rrb.TimeRangeBoundary.cursor_relative(nanos=_ago(band.newest)),
        )
        for band in TRAIL
    }


def _ago(age: float) -> int:
    """Return an age [s] as a time relative to the cursor [ns]."""
    # Rerun would truncate seconds to nanoseconds, where this rounds.
    return -round(1e9 * age)


def plot_view(plot: Series, looks: Sequence[Look]) -> rrb.TimeSeriesView:
    """Return the view of one plot with the lines of all runs.

    Rerun draws a legend over the curves, so there is none: the summary says what the colours mean.
    """
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"/{look.root}{plot.plot}/**" for look in looks],
        name=plot.title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=rrb.ScalarAxis(range=plot.bounds) if plot.bounds else None,
        plot_legend=rrb.PlotLegend(visible=False),
    )


def send(stream: rr.RecordingStream, views: rrb.Container) -> None:
    """Send the layout."""
    import rerun.blueprint as rrb

    # Rerun logs a blueprint to a stream of its own, which lives, with threads and megabytes, until
    # the process ends: stream and sink refer to each other. So it is caught, and disconnected.
    streams: list[rr.RecordingStream] = []

    class Layout(rrb.Blueprint):
        def _log_to_stream(self, stream: rr.RecordingStream) -> None:
            streams.append(stream)
            super()._log_to_stream(stream)

    layout = Layout(
        views,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )
    stream.send_blueprint(layout)
    # Emptied, since the class Layout refers to the list until the next garbage collection.
    while streams:
        streams.pop().disconnect()
