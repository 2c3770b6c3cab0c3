"""What the motors of a robot's hips had to do: torque, work and heat of each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics import tracking
from fivebar_sim.metrics.columns import Record
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.columns import of_leg
from fivebar_sim.robots.hips.motors import HipMotor, column
from fivebar_sim.walking.plan import RobotPlan


class HipLoad(NamedTuple):
    """The load of one motor of a leg's hip over the window.

    Attributes:
        motor: The motor.
        rms: Of its torque [N m].
        peak: Its largest torque [N m].
        work: What it gave; what it took back is lost [J].
        heat: Mean copper heat [W]; None where the winding is not known.
    """

    motor: HipMotor
    rms: float
    peak: float
    work: float
    heat: float | None

    @property
    def table(self) -> dict[str, float]:
        """What the table of its leg says of it, by key, such as `side_rms`."""
        does = self.motor.does
        found = {f"{does}_rms": self.rms, f"{does}_peak": self.peak, f"{does}_work": self.work}
        return found if self.heat is None else found | {f"{does}_heat": self.heat}


def hip_loads(planned: RobotPlan, record: Record) -> dict[str, list[HipLoad]]:
    """Return the load of the motors of each leg's hip, by leg.

    Args:
        planned: What was simulated.
        record: The robot's columns.
    """
    width = planned.robot.joints
    found: dict[str, list[HipLoad]] = {}
    for k, leg in enumerate(LEGS):
        own = of_leg(record, leg)
        start = planned.start[width * (k - len(LEGS)) :]
        found[leg] = [
            _load(planned, motor, own, float(start[i]))
            for i, motor in enumerate(planned.robot.hip_motors)
        ]
    return found


def _load(planned: RobotPlan, motor: HipMotor, record: Record, start: float) -> HipLoad:
    """Return the load of one motor, whose angle begins at `start` [rad]."""
    window = planned.window
    torque = record[column("torque", motor)]
    turned = np.diff(record[column("theta", motor)], prepend=start)
    work = (torque * turned)[window]
    return HipLoad(
        motor=motor,
        rms=tracking.root_mean_square(torque[window]),
        peak=float(np.abs(torque[window]).max()),
        work=float(np.maximum(work, 0.0).sum()),
        heat=_heat(motor, torque[planned.scenario.for_good]),
    )


def _heat(motor: HipMotor, torque: Array) -> float | None:
    """Return the mean copper heat R (tau / kt)^2 of a motor [W]; None if that is not known."""
    winding = motor.winding
    if winding is None:
        return None
    return float(winding.R * np.mean((torque / winding.kt) ** 2))


def all_heat(loads: dict[str, list[HipLoad]]) -> float | None:
    """Return the heat of all motors of all hips [W]; None where that of one is not known."""
    heats: list[Any] = [load.heat for leg in loads.values() for load in leg]
    return None if None in heats else float(sum(heats))
