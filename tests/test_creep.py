"""Creep under `implicitfast`: MuJoCo's own numbers, and the feet of runs that should stick."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim import kinematics, model, rollout
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics import creep
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import FRICTION_RATE
from fivebar_sim.metrics import ground
from fivebar_sim.metrics.columns import JOINT_COLUMNS
from fivebar_sim.scenario import Scenario

CREEPS = ("duration=0.4", "limits={}", "sim.integrator=implicitfast", "sim.timestep=2.5e-4")


def test_friction_rate_is_that_of_the_leg_s_foot() -> None:
    """MuJoCo's b = 2 / (dmax timeconst), with the foot's numbers: the floor's do not count."""
    built = model.build(FiveBar.load("classic"), scene="rail")
    foot = built.geom("foot")
    assert foot.priority > built.geom("floor").priority
    assert pytest.approx(2.0 / (foot.solimp[1] * foot.solref[0]), rel=1e-12) == FRICTION_RATE


@pytest.mark.parametrize("preset", ["classic", "minitaur", "extended"])
def test_response_to_a_torque_is_mujoco_s(preset: str) -> None:
    """J M^-1 of the open chain, from MuJoCo's M and its Jacobian of the ball's lowest point."""
    leg = FiveBar.load(preset)
    built = model.build(leg)
    data = mujoco.MjData(built)
    data.qpos[:] = kinematics.hanging(leg)
    data.qpos[:2] += [0.1, -0.2]
    mujoco.mj_forward(built, data)

    along = np.zeros((3, built.nv))
    lowest = data.site("foot").xpos - [0.0, 0.0, leg.foot_radius]
    mujoco.mj_jac(built, data, along, None, lowest, built.body("L2").id)
    torque = np.array([[1.0, 0.0, 0.0, 0.0]])
    answer = np.zeros_like(torque)
    mujoco.mj_solveM(built, data, answer, torque)

    theta_A, theta_B = data.qpos[:2]
    found = creep.pushed(leg, np.array(theta_A), np.array(theta_A + theta_B))
    assert found == pytest.approx(along[0] @ answer[0], rel=1e-9)


def crept(record: dict[str, Array], scenario: Scenario) -> tuple[Bools, Array]:
    """Return whether the foot sticks in each step, and how far it has crept since it began to."""
    force = np.stack([record["ground_x"], record["ground_z"]], axis=-1)
    sticking = creep.sticks(force, scenario.scene.friction)  # pyright: ignore[reportAttributeAccessIssue]
    q = np.stack([record[name] for name in JOINT_COLUMNS], axis=-1)
    h = scenario.sim.timestep
    found = creep.distance(
        scenario.leg, q, record["theta_dot_A"], sticking, scenario.servo.damping, h
    )
    return sticking, found


def centripetal(leg: FiveBar, record: dict[str, Array]) -> Array:
    """Return J_dot q_dot of the foot, C, along x [m/s^2], which MuJoCo's friction leaves out."""
    w1 = record["theta_dot_A"]
    w2 = w1 + record["theta_dot_B"]
    p1 = record["theta_A"]
    p2 = p1 + record["theta_B"]
    return -leg.L1 * np.cos(p1) * w1**2 - leg.L2 * np.cos(p2) * w2**2


def test_foot_creeps_as_far_as_the_law_says() -> None:
    """v_dot + b v = J_dot q_dot - h J M^-1 D q_ddot, summed over the two long stances of a run."""
    scenario = Scenario.load("treadmill-trot", CREEPS)
    plan = rollout.plan(scenario)
    # What the friction's softness adds to the creep is another matter.
    plan.model.opt.impratio = 1e6
    record = rollout.execute(plan).record
    h = scenario.sim.timestep
    sticking, found = crept(record, scenario)
    slid = np.concatenate([[0.0], ground.slid(scenario.leg, record)])
    sum_of_others = np.cumsum(centripetal(scenario.leg, record)) * h / FRICTION_RATE

    edges = np.flatnonzero(np.diff(sticking, prepend=False, append=False))
    stances = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 200]
    assert len(stances) == 2
    for a, b in stances:
        stance = slice(a, b)
        far = np.cumsum(slid[stance]) - slid[a] + (slid[stance] - slid[a]) / (h * FRICTION_RATE)
        law = found[stance] + sum_of_others[stance] - sum_of_others[a]
        largest = np.abs(found[stance]).max()
        assert largest > 0.3e-3
        np.testing.assert_allclose(far, law, rtol=0.0, atol=0.07 * largest)


def test_creep_is_counted_from_where_the_foot_sticks() -> None:
    leg = FiveBar.load("classic")
    q = np.tile(kinematics.hanging(leg), (6, 1))
    rate = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    sticking = np.array([True, True, False, True, True, False])
    found = creep.distance(leg, q, rate, sticking, 0.05, 1e-3)
    step = -1e-3 * 0.05 / FRICTION_RATE * creep.pushed(leg, q[0, 0], q[0, 0] + q[0, 1])
    np.testing.assert_allclose(found, step * np.array([0.0, 1.0, 0.0, 1.0, 2.0, 0.0]), rtol=1e-12)


def test_foot_sticks_within_the_cone_and_on_the_floor() -> None:
    force = np.array([[0.3, 1.0], [-0.3, 1.0], [0.5, 1.0], [-0.5, 1.0], [0.0, 0.0]])
    assert creep.sticks(force, 0.5).tolist() == [True, True, False, False, False]


def test_change_is_a_part_of_each_motor_s_own_torque() -> None:
    leg = FiveBar.load("classic")
    course = creep.Course(
        timestep=1e-3,
        q=np.tile(kinematics.hanging(leg), (3, 1)),
        rate_A=np.array([0.0, 0.1, 0.2]),
        ground=np.tile([0.0, 1.0], (3, 1)),
        torque=np.array([[0.1, 0.0], [-0.1, 0.0], [0.1, 0.0]]),
    )
    found = creep.changes(leg, creep.Footing(1.0, 0.05, 8.0), course)
    crept = creep.distance(leg, course.q, course.rate_A, np.ones(3, dtype=bool), 0.05, 1e-3)
    cost = creep.cost(leg, course.q[:, ::2], crept, 8.0)
    assert np.abs(cost[1:]).min() > 0.0
    np.testing.assert_allclose(found[:, 0], cost[:, 0] / 0.1, rtol=1e-12)
    np.testing.assert_array_equal(found[:, 1], 0.0)  # a motor without torque has none to lose


def test_cost_is_what_holds_the_foot_back_along_x_alone() -> None:
    """The torques make a side force kp x / |j|^2, and none along z where the leg is symmetric."""
    leg = FiveBar.load("classic")
    theta = kinematics.hanging(leg)[[0, 2]]
    cost = creep.cost(leg, theta[None], np.array([1e-4]), 8.0)[0]
    force = np.linalg.solve(kinematics.jacobian(leg, theta).T, cost)
    j = kinematics.jacobian(leg, theta)[0]
    np.testing.assert_allclose(force, [-8.0 * 1e-4 / (j @ j), 0.0], rtol=1e-9, atol=1e-9)
