"""The ground: its force on the foot, free fall, the belt, and the slip that is measured."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

from fivebar_sim import kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import ground
from fivebar_sim.paths import Gait
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario

INTEGRATORS = ("discrete", "implicitfast")
COLUMNS = ("hip_z", *(f"theta_{joint}" for joint in "ABED"))
RATES = ("hip_dot_z", *(f"theta_dot_{joint}" for joint in "ABED"))
LEG = FiveBar.load("classic")
H = 1e-3

HOLD = ("path={kind='step', start=[0.005, -0.07], stop=[0.005, -0.07], lift=0, seconds=0.1}",)
"""The foot shall stay where it is."""

BACK = (
    "path={kind='gait', centre=[0, -0.07], stride=0.02, lift=0.01, duty=0.7, frequency=1, ramp=0}",
)
"""A stance over the first 0.35 s, at 20/0.7 mm/s."""


@cache
def done(*settings: str) -> tuple[Plan, Result]:
    plan = rollout.plan(Scenario.load("classic-ellipse", ["limits={}", *settings]))
    return plan, rollout.execute(plan)


def weight(leg: FiveBar, trunk: float) -> float:
    return 9.81 * (trunk + sum(link.mass for link in leg.links))


def states(plan: Plan, result: Result) -> tuple[Array, Array]:
    """Return q and v before the first step and after every step, (N + 1, 5)."""
    q, v = (np.stack([result.record[name] for name in names], 1) for names in (COLUMNS, RATES))
    return np.concatenate([plan.start[None], q]), np.concatenate([np.zeros((1, 5)), v])


def a_record(**columns: Array) -> dict[str, Array]:
    rows = len(next(iter(columns.values())))
    zero = np.zeros(rows)
    names = ("foot_x", "foot_z", "theta_A", "theta_B", "hip_z", "ground_x", "ground_z", "rail_end")
    time: Array = H * np.arange(1.0, rows + 1)
    return {"time": time, **dict.fromkeys(names, zero), **columns}


# law


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("mass", [0.1, 2.0])
def test_ground_carries_the_whole_weight(mass: float, integrator: str) -> None:
    _, result = done(
        f"scene={{kind='rail', mass={mass}}}", *HOLD, f"sim.integrator={integrator}", "duration=3.0"
    )
    record = result.record
    assert record["ground_z"][-1] == pytest.approx(weight(LEG, mass), rel=1e-6)
    assert abs(record["ground_x"][-1]) < 0.5 * record["ground_z"][-1]  # sticks: friction is 1
    assert abs(record["hip_dot_z"][-1]) < 1e-5  # soft friction lets it creep


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    "scene", ["{kind='rail', drop=0.02}", "{kind='treadmill', drop=0.01, speed=0.3}"]
)
def test_momentum_of_the_whole_leg_asks_for_the_recorded_force(scene: str, integrator: str) -> None:
    """In every step, (M (v+ - v) / h + bias) along hip_z is what the ground pushed in that step."""
    plan, result = done(f"scene={scene}", *HOLD, f"sim.integrator={integrator}", "duration=0.4")
    q, v = states(plan, result)
    data = mujoco.MjData(plan.model)
    M = np.zeros((5, 5))
    needed = np.empty(len(q) - 1)
    for k in range(len(needed)):
        data.qpos[:] = q[k]
        data.qvel[:] = v[k]
        mujoco.mj_forward(plan.model, data)
        mujoco.mj_fullM(plan.model, data, M)
        needed[k] = (M @ (v[k + 1] - v[k]) / H + data.qfrc_bias)[0]
    force = result.record["ground_z"]
    np.testing.assert_allclose(force, needed, rtol=0, atol=1e-10 * force.max())
    assert force.max() > 3.0 * weight(LEG, 0.5)
    # the force of the step before or after is another one
    assert np.abs(force[1:] - needed[:-1]).max() > 0.1 * force.max()


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("drop", [0.005, 0.05])
def test_dropped_leg_falls_freely(drop: float, integrator: str) -> None:
    """hip_z = z_0 - g t^2 / 2, with a step's error g h t / 2; it meets the floor when it must."""
    scene = f"scene={{kind='rail', drop={drop}}}"
    plan, result = done(scene, *HOLD, f"sim.integrator={integrator}", "duration=0.4")
    record = result.record
    t = result.record["time"]
    falls = int(np.argmax(record["ground_z"] > 0.0))
    assert plan.start[0] == pytest.approx(drop + LEG.foot_radius + 0.07, abs=1e-15)
    z = plan.start[0] - 0.5 * 9.81 * t * (t + H)
    np.testing.assert_allclose(record["hip_z"][:falls], z[:falls], atol=1e-6 * drop)
    np.testing.assert_array_equal(record["ground_x"][:falls], 0.0)
    assert falls * H == pytest.approx(np.sqrt(2.0 * drop / 9.81), abs=2.0 * H)
    assert result.metrics["ground"]["flight_max"] > (falls - 0.5) * H  # it may bounce for longer
    first = 9.81 * H * H  # how far it falls in the first step
    assert result.metrics["ground"]["foot_height_max"] == pytest.approx(drop - first, abs=1e-9)


def test_slid_is_the_way_of_the_contact_point() -> None:
    """Against MuJoCo's own contact: its point on L2, its velocity, and that of the belt."""
    plan, result = done("scene={kind='treadmill', speed=0.15}", *BACK, "duration=1.0")
    q, v = states(plan, result)
    data = mujoco.MjData(plan.model)
    speeds = np.full(len(q), np.nan)
    jacobian = np.zeros((3, 5))
    body = plan.model.body("L2").id
    for k in range(len(q)):
        data.qpos[:] = q[k]
        data.qvel[:] = v[k]
        mujoco.mj_forward(plan.model, data)
        if data.ncon == 1:
            mujoco.mj_jac(plan.model, data, jacobian, None, data.contact[0].pos, body)
            speeds[k] = (jacobian @ v[k])[0] + 0.15
    # the step from row k to k + 1 is v of its end times h; the record begins at k = 1
    way = H * speeds[2:]
    ours = ground.slid(LEG, result.record)
    sees = np.isfinite(way)
    assert sees.sum() > 700
    assert np.abs(ours[sees]).sum() > 1e-2
    # the ball rises by up to a fifth of its lever in a step here: MuJoCo's is that of its end
    np.testing.assert_allclose(ours[sees], way[sees], atol=4e-3 * np.abs(way[sees]).max())
    assert ours[sees].sum() == pytest.approx(way[sees].sum(), rel=2e-3)


def test_planted_foot_goes_with_the_belt() -> None:
    """Once settled it does not slide, though the belt runs on by millimetres."""
    _, result = done(
        "scene={kind='treadmill', friction=3.0}", *BACK, "controller.feedforward=velocity"
    )
    record = result.record
    stance = slice(100, 340)
    assert ground.stands(record)[stance].all()
    way = np.diff(record["belt_x"])[stance].sum()
    assert way == pytest.approx(-0.24 * 0.02 / 0.7)
    assert np.diff(record["foot_x"])[stance].sum() == pytest.approx(way, rel=0.1)
    assert np.abs(ground.slid(LEG, record)[stance]).sum() < 0.01 * abs(way)


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_belt_under_a_held_foot_slips_by_its_way(speed: float) -> None:
    """The foot stays: it slides by v t, which is slip while it stands; friction drags it along."""
    _, result = done(
        f"scene={{kind='treadmill', speed={speed}, friction=0.3}}",
        *HOLD,
        "path.seconds=1.5",
        "path.ramp=0.5",
        "duration=1.5",
        "servo.kp=50",
        "servo.kd=0.5",
    )
    record = result.record
    steady = slice(500, 1500)
    share = ground.stands(record)[steady].mean()
    assert share > 0.8
    np.testing.assert_allclose(record["belt_x"], -speed * record["time"], atol=1e-15)
    assert ground.slid(LEG, record)[steady].sum() == pytest.approx(speed * 0.999, rel=2e-3)
    assert result.metrics["ground"]["slip"] == pytest.approx(abs(speed) * share, rel=5e-3)
    pull = -0.3 * np.sign(speed) * record["ground_z"][steady]
    np.testing.assert_allclose(record["ground_x"][steady], pull, rtol=1e-3, atol=1e-3)


def test_rolling_ball_does_not_slide() -> None:
    psi = np.linspace(-0.6, 0.9, 50)
    r = LEG.foot_radius
    foot_z = np.full(50, r)
    rolls = a_record(theta_A=2.0 * psi, theta_B=-psi, foot_x=-r * psi, foot_z=foot_z)
    np.testing.assert_allclose(ground.slid(LEG, rolls), 0.0, atol=1e-17)
    on_belt = {**rolls, "foot_x": rolls["foot_x"] - 0.01 * psi, "belt_x": -0.01 * psi}
    np.testing.assert_allclose(ground.slid(LEG, on_belt), 0.0, atol=1e-17)
    spins = {**rolls, "foot_x": np.zeros(50)}
    np.testing.assert_allclose(ground.slid(LEG, spins).sum(), r * 1.5)


def test_contact_is_below_the_centre_by_the_radius_less_half_of_what_sinks_in() -> None:
    heights = np.array([-2e-3, -0.0, 1e-3, 0.5, 2.0])
    wanted = LEG.foot_radius - np.array([1e-3, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(ground.contact_radius(LEG, heights), wanted)


def test_height_is_of_the_balls_lowest_point() -> None:
    q = kinematics.home(LEG)
    foot = kinematics.chain_points(LEG, q).F
    record = a_record(foot_z=foot[1:], hip_z=np.array([0.1]))
    np.testing.assert_allclose(ground.height(LEG, record), 0.1 + foot[1] - LEG.foot_radius)


# edge


def test_metrics_of_known_steps() -> None:
    """Ten steps: flight of two, of three and of none; slip counts in stance and window alone."""
    down = np.array([0, 0, 1, 1, 0, 0, 0, 1, 1, 1])
    x = np.array([0.0, 5.0, 6.0, 8.0, 20.0, 30.0, 40.0, 41.0, 43.0, 43.5])
    force_x = np.array([0, 0, -3, 1, 0, 0, 0, 2, 1, 1.0])
    z = np.linspace(0.2, 0.1, 10) + LEG.foot_radius
    record = a_record(foot_x=x, foot_z=z, ground_x=force_x, ground_z=4.0 * down)
    measured = ground.measure(LEG, record, slice(3, 9))
    assert (measured.force_max.x, measured.force_max.z) == (3.0, 4.0)
    assert measured.stance_share == pytest.approx(3 / 6)
    assert measured.slip == pytest.approx(2.0 + 1.0 + 2.0)
    assert measured.flight_max == pytest.approx(3 * H)
    assert measured.foot_height_max == pytest.approx(0.2)


def test_leg_that_never_lands_or_never_leaves() -> None:
    air = ground.measure(LEG, a_record(foot_z=np.ones(5)), slice(0, 5))
    assert (air.stance_share, air.slip, air.force_max.z) == (0.0, 0.0, 0.0)
    assert air.flight_max == pytest.approx(5 * H)
    stands = ground.measure(LEG, a_record(ground_z=np.ones(5)), slice(0, 5))
    assert (stands.stance_share, stands.flight_max) == (1.0, 0.0)


def test_next_to_no_friction_gives_next_to_no_force() -> None:
    _, result = done("scene={kind='rail', friction=0.0}", *HOLD, "duration=1.0")
    record = result.record
    assert np.abs(record["ground_x"]).max() < 1e-3 * record["ground_z"].max()
    assert record["ground_z"][-1] == pytest.approx(weight(LEG, 0.5), rel=1e-3)


# the rail's end


BELOW_STANCE = ("scene={kind='rail', drop=1e-3, stop=0.0765}", *HOLD, "duration=0.5")
"""Foot and rail's end share the weight: the floor gives way by more than the end lies below."""


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_force_of_the_rails_end_is_mujocos(integrator: str) -> None:
    """In every step, to the bit that it is a difference: the limit's own force on the slide."""
    plan, result = done(*BELOW_STANCE, f"sim.integrator={integrator}")
    assert plan.ctrl.shape[1] == 2
    data = mujoco.MjData(plan.model)
    data.qpos[:] = plan.start
    slide = plan.model.joint("hip_z").id
    own = np.zeros(len(plan.ctrl))
    for k, ctrl in enumerate(plan.ctrl):
        data.ctrl[:] = ctrl
        mujoco.mj_step(plan.model, data)
        limit = data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
        own[k] = data.efc_force[limit & (data.efc_id == slide)].sum()
    recorded = result.record["rail_end"]
    assert own.max() > 0.1 * weight(LEG, 0.5)
    np.testing.assert_allclose(recorded, own, rtol=0.0, atol=1e-10)
    np.testing.assert_array_equal(recorded[own == 0.0], 0.0)


def test_foot_and_rails_end_carry_the_weight_together() -> None:
    _, result = done(*BELOW_STANCE)
    record = result.record
    held = record["ground_z"][-1] + record["rail_end"][-1]
    assert held == pytest.approx(weight(LEG, 0.5), rel=1e-5)
    table = result.metrics["ground"]
    window = result.scenario.window
    foot = record["ground_z"][window].mean()
    rail = record["rail_end"][window].mean()
    assert rail > 0.1 * weight(LEG, 0.5)
    assert table["foot_share"] == pytest.approx(foot / (foot + rail), rel=1e-12)
    assert table["rail_end_max"] == record["rail_end"].max()


def test_rail_without_an_end_carries_nothing() -> None:
    _, result = done("scene={kind='rail', drop=1e-3}", *HOLD, "duration=0.3")
    np.testing.assert_array_equal(result.record["rail_end"], 0.0)
    assert result.metrics["ground"]["foot_share"] == 1.0
    assert result.metrics["ground"]["rail_end_max"] == 0.0
    assert ground.foot_share(LEG, a_record(foot_z=np.ones(5)), slice(0, 5)) is None


@pytest.mark.parametrize("name", ["treadmill-trot", "minitaur-treadmill"])
def test_foot_of_a_gait_carries_the_weight_over_whole_strides(name: str) -> None:
    """The mean force of the ground over whole strides is the weight of trunk and leg."""
    scenario = Scenario.load(name)
    result = rollout.run(scenario)
    path = scenario.path
    assert isinstance(path, Gait)
    stride = round(path.period / scenario.sim.timestep)
    assert stride * scenario.sim.timestep == pytest.approx(path.period, rel=1e-9)
    force = result.record["ground_z"][scenario.window]
    force = force[: len(force) // stride * stride]
    leg = scenario.leg
    assert force.mean() == pytest.approx(weight(leg, scenario.trunk), rel=0.01)
    np.testing.assert_array_equal(result.record["rail_end"], 0.0)

    # In the middle of the swing the foot is clear of the belt, by half of the lift at least.
    cycle = path.cycle(result.record["time"])
    duty = path.duty
    middle = np.abs(cycle - 0.5 * (1.0 + duty)) < 0.1 * (1.0 - duty)
    clear = ground.height(leg, result.record)[middle]
    assert clear.min() > 0.5 * path.lift
