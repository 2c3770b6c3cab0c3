"""Robots whose legs are steered by a motor T, alone or with S: kinematics, walks, refusals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import mujoco
import numpy as np
import pytest

from fivebar_sim import Result, Scenario, kinematics, model, run
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.kinematics import hip as hips
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.render.replay import replay
from fivebar_sim.report.robot import ROWS
from fivebar_sim.robots import LEGS, Floor, Hip, Robot, places
from fivebar_sim.robots.columns import columns
from fivebar_sim.robots.hips import turned
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.shown.recording import series
from fivebar_sim.walking.task import WalkTask
from fivebar_sim.walking.walk import walk

T = {"kp": 20.0, "kd": 0.1, "mass": 0.03}
OFF = {"across": 0.006, "along": 0.03}
S = {"kp": 20.0, "kd": 0.1, "mass": 0.03, "across": 0.01, "along": -0.005}
ANGLE = 0.3
SPEED = 0.25
"""Of feet past the floor [m/s]: the stride, its frequency, by the duty."""


def trotting(
    to: Sequence[float] = (0.0, 0.0, 0.0, 0.0), sideways: float = 0.0, **changes: object
) -> RobotScenario:
    """Return a short trot of a robot with mirrored rear legs and motors of its hips.

    Args:
        to: Where each leg is steered [rad].
        sideways: Of all legs.
        changes: Of the hips' motors, and of the scenario's duration and scene.
    """
    hips = {
        "FL": {"pos": [0.08, 0.06, 0.0]},
        "FR": {"pos": [0.08, -0.06, 0.0]},
        "RL": {"pos": [-0.08, 0.06, 0.0], "mirrored": True},
        "RR": {"pos": [-0.08, -0.06, 0.0], "mirrored": True},
    }
    motors = {key: changes.pop(key) for key in ("steering", "side_step") if key in changes}
    gait: dict[str, object] = {"phases": "trot"}
    if any(to):
        gait["steering"] = dict(zip(LEGS, to, strict=True))
    if sideways:
        gait["sideways"] = dict.fromkeys(LEGS, sideways)

    table = {
        "name": "steered",
        "robot": {
            "name": "mine",
            "leg": "classic",
            "servo": "ideal",
            "mass": 0.9,
            "trunk": {"size": [0.2, 0.1, 0.04]},
            "hips": {**hips, **motors},
        },
        "duration": 0.6,
        "path": {
            "kind": "gait",
            "centre": [0.0, -0.08],
            "stride": 0.05,
            "lift": 0.02,
            "duty": 0.6,
            "frequency": 3.0,
            "ramp": 0.25,
        },
        "gait": gait,
    }
    scenario = Scenario.from_table(table | changes, "steered", Path())
    assert isinstance(scenario, RobotScenario)
    return scenario


@pytest.fixture(scope="module", params=["T", "T and S"])
def robot(request: pytest.FixtureRequest) -> Robot:
    if request.param == "T":
        return trotting(steering=T | OFF).robot
    return trotting(steering=T | OFF, side_step=S).robot


@pytest.fixture(scope="module")
def crabbing() -> Result:
    """All legs point to the left, and T has a winding."""
    return run(trotting((ANGLE,) * 4, steering=T | OFF | {"kt": 0.2, "resistance": 3.0}))


def by_kinematics(robot: Robot, hip: Hip, turns: Array, theta: Array) -> Array:
    """Return a foot in the trunk's frame by `kinematics.hip`: Steering of SideStep of the leg."""
    sign = -1.0 if hip.mirrored else 1.0
    steering = hip.steering
    assert steering is not None
    across = sign * hip.offset(steering)[1]
    found = hips.forward(
        hips.Steering(robot.leg, across=across, along=steering.along), [turns[0], *theta]
    )
    if hip.side_step is not None:
        # Of a mirrored leg the hip frame is turned about z, and what turns about x turns back.
        step = hips.SideStep(
            robot.leg, across=sign * hip.offset(hip.side_step)[1], along=hip.side_step.along
        )
        foot = hips.forward(step, [sign * turns[1], *theta])
        x, y, z = foot + np.array([steering.along, across, 0.0])
        cos = np.cos(turns[0])
        sin = np.sin(turns[0])
        found = np.array([x * cos - y * sin, x * sin + y * cos, z])
    return np.array(hip.axis) + np.array([sign, sign, 1.0]) * found


# law, and against MuJoCo


class Posed(NamedTuple):
    """A robot at random angles and rates: qpos, after a microsecond too, qvel, MuJoCo's data."""

    built: mujoco.MjModel
    data: mujoco.MjData
    q: Array
    v: Array

    def record(self, robot: Robot, k: int) -> dict[str, Array]:
        """Return the columns of leg k."""
        own = slice(7 + robot.joints * k, 7 + robot.joints * (k + 1))
        return recorded(robot, self.q[:, own], self.v[6 + robot.joints * k :])


STEP = 1e-6


@pytest.fixture(scope="module")
def posed(robot: Robot) -> Posed:
    built = model.build_robot(robot, Floor())
    data = mujoco.MjData(built)
    rng = np.random.default_rng(3)
    q = built.key("stand").qpos.copy()
    q[7:] += rng.uniform(-0.5, 0.5, len(q) - 7)
    v = rng.uniform(-1.0, 1.0, built.nv)
    for k in range(len(LEGS)):
        # Closed loops, for the kinematics know no others.
        last = 7 + robot.joints * (k + 1)
        q[last - 3 : last : 2] = kinematics.passive(robot.leg, q[last - 4 : last : 2])

    after = q.copy()
    mujoco.mj_integratePos(built, after, v, STEP)
    data.qpos[:] = q
    mujoco.mj_kinematics(built, data)
    mujoco.mj_comPos(built, data)
    return Posed(built, data, np.stack([q, after]), v)


def test_feet_are_where_mujoco_and_the_kinematics_have_them(robot: Robot, posed: Posed) -> None:
    for k, leg in enumerate(LEGS):
        hip = robot.hips[leg]
        record = posed.record(robot, k)
        turns = turned.angles(hip, record)[0]
        theta = np.array([record[f"theta_{motor}"][0] for motor in "AE"])
        foot = by_kinematics(robot, hip, turns, theta)
        middle = posed.data.geom(f"{leg}_foot").xpos - posed.q[0, :3]
        np.testing.assert_allclose(foot, middle, rtol=0.0, atol=1e-12)

        F = np.array([record["foot_x"][0], record["foot_z"][0]])
        np.testing.assert_allclose(turned.in_trunk(hip, F, turns), middle, rtol=0.0, atol=1e-12)
        # What a recording says of the hip frame takes the foot there too.
        axes = places.rotation(turned.quaternion(hip, turns[None]))[0]
        origin = turned.in_trunk(hip, np.zeros(2), turns)
        found = origin + axes @ np.array([F[0], 0.0, F[1]])
        np.testing.assert_allclose(found, middle, rtol=0.0, atol=1e-12)


def test_lowest_points_of_feet_slide_as_fast_as_mujoco_has_them(robot: Robot, posed: Posed) -> None:
    q = posed.q
    time = STEP * np.arange(1.0, 3.0)
    trunk = Trunk(time, q[:, :3], q[:, 3:7], np.tile(posed.v[3:6], (2, 1)))
    jac = np.empty((3, posed.built.nv))
    for k, leg in enumerate(LEGS):
        geom = posed.built.geom(f"{leg}_foot").id
        lowest = posed.data.geom_xpos[geom] - np.array([0.0, 0.0, robot.leg.foot_radius])
        body = int(posed.built.geom_bodyid[geom])
        mujoco.mj_jac(posed.built, posed.data, jac, None, lowest, body)
        speed = np.hypot(*(jac @ posed.v)[:2])
        slid = places.slid(robot, trunk, robot.hips[leg], posed.record(robot, k))[1]
        assert slid / STEP == pytest.approx(speed, rel=1e-4)


def recorded(robot: Robot, q: Array, rates: Array) -> dict[str, Array]:
    """Return the columns of a leg at its joints' angles [rad], (2, n), and rates."""
    letters = "".join(motor.letter for motor in robot.hip_motors) + "ABED"
    foot = kinematics.chain_points(robot.leg, q[:, -4:]).F
    record = {f"theta_{joint}": q[:, i] for i, joint in enumerate(letters)}
    record |= {f"theta_dot_{joint}": np.full(2, rates[i]) for i, joint in enumerate(letters)}
    return record | {"foot_x": foot[:, 0], "foot_z": foot[:, 1]}


def test_planned_angles_are_those_of_the_inverse_kinematics() -> None:
    """Of feet that are where the gait, turned about the axis of T, has them."""
    angles = (0.4, -0.3, 0.2, 0.0)
    planned = plan_scenario(trotting(angles, steering=T | OFF))
    straight = plan_scenario(trotting(steering=T | OFF))
    robot = planned.robot
    for k, leg in enumerate(LEGS):
        hip = robot.hips[leg]
        assert hip.steering is not None
        foot = straight.motions[k].foot[1:]
        # After the ramp, and at the start.
        assert planned.swings[-1, k, 0] == pytest.approx(angles[k], abs=1e-15)
        assert abs(planned.swings[0, k, 0]) < 1e-5
        axis = np.array(hip.axis)
        x, y, z = (turned.in_trunk(hip, foot, planned.swings[:, k]) - axis).T
        sign = -1.0 if hip.mirrored else 1.0
        same = hips.Steering(robot.leg, across=sign * hip.offset(hip.steering)[1], along=30e-3)
        found = hips.inverse(same, np.stack([sign * x, sign * y, z], axis=-1))
        np.testing.assert_allclose(found[:, 0], planned.swings[:, k, 0], atol=1e-12)
        np.testing.assert_allclose(found[:, 1:], planned.motions[k].q[1:, ::2], atol=1e-12)


def test_legs_of_a_held_trunk_move_as_without_T_at_zero() -> None:
    """With the axis in the plane of a leg, nothing that it does turns it out of the plane.

    How soft MuJoCo makes the loop's joint depends on what the links hang on: their knees move by
    another thousandth of the loop's gap.
    """
    bare = walk(plan_scenario(trotting(scene="air"))).record
    found = walk(plan_scenario(trotting(scene="air", steering=T))).record
    for leg in LEGS:
        assert np.abs(found[f"{leg}_theta_T"]).max() < 1e-12
        gap = bare[f"{leg}_gap"].max()
        for axis in "xz":
            name = f"{leg}_foot_{axis}"
            np.testing.assert_allclose(found[name], bare[name], rtol=0.0, atol=1e-3 * gap)
        for motor in "AE":
            name = f"{leg}_theta_{motor}"
            np.testing.assert_allclose(found[name], bare[name], rtol=0.0, atol=1e-9)
            name = f"{leg}_torque_{motor}"
            peak = np.abs(bare[name]).max()
            np.testing.assert_allclose(found[name], bare[name], rtol=0.0, atol=1e-6 * peak)


# what it is for


def test_robot_walks_where_all_legs_point(crabbing: Result) -> None:
    moved = crabbing.metrics["robot"]
    assert np.arctan2(moved["drift"], moved["speed"]) == pytest.approx(ANGLE, rel=0.03)
    assert np.hypot(moved["drift"], moved["speed"]) == pytest.approx(SPEED, rel=0.1)
    assert abs(moved["turn_rate"]) < 0.05
    assert crabbing.metrics["energy"]["imbalance"] < 1e-4


def test_way_to_the_side_is_beside_where_the_leg_is_steered() -> None:
    """With S too a foot goes to the left of where T turns it, by as much of its way ahead."""
    found = run(trotting((ANGLE,) * 4, sideways=0.3, steering=T, side_step=S))
    moved = found.metrics["robot"]
    wanted = ANGLE + np.arctan(0.3)
    assert np.arctan2(moved["drift"], moved["speed"]) == pytest.approx(wanted, rel=0.03)
    assert found.metrics["energy"]["imbalance"] < 1e-4


def test_robot_turns_where_front_legs_point_left_and_rear_ones_right() -> None:
    """As fast as a body turns that follows the feet of a diagonal as well as it can.

    They stand at +-(x, y) and pass it at s cos a and +-s sin a; by least squares of what slips,

        w = s sin a x / (x^2 + y^2)
    """
    found = run(trotting((ANGLE, ANGLE, -ANGLE, -ANGLE), steering=T))
    wanted = SPEED * np.sin(ANGLE) * 0.08 / (0.08**2 + 0.06**2)
    assert found.metrics["robot"]["turn_rate"] == pytest.approx(wanted, rel=0.1)
    assert found.metrics["energy"]["imbalance"] < 1e-4


def test_metrics_have_the_power_and_heat_of_T(crabbing: Result) -> None:
    scenario = crabbing.scenario
    window = scenario.window
    legs = crabbing.metrics["legs"]
    given = 0.0
    for leg in LEGS:
        torque = crabbing.record[f"{leg}_torque_T"]
        work = (torque * np.diff(crabbing.record[f"{leg}_theta_T"], prepend=0.0))[window]
        assert legs[leg]["steer_rms"] == pytest.approx(np.sqrt(np.mean(torque[window] ** 2)))
        assert legs[leg]["steer_peak"] == np.abs(torque[window]).max()
        assert legs[leg]["steer_work"] == pytest.approx(work[work > 0.0].sum())
        heat = 3.0 * np.mean((torque[scenario.for_good] / 0.2) ** 2)
        assert legs[leg]["steer_heat"] == pytest.approx(heat)
        given += legs[leg]["steer_work"]
    works = crabbing.metrics["load"]["work"]
    given += works["A"]["positive"] + works["E"]["positive"]
    way = crabbing.metrics["robot"]["speed"] * scenario.sim.timestep * (window.stop - window.start)
    wanted = given / (0.9 * 9.81 * way)
    assert crabbing.metrics["robot"]["cost_of_transport"] == pytest.approx(wanted, rel=1e-9)
    # A and E have no windings here: what heat there is in all is not known.
    assert crabbing.metrics["robot"]["cost_of_transport_electric"] is None


def test_record_scenario_and_pictures_have_the_motor(crabbing: Result) -> None:
    scenario = crabbing.scenario
    assert isinstance(scenario, RobotScenario)
    assert [*crabbing.record] == columns(Floor(), motors=scenario.robot.hip_motors)
    assert Scenario.from_table(scenario.table(), "table", Path()) == scenario
    drawn = replay(scenario, crabbing.record)
    assert drawn.walked is not None
    data = mujoco.MjData(drawn.model)
    data.qpos[:] = drawn.qpos[-1]
    mujoco.mj_kinematics(drawn.model, data)
    for k, leg in enumerate(LEGS):
        middle = data.geom(f"{leg}_foot").xpos
        np.testing.assert_allclose(drawn.walked.feet[k, -1], middle, atol=1e-9)
    assert {"torque_A", "torque_T"} < {plot.path for plot in series(crabbing.record)}
    rows = {key: (label, unit) for key, label, unit in ROWS}
    assert rows["steer_rms"][0] == "torque T RMS"
    for key in ("steer_rms", "steer_peak", "steer_work", "steer_heat"):
        assert shown(rows[key][1], crabbing.metrics["legs"]["FL"][key])


# refusal

PLAIN = 'robot.hips.steering={kp=4, kd=0.03, mass="10 g"}'
EACH = "{FL=%g, FR=%g, RL=%g, RR=%g}"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            [PLAIN, f"gait.steering={EACH % (0.1, 0.9, 0, 0)}"],
            r"robot-q8bot-trot.*: gait\.steering\.FR must be in \[-0\.785398, 0\.785398\] rad, "
            r"hips\.steering\.most, got 0\.9",
        ),
        (
            [f"gait.steering={EACH % (0.1, 0.1, 0, 0)}"],
            r"robot-q8bot-trot.*: gait\.steering needs a robot with hips\.steering: .* no T",
        ),
        ([PLAIN, "gait.steering={FL=0.1}"], r"gait\.steering\.FR is missing"),
        ([PLAIN, "gait.steering=0.1"], r"gait\.steering must be a table of the legs, got 0\.1"),
        (
            [PLAIN, 'gait.steering={FL="5 mm", FR=0, RL=0, RR=0}'],
            r"gait\.steering\.FL must have one of the units mrad, deg, rad, turn, got '5 mm'",
        ),
        (
            [PLAIN, "robot.hips.steering.most=4"],
            r"hips\.steering\.most must be in \(0, 3\.14159\) rad, got 4",
        ),
        (
            [PLAIN, 'robot.hips.steering.most="5 m"'],
            r"hips\.steering\.most must have one of the units mrad, deg, rad, turn, got '5 m'",
        ),
        ([PLAIN, "robot.hips.steering.most=true"], r"hips\.steering\.most"),
        (
            [PLAIN, "robot.hips.steering.limit=0.3"],
            r"hips\.steering\.limit is not known: T is an ideal position servo with kp and kd",
        ),
        ([PLAIN, "robot.hips.steering.kt=0.2"], r"kt and resistance go together"),
        ([PLAIN, "robot.hips.FL.steering.kp=1"], r"steering is that of all legs, not hips\.FL"),
    ],
)  # fmt: skip
def test_steering_that_is_none_is_refused(settings: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        Scenario.load("robot-q8bot-trot", ["limits={}", *settings])
    assert "\n" not in str(caught.value)


def test_units_of_steering_are_understood() -> None:
    steering = 'gait.steering={FL="10 deg", FR=0, RL=0, RR="-100 mrad"}'
    scenario = Scenario.load("robot-q8bot-trot", ["limits={}", PLAIN, steering])
    assert isinstance(scenario, RobotScenario)
    assert scenario.steering == {"FL": pytest.approx(np.pi / 18.0), "FR": 0, "RL": 0, "RR": -0.1}


def test_legs_with_other_motors_than_the_first_are_refused(robot: Robot) -> None:
    bare = {**robot.hips, "RL": Hip(pos=robot.hips["RL"].pos)}
    with pytest.raises(ArgumentError, match=r"hips\.RL must have the same motors as hips\.FL"):
        msgspec.structs.replace(robot, hips=bare)


def test_environment_says_that_it_has_eight_actions(robot: Robot) -> None:
    with pytest.raises(ArgumentError, match=r"eight motors: hips\.steering is not known"):
        WalkTask(robot=robot)
