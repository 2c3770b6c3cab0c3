"""From robot and gait to model and commands: all that is decided before the first step."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import control, model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Setpoints, name_of
from fivebar_sim.errors import ConfigError, SingularError, UnreachableError
from fivebar_sim.integrator import Sim
from fivebar_sim.model.robot import standing_height
from fivebar_sim.motion import Motion
from fivebar_sim.paths import FootPath
from fivebar_sim.robots import LEGS, Floor, Gait, Robot, Scene
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import asked_setpoints, sent_setpoints


class RobotPlan(NamedTuple):
    """A robot whose legs follow a gait, ready to be simulated.

    Attributes:
        robot: The robot.
        gait: What its feet do.
        scene: What it stands on.
        sim: Timestep, integrator, seed.
        motions: What each leg should do, in the order of `LEGS`; each foot in its hip frame.
        model: The compiled MuJoCo model.
        start: qpos at t = 0: level, at rest, the lowest foot on the floor.
        setpoints: What reaches the motors in every step [rad], (N, 8).
    """

    robot: Robot
    gait: Gait
    scene: Scene
    sim: Sim
    motions: tuple[Motion, ...]
    model: mujoco.MjModel
    start: Array
    setpoints: Array

    @property
    def window(self) -> slice:
        """The rows that speed and load are measured over: whole periods after the ramp."""
        h = self.sim.timestep
        ramp = self.gait.path.ramp
        steps = len(self.setpoints)
        # 1e-9: a duration of whole periods must not lose one to rounding.
        periods = int((steps * h - ramp) / self.gait.period * (1.0 + 1e-9))
        first = round(ramp / h)
        return slice(first, min(round((ramp + periods * self.gait.period) / h), steps))


def plan(
    robot: Robot,
    gait: Gait,
    *,
    duration: float = 4.0,
    controller: Setpoints | None = None,
    scene: Scene | None = None,
    sim: Sim | None = None,
) -> RobotPlan:
    """Return the plan of a robot, without simulating anything.

    Args:
        robot: The robot.
        gait: What its feet do.
        duration: Length of the run [s].
        controller: Plans the setpoints of each leg from its motion, as in a scenario; None: the
            angles of the path, the shipped controller "servo" with its defaults.
        scene: What the robot stands on; None: a floor with its defaults.
        sim: Timestep, integrator, seed; None: the defaults.

    Raises:
        UnreachableError: The path leaves the workspace of a leg; says which, when and where.
        SingularError: Joints of a leg come in line; says which, when and where.
        ConfigError: The run has no whole period after the ramp, or a controller that plans what
            cannot be sent.
        GeometryError: Legs that cannot stand.
    """
    scene = Floor() if scene is None else scene
    sim = Sim() if sim is None else sim
    law: Setpoints = control.find("servo")() if controller is None else controller
    _check_duration(gait, duration)

    paths = gait.paths(robot)
    legs = [_of_leg(robot, paths[leg], law, duration, sim, leg) for leg in LEGS]
    motions = tuple(each for each, _ in legs)
    start = np.concatenate([each.q[0] for each in motions])
    if isinstance(scene, Floor):
        height = standing_height(robot, start.reshape(len(LEGS), 4))
        start = np.concatenate([[0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0], start])

    built = model.build_robot(robot, scene, timestep=sim.timestep, integrator=sim.integrator)
    setpoints = np.concatenate([sent for _, sent in legs], axis=1)
    return RobotPlan(robot, gait, scene, sim, motions, built, start, setpoints)


def _of_leg(
    robot: Robot, path: FootPath, controller: Setpoints, duration: float, sim: Sim, leg: str
) -> tuple[Motion, Array]:
    """Return what one leg should do, and the setpoints that reach its motors, (N, 2)."""
    # A leg is planned as it is alone: nothing of what a step does is written twice.
    alone = Scenario(
        name=f"{robot.name} {leg}",
        leg=robot.leg,
        path=path,
        controller=controller,
        controller_name=name_of(controller),
        servo=robot.servo,
        duration=duration,
        sim=sim,
    )

    try:
        wanted = motion.plan(robot.leg, path, alone.steps, sim.timestep)
        asked = asked_setpoints(alone, controller, wanted)
    except (UnreachableError, SingularError) as error:
        raise type(error)(f"{leg}: {error}", error.index) from None
    return wanted, sent_setpoints(alone, asked, wanted)


def _check_duration(gait: Gait, duration: float) -> None:
    """Raise unless a run has a whole period to measure."""
    check_number("duration", duration, "s", low=0.0, high=1e4, strict=True)
    least = gait.path.ramp + gait.period
    if not least <= duration * (1.0 + 1e-9):
        raise ConfigError(
            f"duration must be at least the ramp of {gait.path.ramp:g} s and one period of "
            f"{gait.period:g} s, to have something to measure; got {duration:g} s"
        )
