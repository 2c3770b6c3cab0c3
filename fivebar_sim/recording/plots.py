"""The plots of a recording: a record as lines over time, in units that people read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.metrics import ground, load
from fivebar_sim.metrics.columns import COMMAND_COLUMNS, JOINT_COLUMNS, MOTORS, Record, motors
from fivebar_sim.metrics.tracking import tracking_error
from fivebar_sim.recording.look import Colour, shade
from fivebar_sim.recording.poses import points, timestep

if TYPE_CHECKING:
    from fivebar_sim.scenario import Scenario

SHARE_WINDOW = 0.05
"""Width of the window over which the load share is taken [s]."""


class Series(NamedTuple):
    """Lines of one plot.

    Attributes:
        path: Entity; its first part is the plot, so that "torque/limit" is drawn with "torque".
        title: Title with its unit.
        lines: Name and colour of each line.
        values: Values in the title's unit, (n, len(lines)).
        shown: Whether a row of the record has values, (N,); n of them have.
        bounds: The plot's fixed range, or None to fit the values.
    """

    path: str
    title: str
    lines: dict[str, Colour]
    values: Array
    shown: Bools
    bounds: tuple[float, float] | None = None

    @property
    def plot(self) -> str:
        """The plot in which it is drawn."""
        return self.path.split("/")[0]


MOTOR_COLOURS: dict[str, Colour] = {motor: shade(motor) for motor in MOTORS}
ANGLE_COLOURS: dict[str, Colour] = {
    name: shade(name.removeprefix("theta_")) for name in JOINT_COLUMNS
}
COMMAND_COLOURS: dict[str, Colour] = dict.fromkeys(COMMAND_COLUMNS, shade("muted"))


def series(scenario: Scenario, record: Record) -> Iterator[Series]:
    """Yield the plots of a run, in the order in which they are shown.

    Commands are drawn with their own kind: angles with the joints, torques with the motors.
    """
    every = np.ones(len(record["time"]), dtype=bool)
    error = tracking_error(record)
    torque = motors(record, "torque")
    share, loaded = load.moving_share(torque, round(0.5 * SHARE_WINDOW / timestep(record["time"])))
    in_torque = getattr(scenario.controller, "drive", "position") == "torque"

    yield Series(
        "tracking_error",
        "Tracking error [mm]",
        {"error": shade("foot")},
        1e3 * error[:, None],
        every,
    )
    yield from _torques(scenario, record, torque, every, in_torque=in_torque)
    yield Series(
        "load_share",
        "Load share of A [%]",
        {"A": shade("A")},
        1e2 * share[:, None],
        loaded,
        (0.0, 100.0),
    )
    yield Series("gap", "Loop gap [um]", {"gap": shade("ink")}, 1e6 * record["gap"][:, None], every)
    angles = ANGLE_COLOURS if in_torque else ANGLE_COLOURS | COMMAND_COLOURS
    title = "Joint angles [deg]" if in_torque else "Joint angles, setpoints [deg]"
    yield Series("angles", title, angles, np.degrees(_columns(record, *angles)), every)

    if "ground_z" in record:
        height = 1e3 * ground.height(scenario.leg, record)[:, None]
        force = points(record, "ground")
        yield Series(
            "ground_force",
            "Ground force [N]",
            {"x": shade("muted"), "z": shade("force")},
            force,
            every,
        )
        yield Series("foot_height", "Foot height [mm]", {"foot": shade("foot")}, height, every)


def _torques(
    scenario: Scenario, record: Record, torque: Array, every: Bools, *, in_torque: bool
) -> Iterator[Series]:
    """Yield the motor torques, the commanded ones of a torque drive, and the servo's limits."""
    title = "Motor torques [mN m]"
    limit = scenario.servo.limit
    yield Series("torque", title, MOTOR_COLOURS, 1e3 * torque, every)
    if in_torque:
        yield Series("torque/ctrl", title, COMMAND_COLOURS, 1e3 * motors(record, "ctrl"), every)
    if limit is not None:
        both = np.tile([1e3 * limit, -1e3 * limit], (len(every), 1))
        yield Series(
            "torque/limit", title, dict.fromkeys(("limit", "-limit"), shade("muted")), both, every
        )


def _columns(record: Record, *names: str) -> Array:
    """Return columns side by side, (N, len(names))."""
    return np.stack([record[name] for name in names], axis=-1)
