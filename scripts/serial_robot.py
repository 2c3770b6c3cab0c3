"""What it costs to simulate a robot's five-bar legs as serial ones: torque, heat and speed.

Run: .venv/bin/python scripts/serial_robot.py [robot-q8bot-stand robot-q8bot-trot ...]

Simulators without closed loops take a leg's side A for all of it: femur AB and tibia BF, a motor
in the hip and, in place of E, one in the knee, each with a rotor's inertia on its joint. Femur and
tibia have the masses of both sides' links, so that the robot weighs the same. Foot path, servos,
bus and floor are those of the scenario; the knee gets the angles of the same path.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import MotorStep, applied_torque
from fivebar_sim.metrics.columns import motors
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.columns import of_leg
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import Plan, sent_setpoints
from fivebar_sim.simulation.steps import States, simulate
from fivebar_sim.walking.draws import outcome
from fivebar_sim.walking.plan import RobotPlan, plan_scenario
from fivebar_sim.walking.walk import Walk, of_states, walk

SHOWN = ("robot-q8bot-stand", "robot-q8bot-trot", "robot-q8bot-trot-fast")
"""Robots whose servos are sent angles: a torque law for A and E means nothing to a knee's motor."""

NOTHING = 1e-9
"""Mass of links that are there no more, as a part of what they had."""

HIP_KNEE = (0, 1)
"""Where the joints A and B are among a leg's four."""


class Told(NamedTuple):
    """What a simulation says of a robot.

    Attributes:
        peak: Largest torque of its eight motors [N m].
        rms: RMS of the torque of all motors over the window [N m].
        heat: Copper heat of all motors together over the window [W].
        rate: Largest rate of a motor [rad/s].
        speed: [m/s].
        falls: How many times it fell.
    """

    peak: float
    rms: float
    heat: float
    rate: float
    speed: float
    falls: int


def serial(planned: RobotPlan) -> mujoco.MjModel:
    """Return a robot's model with serial legs, the joints and motors in the same order.

    What is left of side E hangs from the trunk without mass, loop or motor, and weighs nothing.
    """
    model = plan_scenario(planned.scenario).model
    for name in LEGS:
        model.eq_active0[model.equality(f"{name}_C").id] = 0
        model.tendon_limited[model.tendon(f"{name}_C_angle").id] = 0
        for own, gone in (("L1", "L4"), ("L2", "L3")):
            _merge(model, f"{name}_{own}", f"{name}_{gone}")

        knee = model.joint(f"{name}_B")
        motor = model.joint(f"{name}_E")
        for field in (model.dof_armature, model.dof_damping, model.dof_frictionloss):
            field[knee.dofadr] = field[motor.dofadr]
        model.jnt_range[knee.id] = model.jnt_range[motor.id]
        model.actuator_trnid[model.actuator(f"{name}_E").id, 0] = knee.id
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _merge(model: mujoco.MjModel, own: str, gone: str) -> None:
    """Give a link the mass and the inertia of one that is gone, spread as its own are."""
    one = model.body(own).id
    other = model.body(gone).id
    more = 1.0 + model.body_mass[other] / model.body_mass[one]
    for field in (model.body_mass, model.body_inertia):
        field[one] *= more
        field[other] *= NOTHING


def knee_setpoints(leg: Plan) -> Array:
    """Return what reaches hip and knee in every step [rad], (N, 2): the bus is the leg's."""
    assert leg.asked is not None
    wanted = leg.motion
    # The bus holds the start pose until something arrives: that of A and B.
    joints = wanted.q.copy()
    joints[:, 2] = wanted.q[:, 1]
    asked = leg.asked.copy()
    asked[:, 1] = wanted.q[1:, 1]
    return sent_setpoints(leg.scenario, asked, wanted._replace(q=joints))


def of_serial(planned: RobotPlan) -> tuple[Walk, list[Array]]:
    """Return the walk of a robot with serial legs, and the torques of hip and knee of each."""
    table = np.concatenate([knee_setpoints(leg) for leg in planned.legs], axis=1)
    states = simulate(serial(planned), planned.start[None], table[None])
    torques = [_torque(planned, states, k) for k in range(len(LEGS))]
    return of_states(planned, states), torques


def _torque(planned: RobotPlan, states: States, k: int) -> Array:
    """Return the torque of hip and knee of leg k in each step [N m], (N, 2)."""
    legs = 4 * (k - len(LEGS))
    joints = [legs + joint for joint in HIP_KNEE]
    q = states.qpos[0][:, joints]
    before = np.concatenate([planned.start[None, joints], q[:-1]])
    step = MotorStep(
        integrator=planned.sim.integrator,
        ctrl=states.ctrl[0, :, 2 * k : 2 * k + 2],
        q=before,
        q_next=q,
        v_next=states.qvel[0][:, joints],
        drive="position",
    )
    return applied_torque(planned.scenario.servo, step)


def told(went: Walk, torques: Sequence[Array], rates: Sequence[Array]) -> Told:
    """Return what a simulation says; torques and rates of two motors a leg, (N, 2) each."""
    planned = went.plan
    window = planned.window
    torque = np.stack([each[window] for each in torques])
    servo = planned.scenario.servo
    heat = np.nan
    if servo.kt is not None and servo.resistance is not None:
        heat = float((servo.resistance * (torque / servo.kt) ** 2).mean(axis=1).sum())

    moved = outcome(went).moved
    return Told(
        peak=float(np.abs(torque).max()),
        rms=float(np.sqrt(np.mean(torque**2))),
        heat=heat,
        rate=float(max(np.abs(each[window]).max() for each in rates)),
        speed=moved.speed,
        falls=moved.falls,
    )


def both(scenario: RobotScenario) -> tuple[Told, Told]:
    """Return what five-bar legs and serial ones say of one scenario."""
    planned = plan_scenario(scenario)
    went = walk(planned)
    records = [of_leg(went.record, leg) for leg in LEGS]
    torques = [motors(record, "torque") for record in records]
    rates = [motors(record, "theta_dot") for record in records]

    alike, serial_torques = of_serial(planned)
    serial_records = [of_leg(alike.record, leg) for leg in LEGS]
    turning = [
        np.stack([record["theta_dot_A"], record["theta_dot_B"]], axis=-1)
        for record in serial_records
    ]
    return told(went, torques, rates), told(alike, serial_torques, turning)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=SHOWN)
    parser.add_argument("--set", dest="settings", nargs="*", default=[], help="KEY=VALUE")
    asked = parser.parse_args()

    print("| scenario | legs | torque peak, RMS [mN m] | heat [W] | motor [rad/s] | m/s | falls |")
    for name in asked.scenarios:
        scenario = Scenario.load(name, asked.settings)
        assert isinstance(scenario, RobotScenario)
        for legs, found in zip(("five-bar", "serial"), both(scenario), strict=True):
            print(
                f"| {name} | {legs} | {1e3 * found.peak:.3g}, {1e3 * found.rms:.3g} | "
                f"{found.heat:.3g} | {found.rate:.3g} | {found.speed:.3f} | {found.falls} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
