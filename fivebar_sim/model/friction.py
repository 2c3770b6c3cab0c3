"""The gears' friction in a model: MuJoCo's frictionloss, and the numbers of one that changes."""

from __future__ import annotations

import mujoco

from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import NUMBERS
from fivebar_sim.control.servo import Servo
from fivebar_sim.metrics.columns import MOTORS

FRICTION_LAW = "friction_law"
"""Where a model keeps the numbers of a friction that changes from step to step."""


def rub(spec: mujoco.MjSpec, servo: Servo) -> None:
    """Give the joints of both motors the friction of their gears."""
    if servo.dry == 0.0 and not servo.gear.changes:
        return
    for name in MOTORS:
        joint = spec.joint(name)
        # A hard constraint: with MuJoCo's default values a light joint does not stick.
        joint.frictionloss = servo.dry
        # Two timesteps is the shortest time constant that MuJoCo's solver keeps stable.
        joint.solref_friction = (2.0 * spec.option.timestep, 1.0)
        joint.solimp_friction[:3] = (0.9999, 0.9999, 0.001)

    tell_law(spec, servo)


def tell_law(spec: mujoco.MjSpec, servo: Servo) -> None:
    """Give a model the numbers of a friction that changes, if it does.

    Whoever steps the model sets the largest friction of every step by them. A robot's model needs
    them too: of the legs that are attached to it only what moves comes along.
    """
    if servo.gear.changes:
        law = [getattr(servo.gear, name) for name in NUMBERS]
        spec.add_numeric(name=FRICTION_LAW, data=law, size=len(law))


def friction_law(built: mujoco.MjModel) -> Array | None:
    """Return the numbers of a model's friction that changes, as in `control.friction.NUMBERS`.

    None where it does not change.
    """
    found = mujoco.mj_name2id(built, mujoco.mjtObj.mjOBJ_NUMERIC, FRICTION_LAW)
    if found < 0:
        return None
    start = int(built.numeric_adr[found])
    return built.numeric_data[start : start + len(NUMBERS)].copy()
