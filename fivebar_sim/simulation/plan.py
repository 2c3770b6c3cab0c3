"""Plans: a scenario that has been checked, with everything that its simulation needs."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim import model, motion
from fivebar_sim.arrays import Array, largest_of_rows
from fivebar_sim.control import Feedback, Setpoints
from fivebar_sim.control.bus import Bus
from fivebar_sim.control.interface import answer_of, is_numbers
from fivebar_sim.control.servo import FARTHEST
from fivebar_sim.control.step import check_whole_steps, whole_steps
from fivebar_sim.errors import ConfigError, SingularError
from fivebar_sim.metrics.columns import MOTOR_JOINTS, MOTORS
from fivebar_sim.motion import Motion
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground, Payload
from fivebar_sim.simulation import holding


class Plan(NamedTuple):
    """A checked scenario: the foot's motion, and the commands of the servos.

    Attributes:
        scenario: The scenario.
        motion: The wanted motion of foot and joints at every step.
        model: The leg's model.
        start: qpos at t = 0, (nq,).
        pushes: Commands of the actuators other than the motors: the forces on the foot in the
            scene "payload", at every step [N], (N, 0 or 2).
        setpoints: The setpoints that reach the motors in every step [rad], (N, 2); None where a
            feedback controller decides during the run.
        asked: The setpoints as the controller planned them, before the bus [rad], (N, 2).
    """

    scenario: Scenario
    motion: Motion
    model: mujoco.MjModel
    start: Array
    pushes: Array
    setpoints: Array | None
    asked: Array | None

    @property
    def ctrl(self) -> Array:
        """The commands of every step in MuJoCo's order, (N, nu); not with a feedback controller."""
        return self.commands(slice(None))

    def commands(self, steps: slice) -> Array:
        """Return the commands of some steps in MuJoCo's order, (n, nu); see `ctrl`."""
        assert self.setpoints is not None
        # The motors are a model's last two actuators.
        return np.concatenate([self.pushes[steps], self.setpoints[steps]], axis=1)


def plan(scenario: Scenario) -> Plan:
    """Return the plan of a scenario, without simulating anything.

    Raises:
        UnreachableError: The path leaves the leg's workspace; says when and where.
        SingularError: Joints come in line on the path; says when and where.
        ConfigError: A controller that plans setpoints of the wrong shape, not finite, or more than
            half a turn from the motors' angles, a control period that is not a whole number of
            timesteps, or servos that cannot hold the leg.
        GeometryError: A leg that cannot stand on the scene's ground.
    """
    wanted = motion.plan(
        scenario.leg,
        scenario.path,
        scenario.steps,
        scenario.sim.timestep,
        force=scenario.foot_force,
        payload=scenario.payload,
    )
    try:
        return _complete(scenario, wanted)
    except SingularError as error:
        raise motion.singular(error, wanted.foot, wanted.time) from None


def _complete(scenario: Scenario, wanted: Motion) -> Plan:
    """Return the plan of a scenario whose motion is planned; errors are those of `plan`."""
    sim = scenario.sim
    scene = scenario.scene
    # Before the model is built, which it does not need.
    holding.check(scenario, wanted)
    start = wanted.q[0]
    pushes = np.empty((scenario.steps, 0))

    if isinstance(scene, Ground):
        start = _above_ground(scenario, scene, start)

    if isinstance(scene, Payload):
        # A step from t to t + h is pushed by the force at t; none starts at the last instant.
        pushes = wanted.force[:-1]

    controller = scenario.controller
    asked = isinstance(controller, Feedback)
    built = model.build(
        scenario.leg,
        servo=scenario.servo,
        scene=scene,
        timestep=sim.timestep,
        integrator=sim.integrator,
        drive=controller.drive if asked else "position",
    )
    table = None if asked else asked_setpoints(scenario, controller, wanted)
    setpoints = None if table is None else sent_setpoints(scenario, table, wanted)
    planned = Plan(scenario, wanted, built, start, pushes, setpoints, table)

    # Called for its check alone: a bad period is refused now, not during the run.
    if asked:
        check_period(planned)
    return planned


def _above_ground(scenario: Scenario, scene: Ground, q: Array) -> Array:
    """Return qpos of a leg with its foot at the scene's height above the floor, (5,).

    Raises:
        ConfigError: The rail ends above the hip.
    """
    height = model.standing(scenario.leg, q) + max(scene.drop, model.CLEAR)
    if scene.stop is not None and not scene.stop <= height:
        raise ConfigError(
            f"scene.stop must be in [0, {height:g}] m, the hip's height at the start, "
            f"got {scene.stop:g}"
        )
    return np.array([height, *q])


def asked_setpoints(scenario: Scenario, controller: Setpoints, wanted: Motion) -> Array:
    """Return the setpoints that the scenario's controller plans, checked [rad], (N, 2)."""
    name = scenario.controller_name
    shape = (scenario.steps, 2)
    integrator = scenario.sim.integrator
    ctrl = answer_of(name, controller.setpoints, scenario.leg, scenario.servo, wanted, integrator)
    if not is_numbers(ctrl, shape) or not np.isfinite(ctrl).all():
        raise ConfigError(
            f"controller {name!r} must plan finite setpoints [rad] of shape {shape}, "
            f"got {ctrl.dtype} of shape {ctrl.shape}"
        )

    _check_near(scenario, ctrl, wanted)
    return ctrl.astype(np.float64)


def sent_setpoints(scenario: Scenario, asked: Array, wanted: Motion) -> Array:
    """Return the setpoints that reach the motors in every step [rad], (N, 2)."""
    bus = Bus([scenario.servo], "position", timestep=scenario.sim.timestep, steps=scenario.steps)
    # Until the first setpoint arrives the servos hold the start pose.
    bus.restart(np.arange(1), wanted.q[:1, ::2])
    return bus.send_all(asked[None])[0]


def _check_near(scenario: Scenario, ctrl: NDArray[Any], wanted: Motion) -> None:
    """Raise if a setpoint is farther from the planned angle than a servo can mean.

    A torque feedforward puts tau / kp into the setpoint: an angle that no servo would be sent.

    Raises:
        ConfigError: Says which motor's, how far, and when.
    """
    away = np.abs(ctrl - wanted.q[1:, MOTOR_JOINTS])
    far = largest_of_rows(away) > FARTHEST
    if far.any():
        k = int(np.argmax(far))
        motor = int(np.argmax(away[k]))
        name = scenario.controller_name
        raise ConfigError(
            f"controller {name!r} must plan setpoints within {FARTHEST:.4g} rad (half a turn) of "
            f"the motors' angles, got one for {MOTORS[motor]} that is {away[k, motor]:.4g} rad "
            f"away at t = {wanted.time[k]:g} s; is servo.kp = {scenario.servo.kp:g} N m/rad too "
            "soft for the load?"
        )


def check_period(plan: Plan) -> None:
    """Raise unless a plan's control period is a whole number of timesteps.

    Raises:
        ArgumentError: It is not.
    """
    controller = cast(Feedback, plan.scenario.controller)
    check_whole_steps("controller.period", controller.period, plan.motion.timestep)


def period_steps(plan: Plan) -> int:
    """Return the timesteps in a plan's control period.

    Raises:
        ArgumentError: The period is not a whole number of timesteps.
    """
    controller = cast(Feedback, plan.scenario.controller)
    return whole_steps("controller.period", controller.period, plan.motion.timestep)
