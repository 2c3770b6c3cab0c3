"""Robots whose legs have a motor S: where it takes their feet, what it bears, walks to the side."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fivebar_sim import Result, Scenario, kinematics, model, run
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.kinematics import hip as hips
from fivebar_sim.paths import Ellipse
from fivebar_sim.render.replay import replay
from fivebar_sim.robots import LEGS, Floor, Robot, places
from fivebar_sim.robots.columns import columns, of_leg
from fivebar_sim.robots.gait import TROT, Gait
from fivebar_sim.robots.hips import turned
from fivebar_sim.robots.hips.sideways import Sideways
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.simulation.record import Part
from fivebar_sim.simulation.steps import States
from fivebar_sim.walking import record
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.task import WalkTask
from fivebar_sim.walking.walk import walk

SIDE = 'robot.hips.side_step={kp=4, kd=0.03, mass="20 g", across="8 mm", along="-5 mm"}'
COMMON = ("limits={}", "robot.mass=0.3", "robot.servo=ideal", SIDE)
EACH = "{FL=%g, FR=%g, RL=%g, RR=%g}"


def stepping(*settings: str) -> RobotScenario:
    """Return a short trot of the Q8bot with motors S."""
    gait = ("duration=0.45", "path.ramp=0.1", "path.frequency=3", "path.lift=0.01")
    scenario = Scenario.load("robot-q8bot-trot", [*COMMON, *gait, *settings])
    assert isinstance(scenario, RobotScenario)
    return scenario


@pytest.fixture(scope="module")
def robot() -> Robot:
    return stepping().robot


@pytest.fixture(scope="module")
def aside() -> Result:
    """To the left, and not forward."""
    still = f"gait.strides={EACH % (0, 0, 0, 0)}"
    return run(stepping(still, f"gait.sideways={EACH % (1, 1, 1, 1)}"))


# law


def test_feet_are_planned_where_the_gait_has_them(robot: Robot) -> None:
    """With x of the gait forward and to the left, of all legs, by the planar path and by S."""
    ellipse = Ellipse(frequency=2.0, centre=(0.0, -0.045), radii=(0.01, 0.006), ramp=0.2)
    sideways = {"FL": 0.7, "FR": 0.7, "RL": -0.4, "RR": 1.2}
    paths = Gait(path=ellipse, phases=TROT, sideways=sideways).paths(robot)
    time = np.linspace(0.0, 0.8, 41)
    for leg in LEGS:
        path = paths[leg]
        assert isinstance(path, Sideways)
        hip = robot.hips[leg]
        swing = path.swing(time)[:, None]
        found = turned.in_trunk(hip, path.at(time).position, swing) - np.array(hip.pos)
        wanted = path.path.at(time).position
        x = -wanted[:, 0] if hip.mirrored else wanted[:, 0]
        np.testing.assert_allclose(found[:, 0], x, atol=1e-15)
        np.testing.assert_allclose(found[:, 1], sideways[leg] * x, atol=1e-15)
        np.testing.assert_allclose(found[:, 2], wanted[:, 1], atol=1e-15)

        # The kinematics of a hip with side-step say the same, foot by foot.
        assert hip.side_step is not None
        same = hips.SideStep(robot.leg, across=hip.offset(hip.side_step)[1], along=-5e-3)
        mirror = np.array([-1.0, 1.0, 1.0]) if hip.mirrored else np.ones(3)
        in_plane = hips.leg_plane(same, mirror * (found + np.array(hip.pos) - np.array(hip.axis)))
        np.testing.assert_allclose(path.swing(time), in_plane.phi, atol=1e-12)
        np.testing.assert_allclose(path.at(time).position, in_plane.foot, atol=1e-12)


def test_rates_of_a_path_to_the_side_are_its_slopes(robot: Robot) -> None:
    ellipse = Ellipse(frequency=2.0, centre=(0.0, -0.045), radii=(0.01, 0.006), ramp=0.2)
    path = Gait(path=ellipse, phases=TROT, sideways=dict.fromkeys(LEGS, 1.0)).paths(robot)["FR"]
    time = np.linspace(0.1, 0.6, 21)
    step = 1e-6
    for part, slope in (("position", "velocity"), ("velocity", "acceleration")):
        later, before = (getattr(path.nominal(time + s * step), part) for s in (1.0, -1.0))
        found = getattr(path.nominal(time), slope)
        scale = np.abs(found).max()
        np.testing.assert_allclose((later - before) / (2.0 * step), found, atol=1e-7 * scale)


# against MuJoCo


def test_feet_are_where_mujoco_has_them_and_slide_as_fast(robot: Robot) -> None:
    """At random poses and rates: the middle of each foot's ball, and its lowest point."""
    built = model.build_robot(robot, Floor())
    data = mujoco.MjData(built)
    rng = np.random.default_rng(3)
    h = 1e-6
    q = built.key("stand").qpos.copy()
    q[3:7] = np.array([1.0, 0.2, -0.3, 0.1]) / np.linalg.norm([1.0, 0.2, -0.3, 0.1])
    q[7:] += rng.uniform(-0.5, 0.5, len(q) - 7)
    v = rng.uniform(-1.0, 1.0, built.nv)
    after = q.copy()
    mujoco.mj_integratePos(built, after, v, h)
    both = np.stack([q, after])
    time = h * np.arange(1.0, 3.0)
    trunk = Trunk(time, both[:, :3], both[:, 3:7], np.tile(v[3:6], (2, 1)))
    data.qpos[:] = q
    mujoco.mj_kinematics(built, data)
    mujoco.mj_comPos(built, data)
    jac = np.empty((3, built.nv))

    for k, leg in enumerate(LEGS):
        own = slice(7 + 5 * k, 12 + 5 * k)
        record = recorded(robot, both[:, own], v[6 + 5 * k : 11 + 5 * k])
        geom = built.geom(f"{leg}_foot").id
        middle = data.geom_xpos[geom].copy()
        hip = robot.hips[leg]
        np.testing.assert_allclose(places.feet(trunk, hip, record)[0], middle, atol=1e-12)
        lowest = middle - np.array([0.0, 0.0, robot.leg.foot_radius])
        mujoco.mj_jac(built, data, jac, None, lowest, int(built.geom_bodyid[geom]))
        speed = np.hypot(*(jac @ v)[:2])
        assert places.slid(robot, trunk, hip, record)[1] / h == pytest.approx(speed, rel=1e-4)


def recorded(robot: Robot, q: Array, rates: Array) -> dict[str, Array]:
    """Return the columns of a leg at joint angles (S, A, B, E, D) [rad], (N, 5), and rates."""
    foot = kinematics.chain_points(robot.leg, q[:, 1:]).F
    record = {f"theta_{joint}": q[:, i] for i, joint in enumerate("SABED")}
    record |= {f"theta_dot_{joint}": np.full(2, rates[i]) for i, joint in enumerate("SABED")}
    return record | {"foot_x": foot[:, 0], "foot_z": foot[:, 1]}


def test_S_bears_the_foots_force_beside_its_axis() -> None:
    """Standing, tau = z F_y - y (F_z - W), of the floor's force, and what turns weighs W."""
    short = ("duration=0.4", "path.seconds=0.4", "path.ramp=0.1")
    still = "path.points=[[0, -0.04336], [0, -0.04336]]"
    found = run(Scenario.load("robot-q8bot-stand", [*COMMON, *short, still]))
    scenario = found.scenario
    assert isinstance(scenario, RobotScenario)
    robot = scenario.robot
    turns = 9.81 * (sum(link.mass for link in robot.leg.links) + 0.02)
    for leg in LEGS:
        record = of_leg(found.record, leg)
        last = {name: float(column[-1]) for name, column in record.items()}
        hip = robot.hips[leg]
        foot = np.array([last["foot_x"], last["foot_z"]])
        _, y, z = turned.in_trunk(hip, foot, [last["theta_S"]]) - np.array(hip.axis)
        down = z - robot.leg.foot_radius
        wanted = down * last["ground_y"] - y * (last["ground_z"] - turns)
        # It leans by less than a degree: what turns is not all at the foot's y.
        assert last["torque_S"] == pytest.approx(wanted, abs=2e-4)
        assert abs(y * last["ground_z"]) > 5e-3
    assert found.metrics["legs"]["FL"]["side_peak"] > 0.0


# what it is for


def test_robot_walks_to_the_left_and_its_energy_closes(aside: Result) -> None:
    moved = aside.metrics["robot"]
    # Feet pass the floor at stride times frequency / duty, 0.18 m/s.
    assert moved["drift"] == pytest.approx(0.15, abs=0.05)
    assert abs(moved["speed"]) < 0.05
    assert moved["falls"] == 0
    assert aside.metrics["energy"]["imbalance"] < 1e-4


def test_record_of_parts_is_that_of_the_whole() -> None:
    """Which is what `--live` shows; states that no simulation had, of commands that change."""
    planned = plan_scenario(stepping(f"gait.sideways={EACH % (1, 1, 1, 1)}"))
    steps = planned.scenario.steps
    rng = np.random.default_rng(2)
    blank = np.zeros((1, steps, 0))
    states = States(
        time=planned.sim.timestep * np.arange(1.0, steps + 1.0)[None],
        qpos=planned.start + 1e-3 * rng.standard_normal((1, steps, planned.model.nq)),
        qvel=rng.standard_normal((1, steps, planned.model.nv)),
        ctrl=rng.standard_normal((1, steps, planned.model.nu)),
        ground=rng.standard_normal((1, steps, 12)),
        constraint=rng.standard_normal((1, steps, planned.model.nv)),
        iterations=blank,
        warnings=np.zeros(1),
    )
    whole = record.columns(planned, Part(states, 0, planned.start))
    late = Part(states.part(slice(100, 300)), 100, states.qpos[0, 99])
    for name, column in record.columns(planned, late).items():
        np.testing.assert_array_equal(column, whole[name][100:300], err_msg=name)


def test_record_scenario_and_pictures_have_the_motor(aside: Result) -> None:
    scenario = aside.scenario
    assert isinstance(scenario, RobotScenario)
    assert [*aside.record] == columns(Floor(), motors=scenario.robot.hip_motors)
    assert Scenario.from_table(scenario.table(), "table", Path()) == scenario
    drawn = replay(aside.scenario, aside.record)
    assert drawn.walked is not None
    data = mujoco.MjData(drawn.model)
    data.qpos[:] = drawn.qpos[-1]
    mujoco.mj_kinematics(drawn.model, data)
    for k, leg in enumerate(LEGS):
        middle = data.geom(f"{leg}_foot").xpos
        np.testing.assert_allclose(drawn.walked.feet[k, -1], middle, atol=1e-9)


def test_recorded_frame_turns_with_the_motor(robot: Robot) -> None:
    """What a recording says of a hip frame takes its points where they are in the trunk."""
    swing = np.array([[-0.4], [0.0], [0.3]])
    point = np.array([0.01, -0.04])
    for leg in ("FL", "RR"):
        hip = robot.hips[leg]
        origin = turned.in_trunk(hip, np.zeros((3, 2)), swing)
        axes = places.rotation(turned.quaternion(hip, swing))
        found = origin + axes @ np.array([point[0], 0.0, point[1]])
        wanted = turned.in_trunk(hip, np.tile(point, (3, 1)), swing)
        np.testing.assert_allclose(found, wanted, atol=1e-15)


def test_legs_that_are_asked_have_S_too() -> None:
    law = 'controller={name="pd", kp=0.6, kd=0.006, period=0.002}'
    scenario = stepping(law, f"gait.sideways={EACH % (1, 1, 1, 1)}", "duration=0.45")
    planned = plan_scenario(scenario)
    assert planned.setpoints is None
    went = walk(planned)
    command = np.stack([went.record[f"{leg}_ctrl_S"] for leg in LEGS], axis=1)
    np.testing.assert_array_equal(went.states.ctrl[0, :, :4], command)
    assert np.abs(command).max() > 0.1
    swung = np.stack([went.record[f"{leg}_theta_S"] for leg in LEGS], axis=1)
    assert np.abs(swung - command).max() < 0.5 * np.abs(command).max()


# refusal


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["gait.sideways={FL=1}", SIDE], r"gait\.sideways\.FR is missing"),
        ([f"gait.sideways={EACH % (1, 1, 1, 1)}"], r"gait\.sideways needs a robot with hips\.side"),
        (["robot.hips.side_step={kp=4}"], r"hips\.side_step\.\w+ is missing"),
        ([SIDE, "robot.hips.side_step.kq=4"], r"\[hips\.side_step\]: unknown key 'kq'"),
        ([SIDE, "robot.hips.side_step.mass=0"], r"hips\.side_step\.mass must be in \[1e-06,"),
        ([SIDE, "robot.hips.FL.side_step.kp=1"], r"side_step is that of all legs, not hips\.FL"),
        ([SIDE, "robot.hips.side_step.mass=1"], r"mass must be in \(4\.0\d+, 1e\+06\] kg"),
    ],
)  # fmt: skip
def test_side_step_that_is_none_is_refused(settings: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Scenario.load("robot-q8bot-trot", ["limits={}", *settings])


def test_leg_that_would_swing_too_far_is_named() -> None:
    aside = f"gait.sideways={EACH % (0.1, 0.1, 1, 0.1)}"
    far = stepping("robot.hips.side_step.most=0.2", aside)
    with pytest.raises(
        ConfigError, match=r"^RL: theta_S must be in \[-0\.2, 0\.2\] rad, .* at t ="
    ):
        plan_scenario(far)


def test_environment_says_that_it_has_eight_actions(robot: Robot) -> None:
    with pytest.raises(ArgumentError, match="robot must have eight motors"):
        WalkTask(robot=robot)
