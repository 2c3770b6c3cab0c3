"""What is exported: a leg, a scenario or a robot by its name or file, as a spec of MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco

from fivebar_sim import model
from fivebar_sim.control import Feedback
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.files import resources, tables
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.robots import Robot
from fivebar_sim.robots import Scene as Stage
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Air, Scene

AIR = Air()


@dataclass(frozen=True)
class Subject:
    """What is exported.

    Attributes:
        name: Its name.
        words: What it is, for messages: "leg classic".
        leg: The leg, or each of a robot's.
        servo: The servos at its motors.
        robot: The robot, if it is one.
        scene: What a leg hangs on and stands on.
        stage: What a robot stands on.
        timestep: [s].
        integrator: "discrete" or "implicitfast".
        drive: Whether ctrl is an angle or a torque.
    """

    name: str
    words: str
    leg: FiveBar
    servo: Servo
    robot: Robot | None = None
    scene: Scene = AIR
    stage: Stage | None = None
    timestep: float | None = None
    integrator: Integrator = "discrete"
    drive: Drive = "position"

    def spec(self) -> mujoco.MjSpec:
        """Return the spec of which `fivebar run` compiles its model."""
        how = {"timestep": self.timestep, "integrator": self.integrator, "drive": self.drive}
        if self.robot is not None:
            return model.robot_spec(self.robot, self.stage, **how)
        return model.leg_spec(self.leg, servo=self.servo, scene=self.scene, **how)


def load(source: str, *, robot: bool = False) -> Subject:
    """Return the leg, scenario or robot of a name or of a TOML file.

    Args:
        source: A preset's or a scenario's name, or a file.
        robot: Whether a name that legs and robots share means the robot.

    Raises:
        ConfigError: Nothing has the name, or the file has something illegal.
    """
    kind = _kind(source, robot)
    if kind == "leg":
        leg = FiveBar.load(source)
        # As `fivebar view` holds it.
        return Subject(leg.name, f"leg {leg.name}", leg, Servo())
    if kind == "robot":
        chosen = Robot.load(source)
        return Subject(chosen.name, f"robot {chosen.name}", chosen.leg, chosen.servo, chosen)
    return _of(Scenario.load(source))


def _kind(source: str, robot: bool) -> str:
    """Return what a name or a file is of: "leg", "robot" or "scenario"."""
    known = {
        "robot": resources.shipped("models/robots"),
        "leg": resources.shipped("models/legs"),
        "scenario": resources.shipped("scenarios"),
    }
    kinds = [kind for kind, names in known.items() if source in names]

    if robot:
        kinds = ["robot"] if "robot" in kinds or source.endswith(".toml") else []
    elif source.endswith(".toml"):
        kinds = [_kind_of_table(tables.read(Path(source), "leg, scenario or robot"))]
    if not kinds:
        names = known["robot"] if robot else {name for each in known.values() for name in each}
        what = "robot" if robot else "leg, scenario or robot"
        raise ConfigError(unknown(what, source, names))
    return kinds[-1]


def _kind_of_table(table: tables.Table) -> str:
    """Return what a table is of."""
    if "hips" in table:
        return "robot"
    return "scenario" if "path" in table else "leg"


def _of(scenario: Scenario) -> Subject:
    """Return what a scenario simulates."""
    controller = scenario.controller
    drive = controller.drive if isinstance(controller, Feedback) else "position"
    robots = isinstance(scenario, RobotScenario)

    return Subject(
        name=scenario.name,
        words=f"scenario {scenario.name}",
        leg=scenario.leg,
        servo=scenario.servo,
        robot=scenario.robot if robots else None,
        scene=AIR if robots else scenario.scene,
        stage=scenario.scene if robots else None,
        timestep=scenario.sim.timestep,
        integrator=scenario.sim.integrator,
        drive=drive,
    )
