"""Show a robot's run in Rerun while it is simulated."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.metrics.columns import Record
from fivebar_sim.recording import layout, live, rrd
from fivebar_sim.recording.look import Look
from fivebar_sim.recording.poses import Room
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.simulation.record import Part
from fivebar_sim.simulation.steps import States, Watch
from fivebar_sim.walking.plan import RobotPlan
from fivebar_sim.walking.record import columns
from fivebar_sim.walking.shown import ground as shown_ground
from fivebar_sim.walking.shown import recording

if TYPE_CHECKING:
    import rerun as rr

AHEAD = 4.0
"""How far the floor is drawn beyond the robot's way, in sizes of the robot."""

ARROW = 0.25
"""Length of the arrow of a force as large as the robot's weight, in sizes of the robot."""


def streaming(planned: RobotPlan, address: str) -> AbstractContextManager[Watch]:
    """Return a context with a watcher for `rollout.execute` that shows a robot's run in a viewer.

    Args:
        planned: The plan that will be simulated.
        address: HOST:PORT of the viewer; see `recording.live.streaming`.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    name = planned.scenario.name
    return live.sending(name, address, lambda stream: _Robot(planned, stream).send)


class _Robot:
    """A robot's run as it is shown so far."""

    def __init__(self, planned: RobotPlan, stream: rr.RecordingStream) -> None:
        scene = planned.scene
        self._planned = planned
        self._stream = stream
        self._floor = scene if isinstance(scene, Floor) else None
        self._room = _room(planned)
        self._has_begun = False
        self._begin = 0
        self._before = planned.start

    def send(self, states: States) -> None:
        """Send some steps."""
        record = columns(self._planned, Part(states, self._begin, self._before))
        self._show(record)
        self._begin += states.time.shape[1]
        # The torque of the next step needs the state before it.
        self._before = states.qpos[0, -1]

    def _show(self, record: Record) -> None:
        look = Look()
        plots = list(recording.series(record))
        if not self._has_begun:
            views = layout.contents(self._room, [look], [plots], follow=recording.TRUNK)
            layout.send(self._stream, views)
            self._begin_recording(look)
            self._has_begun = True
        self._widen(record)

        rows = live.shown_rows(len(record["time"]), self._planned.sim.timestep)
        drawn = recording.Drawn(rows, rrd.times(record["time"][rows], self._begin + rows + 1))
        robot = self._planned.robot
        recording.send_moving(self._stream, robot, record, drawn, look, self._room)
        live.send_plots(self._stream, plots, rows, look, drawn.times)

    def _begin_recording(self, look: Look) -> None:
        planned = self._planned
        live.log_summary(self._stream, planned.scenario.name)
        wanted = dict(zip(LEGS, planned.motions, strict=True))
        targets = {leg: motion.foot[1:] for leg, motion in wanted.items()}
        recording.log_still(
            self._stream, planned.robot, targets, look, on_floor=self._floor is not None
        )
        self._log_ground()

    def _widen(self, record: Record) -> None:
        """Draw more of the ground once the robot has come to its end."""
        if self._floor is None:
            return
        x = record["trunk_x"]
        wider = _reaching(self._room, float(x.min()), float(x.max()))
        if wider is not self._room:
            self._room = wider
            self._log_ground()

    def _log_ground(self) -> None:
        floor = self._floor
        if floor is None or floor.ground.level:
            rrd.log_room(self._stream, self._room)
        else:
            rrd.log_room(self._stream, self._room._replace(floor=False))
            shown_ground.log(self._stream, self._room, floor.ground, "")


def _room(planned: RobotPlan) -> Room:
    """Return the room that the robot has at the start; where it will go is not known yet."""
    robot = planned.robot
    size = max(robot.length, robot.leg.size)
    stands = isinstance(planned.scene, Floor)
    height = planned.start[2] if stands else 0.0
    built = planned.model
    weight = float(np.linalg.norm(built.opt.gravity) * built.body_subtreemass[0])

    return Room(
        low=np.array([-size, 0.0 if stands else -size]),
        high=np.array([size, height]),
        size=size,
        metre_per_newton=ARROW * size / weight if weight > 0.0 else 0.0,
        floor=stands,
    )


def _reaching(room: Room, first: float, last: float) -> Room:
    """Return a room that a robot between two places x [m] is within: the same if it was before."""
    low = float(room.low[0])
    high = float(room.high[0])
    if low <= first and last <= high:
        return room

    more = AHEAD * room.size
    start = low if low <= first else first - more
    stop = high if last <= high else last + more
    return room._replace(low=np.array([start, room.low[1]]), high=np.array([stop, room.high[1]]))
