"""The firmware's arithmetic in NumPy: the same bits as `firmware/fivebar_leg.c`."""

from fivebar_sim.firmware.hip import Hip, hip_forward, hip_inverse
from fivebar_sim.firmware.kinematics import (
    Joints,
    forward,
    inverse,
    inverse_all,
    inverse_nearest,
    jacobian,
    joints,
    knees,
    reaches,
    torque,
)
from fivebar_sim.firmware.leg import Leg, of, prepare
from fivebar_sim.firmware.nearest import nearest
from fivebar_sim.firmware.rounding import rounding
from fivebar_sim.firmware.servo import FirmwareServo, gait_at, servo_angle, servo_command
from fivebar_sim.firmware.status import Status

__all__ = [
    "FirmwareServo",
    "Hip",
    "Joints",
    "Leg",
    "Status",
    "forward",
    "gait_at",
    "hip_forward",
    "hip_inverse",
    "inverse",
    "inverse_all",
    "inverse_nearest",
    "jacobian",
    "joints",
    "knees",
    "nearest",
    "of",
    "prepare",
    "reaches",
    "rounding",
    "servo_angle",
    "servo_command",
    "torque",
]
