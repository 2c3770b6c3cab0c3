"""From robot and gait to model and commands: all that is decided before the first step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np

from fivebar_sim import control, model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Feedback, Setpoints, name_of
from fivebar_sim.errors import ConfigError, SingularError, UnreachableError
from fivebar_sim.integrator import Sim
from fivebar_sim.model.robot import standing_height
from fivebar_sim.motion import Motion
from fivebar_sim.paths import FootPath
from fivebar_sim.robots import LEGS, Floor, Gait, Robot, Scene
from fivebar_sim.robots.gait import TOGETHER
from fivebar_sim.robots.hips.swings import swings
from fivebar_sim.robots.push import Push, forces
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import Plan, asked_setpoints, check_period, sent_setpoints


class RobotPlan(NamedTuple):
    """A robot whose legs follow a gait, ready to be simulated.

    Attributes:
        scenario: The robot's scenario.
        legs: The plan of each leg, in the order of `LEGS`, as if it were alone in the air; each has
            the robot's model.
        model: The compiled MuJoCo model.
        start: qpos at t = 0: level, at rest, the lowest foot `CLEAR` above the floor.
        setpoints: What reaches the motors in every step [rad], (N, 8); None where a feedback
            controller decides during the run.
        pushes: Forces on the trunk in every step [N], (N, 3) for each push.
        swings: Commands of the motors of hips [rad], (N, 4, m), m of each leg, see `Hip.motors`.
    """

    scenario: RobotScenario
    legs: tuple[Plan, ...]
    model: mujoco.MjModel
    start: Array
    setpoints: Array | None
    pushes: Array
    swings: Array

    @property
    def besides(self) -> Array:
        """What ctrl begins with, before the commands of A and E, in every step, (N, n)."""
        turns = self.swings.reshape(len(self.swings), -1)
        return np.concatenate([self.pushes, turns], axis=1)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.scenario.robot

    @property
    def motions(self) -> tuple[Motion, ...]:
        """What each leg should do, in the order of `LEGS`; each foot in its hip frame."""
        return tuple(leg.motion for leg in self.legs)

    @property
    def scene(self) -> Scene:
        """What it stands on."""
        return self.scenario.scene

    @property
    def sim(self) -> Sim:
        """Timestep, integrator, seed."""
        return self.scenario.sim

    @property
    def window(self) -> slice:
        """The rows that speed and load are measured over; see `Scenario.window`."""
        return self.scenario.window


def plan(
    robot: Robot,
    gait: Gait,
    *,
    duration: float = 4.0,
    controller: Setpoints | Feedback | None = None,
    scene: Scene | None = None,
    sim: Sim | None = None,
    pushes: Sequence[Push] = (),
) -> RobotPlan:
    """Return the plan of a robot, without simulating anything.

    Args:
        robot: The robot.
        gait: What its feet do.
        duration: Length of the run [s].
        controller: Drives each leg, as in a leg's scenario: plans its setpoints, or is asked at
            every control step. None: the angles of the path, the shipped controller "servo" with
            its defaults.
        scene: What the robot stands on; None: a floor with its defaults.
        sim: Timestep, integrator, seed; None: the defaults.
        pushes: Forces on its trunk.

    Raises:
        UnreachableError: The path leaves the workspace of a leg; says which, when and where.
        SingularError: Joints of a leg come in line; says which, when and where.
        ConfigError: The run has no whole period after the ramp, or a controller that plans what
            cannot be sent.
        GeometryError: Legs that cannot stand.
    """
    _check_duration(gait, duration)
    law: Setpoints | Feedback = control.find("servo")() if controller is None else controller

    return plan_scenario(
        RobotScenario(
            name=robot.name,
            robot=robot,
            leg=robot.leg,
            servo=robot.servo,
            path=gait.path,
            phases=gait.phases,
            strides=gait.strides,
            sideways=gait.sideways,
            steering=gait.steering,
            controller=law,
            controller_name=name_of(law),
            scene=Floor() if scene is None else scene,
            duration=duration,
            sim=Sim() if sim is None else sim,
            pushes=tuple(pushes),
        )
    )


def plan_scenario(scenario: RobotScenario) -> RobotPlan:
    """Return the plan of a robot's scenario; errors are those of `plan`."""
    robot = msgspec.structs.replace(scenario.robot, servo=scenario.servo)
    sim = scenario.sim
    # First: a robot that cannot stand is refused before any of its legs is planned.
    built = model.build_robot(
        robot,
        scenario.scene,
        timestep=sim.timestep,
        integrator=sim.integrator,
        drive=getattr(scenario.controller, "drive", "position"),
        pushes=scenario.pushes,
    )
    paths = scenario.gait.paths(robot)
    legs = tuple(_of_leg(scenario, paths[leg], leg, built) for leg in LEGS)
    time = sim.timestep * np.arange(scenario.steps + 1, dtype=np.float64)
    turns = swings(robot, paths, scenario.steering or TOGETHER, time)
    poses = np.stack([leg.start for leg in legs])
    start = np.concatenate([turns[0], poses], axis=1).ravel()
    if isinstance(scenario.scene, Floor):
        height = standing_height(robot, poses, scenario.scene.ground, turns[0]) + model.CLEAR
        start = np.concatenate([[0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0], start])

    sent = [leg.setpoints for leg in legs if leg.setpoints is not None]
    table = np.concatenate(sent, axis=1) if sent else None
    pushed = forces(scenario.pushes, scenario.steps, sim.timestep)
    return RobotPlan(scenario, legs, built, start, table, pushed, turns[1:])


def _of_leg(scenario: RobotScenario, path: FootPath, leg: str, built: mujoco.MjModel) -> Plan:
    """Return the plan of one leg."""
    controller = scenario.controller
    # A leg is planned as it is alone: nothing of what a step does is written twice.
    alone = Scenario(
        name=f"{scenario.name} {leg}",
        leg=scenario.leg,
        path=path,
        controller=controller,
        controller_name=scenario.controller_name,
        servo=scenario.servo,
        sensors=scenario.sensors,
        duration=scenario.duration,
        sim=_seeded(scenario.sim, leg),
    )

    try:
        wanted = motion.plan(alone.leg, path, alone.steps, alone.sim.timestep)
        start = wanted.q[0]
        pushes = np.empty((alone.steps, 0))
        if isinstance(controller, Feedback):
            planned = Plan(alone, wanted, built, start, pushes, None, None)
            # Now, not during the run.
            check_period(planned)
            return planned
        asked = asked_setpoints(alone, controller, wanted)
    except (UnreachableError, SingularError) as error:
        raise type(error)(f"{leg}: {error}", error.index) from None
    sent = sent_setpoints(alone, asked, wanted)
    return Plan(alone, wanted, built, start, pushes, sent, asked)


def _seeded(sim: Sim, leg: str) -> Sim:
    """Return the table [sim] of one leg: the noise of its sensors is its own."""
    return msgspec.structs.replace(sim, seed=len(LEGS) * sim.seed + LEGS.index(leg))


def _check_duration(gait: Gait, duration: float) -> None:
    """Raise unless a run has a whole period to measure."""
    check_number("duration", duration, "s", low=0.0, high=1e4, strict=True)
    least = gait.path.ramp + gait.period
    if not least <= duration * (1.0 + 1e-9):
        raise ConfigError(
            f"duration must be at least the ramp of {gait.path.ramp:g} s and one period of "
            f"{gait.period:g} s, to have something to measure; got {duration:g} s"
        )
