"""All of a robot's metrics.json, with types: what a leg's has, of four legs, and what they carry.

`load`, `tracking` and so on are those of all legs together; `legs` has the load of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from fivebar_sim.metrics.json_types import Amount, Count, Motors, Number, Part, Parts, Table
from fivebar_sim.metrics.limits import Limit
from fivebar_sim.metrics.measured import Judged, JudgedRows, Measured, MeasuredRows, judgement


class RobotTable(Table, frozen=True):
    """The table "robot": how the trunk moved over the window; see `measure.Gone`.

    Attributes:
        speed: Along its own heading [m/s].
        body_lengths_per_second: The same, in lengths of the trunk.
        drift: To the left of its heading [m/s].
        turn_rate: About the vertical, to the left [rad/s].
        lean: Largest angle between the trunk's z axis and the floor's [rad].
        bob: Range of the height of its origin [m].
        falls: How many times it fell in the whole run.
        cost_of_transport: Work that the motors gave, for the weight and the way along the heading;
            what they took back is lost. None where it got nowhere.
        cost_of_transport_electric: The same with the copper heat; None as above, and where the
            servo's table does not describe the winding.
        jump_height: Rise of the trunk from where it set off to its apogee [m], of a path that does
            not repeat, and so is the next; unset in a gait. None where all feet never left the
            floor. See `jump.Jump`.
        agility: The same by the time that it took [m/s].
        recovery: Time from the end of the last push until the trunk is up as before [s]; unset
            without pushes, None where it fell or never was. See `push.recovery`.
    """

    speed: Number
    body_lengths_per_second: Number
    drift: Number
    turn_rate: Number
    lean: Number
    bob: Amount
    falls: Count
    cost_of_transport: Amount
    cost_of_transport_electric: Amount
    jump_height: Amount | msgspec.UnsetType = msgspec.UNSET
    agility: Amount | msgspec.UnsetType = msgspec.UNSET
    recovery: Amount | msgspec.UnsetType = msgspec.UNSET


class LegTable(Table, frozen=True):
    """What one leg of a robot did over the window.

    Attributes:
        tracking_rms: Distance of the foot from its target, RMS [m].
        torque_rms: Of each motor [N m].
        torque_peak: Of each motor [N m].
        share_A: A's part of the leg's absolute torque impulse.
        share_of_robot: The leg's part of that of all eight motors.
        saturated: Part of the steps in which the torque limit clipped each motor.
        side_rms: Torque of the motor S, RMS [N m]; unset of legs without one.
        side_peak: Its largest torque [N m]; unset as above.
        side_work: Work that it gave; what it took back is lost [J]; unset as above.
        side_heat: Its mean copper heat [W]; unset also where its winding is not known.
        steer_rms, steer_peak, steer_work, steer_heat: The same of the motor T.
        heat: Mean copper heat of each motor [W]; unset where the winding is not known.
        duty: Part of the time in which the foot stands; unset in the air, as is all below.
        slip: Distance that the foot slid while it stood [m].
        weight_share: The foot's part of the vertical impulse of all feet.
        force_peak: Largest vertical force on the foot [N].
    """

    tracking_rms: Amount
    torque_rms: Motors
    torque_peak: Motors
    share_A: Part
    share_of_robot: Part
    saturated: Parts
    side_rms: Amount | msgspec.UnsetType = msgspec.UNSET
    side_peak: Amount | msgspec.UnsetType = msgspec.UNSET
    side_work: Amount | msgspec.UnsetType = msgspec.UNSET
    side_heat: Amount | msgspec.UnsetType = msgspec.UNSET
    steer_rms: Amount | msgspec.UnsetType = msgspec.UNSET
    steer_peak: Amount | msgspec.UnsetType = msgspec.UNSET
    steer_work: Amount | msgspec.UnsetType = msgspec.UNSET
    steer_heat: Amount | msgspec.UnsetType = msgspec.UNSET
    heat: Motors | msgspec.UnsetType = msgspec.UNSET
    duty: Part | msgspec.UnsetType = msgspec.UNSET
    slip: Amount | msgspec.UnsetType = msgspec.UNSET
    weight_share: Part | msgspec.UnsetType = msgspec.UNSET
    force_peak: Amount | msgspec.UnsetType = msgspec.UNSET


class LegsTable(Table, frozen=True):
    """The table "legs"."""

    FL: LegTable
    FR: LegTable
    RL: LegTable
    RR: LegTable


class RobotMeasured(MeasuredRows, frozen=True, kw_only=True):
    """What a robot's run measured, before anyone judged it."""

    robot: RobotTable | msgspec.UnsetType = msgspec.UNSET
    legs: LegsTable


class RobotJudged(JudgedRows, frozen=True, kw_only=True):
    """All of a robot's metrics.json."""

    robot: RobotTable | msgspec.UnsetType = msgspec.UNSET
    legs: LegsTable


def of(common: Measured, robot: RobotTable | msgspec.UnsetType, legs: LegsTable) -> Measured:
    """Return what a robot's run measured.

    Args:
        common: What a leg's run has too, of all legs together.
        robot: How the trunk moved; unset where it was held.
        legs: What each leg did.
    """
    return RobotMeasured(**msgspec.structs.asdict(common), robot=robot, legs=legs)


def with_verdict(
    measured: Measured, limits: Sequence[Limit], provenance: Mapping[str, str | int | float | None]
) -> Judged:
    """Return what was measured with its verdict; see `metrics.measured.with_verdict`."""
    judged = judgement(measured, limits, provenance)
    return RobotJudged(**{**msgspec.structs.asdict(measured), **judged})


def read(table: Any) -> Judged:
    """Return all of metrics.json from its nested dictionaries.

    Raises:
        msgspec.ValidationError: A key is missing or unknown, or a value outside its range.
    """
    return msgspec.convert(table, RobotJudged)
