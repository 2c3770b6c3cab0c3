"""Robots on steps and on rough ground: where it is, what it does to feet and other parts."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.model.ground import lay
from fivebar_sim.robots import Floor, Robot, places
from fivebar_sim.robots.columns import of_leg
from fivebar_sim.robots.ground import Flat, Ground, Rough, Steps
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.measure import measure
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.record import wrench
from fivebar_sim.walking.touching import depths
from fivebar_sim.walking.walk import Walk, walk

ROUGH = 'scene.ground={kind="rough", height="5 mm", cell="20 mm", size="1 m", seed=3}'
SHORT = ("duration=0.3", "limits={}", "path.ramp=0.1")
Q8BOT = Robot.load("q8bot")


def walked(*settings: str, name: str = "robot-q8bot-trot-fast") -> Walk:
    """Return a short walk."""
    scenario = Scenario.load(name, [*SHORT, *settings])
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


@pytest.fixture(scope="module")
def rough() -> Walk:
    return walked(ROUGH)


@pytest.mark.parametrize(
    "ground",
    [
        Rough(height=0.02, cell=0.02, size=0.3, seed=1),
        Steps(height=0.01, length=0.05, start=-0.03, count=3),
        Steps(height=-0.01, length=0.05, start=-0.03, count=3),
    ],
    ids=["rough", "up", "down"],
)
def test_mujoco_has_the_heights_and_normals_of_the_ground(ground: Ground) -> None:
    """A ball of 0.1 mm that is put 1 um into the ground along its normal is 1 um in it."""
    radius = 1e-4
    spec = mujoco.MjSpec.from_string(
        "<mujoco><asset><material name='floor'/></asset><worldbody><geom name='floor' type='plane' "
        "size='1 1 1' contype='0'/><body><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 "
        f"1 1'/><geom type='sphere' conaffinity='0' size='{radius}'/></body></worldbody></mujoco>"
    )
    lay(spec, ground)
    model = spec.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.14, 0.14, (2, 100))
    surface = np.stack([x, y, ground.heights(x, y)], axis=-1)
    normals = ground.normals(x, y)

    off = []
    for point, normal in zip(surface, normals, strict=True):
        data.qpos[:3] = point + (radius - 1e-6) * normal
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        off.append(min(data.contact.dist.tolist(), default=1.0) + 1e-6)
    # Within a ball's radius of an edge, a neighbour may be nearer.
    assert np.mean(np.abs(off) < 1e-9) > 0.9
    assert max(off) < 1e-9


def test_a_ball_comes_to_lie_where_it_touches() -> None:
    """On a step it lies at its height, and next to one on the floor; over its edge in between."""
    stair = Steps(height=0.01, length=1.0, start=0.0, count=1)
    assert stair.lift(0.02, 0.0, 0.006) == pytest.approx(0.01)
    assert stair.lift(-0.007, 0.0, 0.006) == pytest.approx(0.0)
    assert stair.lift(-0.003, 0.0, 0.006) == pytest.approx(
        0.01 + np.sqrt(0.006**2 - 0.003**2) - 0.006, abs=5e-5
    )


def test_forces_on_the_feet_are_all_that_the_ground_does_to_the_robot(rough: Walk) -> None:
    """Their sum and their moment about the trunk are what the constraints do to its six rates."""
    states = rough.states
    start = rough.plan.start[None]
    before = np.concatenate([start, states.qpos[0, :-1]])
    each = [wrench(states, k) for k in range(4)]
    force = sum(foot[:, :3] for foot in each)
    moment = sum(foot[:, 3:6] + np.cross(foot[:, 6:] - before[:, :3], foot[:, :3]) for foot in each)
    found = np.empty_like(moment)
    for k, q in enumerate(before):
        mujoco.mju_rotVecQuat(found[k], states.constraint[0, k, 3:6], q[3:7])
    assert np.abs(force).max() > 5.0
    np.testing.assert_allclose(states.constraint[0, :, :3], force, atol=1e-9 * np.abs(force).max())
    # Besides, the two ends of a loop are a micrometre apart, with some newtons on each.
    np.testing.assert_allclose(found, moment, atol=1e-4 * np.abs(moment).max())


def test_energy_closes_and_the_guards_know_the_ground(rough: Walk) -> None:
    measured = measure(rough)
    assert measured.energy.imbalance is not None
    assert measured.energy.imbalance < 1e-4
    guards = {guard.name: guard for guard in measured.guards}
    assert guards["constraints"].ok
    assert guards["ground"].ok
    # Feet stand in it: only by how soft a contact is.
    assert 1e-5 < (guards["ground"].value or 0.0) < 0.5 * Q8BOT.leg.foot_radius


def test_a_foot_slides_over_ground_that_is_almost_flat_as_over_a_floor(rough: Walk) -> None:
    assert rough.trunk is not None
    almost = Rough(height=1e-9, cell=0.02, size=1.0)
    record = of_leg(rough.record, "FL")
    over = [
        places.slid(Q8BOT, rough.trunk, Q8BOT.hips["FL"], record, ground)
        for ground in (almost, Flat(), None)
    ]
    np.testing.assert_array_equal(over[1], over[2])
    np.testing.assert_allclose(over[0], over[1], atol=1e-6 * over[1].max())


def test_a_ball_that_rolls_down_a_triangle_does_not_slide() -> None:
    """Nor does one that is pressed into it: only the way across the normal counts."""
    ground = Rough(height=0.4, cell=1.0, size=3.0, seed=5)
    normal = ground.normals(np.array([0.2]), np.array([0.1]))[0]
    across = np.cross(normal, (0.0, 0.0, 1.0))
    down = np.cross(across, normal)
    h = 1e-3
    r = Q8BOT.leg.foot_radius
    hip = Q8BOT.hips["FL"]
    time: Array = h * np.arange(1, 4, dtype=np.float64)
    steps = np.arange(3, dtype=np.float64)
    place: Array = np.array([0.2, 0.1, 0.0]) + 1e-4 * steps[:, None] * (down - 0.1 * normal)
    # A rate w rolls the ball by w x r n.
    rate = np.cross(normal, down) * 1e-4 / (h * r)
    level = np.tile((1.0, 0.0, 0.0, 0.0), (3, 1))
    trunk = Trunk(time, place - np.array(hip.pos), level, np.tile(rate, (3, 1)))
    names = ["foot_x", "foot_z", "theta_dot_A", "theta_dot_B"]
    still = {name: np.zeros(3) for name in names}
    np.testing.assert_allclose(places.slid(Q8BOT, trunk, hip, still, ground), 0.0, atol=1e-12)


def test_parts_are_as_deep_in_a_step_as_they_were_put() -> None:
    """The trunk's front 3 mm in a step that begins below its middle; its legs are folded away."""
    scene = Floor(ground=Steps(height=0.05, length=1.0, start=0.02, count=1))
    half = 0.5 * Q8BOT.trunk.size[2]
    bottom = Q8BOT.trunk.center[2] - half
    up = np.tile((np.pi / 2.0, 0.0, np.pi / 2.0, 0.0), 4)
    q = np.concatenate([[0.0, 0.0, 0.05 - bottom - 0.003, 1.0, 0.0, 0.0, 0.0], up])
    found = depths(Q8BOT, scene, np.stack([q, q + np.array([0, 0, 0.004] + 20 * [0])]))
    np.testing.assert_allclose(found["trunk"], [0.003, 0.0], atol=1e-9)
    assert found["RL foot"].max() == 0.0


def test_a_robot_that_walks_against_a_wall_says_what_touches_it() -> None:
    wall = 'scene.ground={kind="steps", height="40 mm", start="66 mm", count=1}'
    went = walked(wall)
    found = {guard.name: guard for guard in measure(went).guards}
    assert not found["floor"].ok
    assert found["floor"].part is not None
    assert found["floor"].part.startswith(("FL link", "FR link", "trunk"))


def test_a_fall_on_rough_ground_says_when_and_why() -> None:
    """Its mass is beyond the feet of its left legs."""
    went = walked(ROUGH, "robot.trunk.center=[0.0, 0.08, 0.006]", name="robot-q8bot-stand")
    assert went.falls[0].time < 0.3
    assert went.falls[0].why.startswith("the trunk touches the floor, leaning")


def test_a_seed_is_one_ground() -> None:
    one = Rough(seed=1)
    assert np.array_equal(one.points, Rough(seed=1).points)
    assert not np.array_equal(one.points, Rough(seed=2).points)
    assert (one.points.min(), one.points.max()) == (0.0, 1.0)
    assert one.side == pytest.approx(one.size)


def test_a_scenario_keeps_its_ground() -> None:
    scenario = Scenario.load("robot-q8bot-stand", [ROUGH])
    again = Scenario.from_table(scenario.table(), "table", Path())
    assert again == scenario
    bare = Scenario.load("robot-q8bot-stand", ["scene.ground=steps"])
    assert isinstance(bare.scene, Floor)
    assert bare.scene.ground == Steps()
    assert Scenario.load("robot-q8bot-stand").scene == Floor(ground=Flat())


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("scene.ground=ruogh", r"scene\.ground: unknown ground 'ruogh'; known: .*'rough'"),
        ("scene.ground=3", r"scene\.ground must be one of flat, steps, rough, or a table"),
        ('scene.ground={kind="rough", heigth=1}', r"\[scene\.ground\]: unknown key 'heigth'"),
        ('scene.ground={kind="rough", height=0}', r"scene\.ground\.height must be in \(0, .*\) m"),
        ('scene.ground={kind="rough", cell="0 mm"}', r"scene\.ground\.cell must be in \[0\.0001,"),
        ('scene.ground={kind="rough", size=50}', r"scene\.ground\.size must be in \[0\.06, 20\] m"),
        ('scene.ground={kind="rough", seed=-1}', r"scene\.ground\.seed must be in \[0, 2\^63\)"),
        ('scene.ground={kind="steps", count=0}', r"scene\.ground\.count must be in \[1, 1000\]"),
        ('scene.ground={kind="steps", length="1 s"}', r"ground\.length must have one of the units"),
    ],
)  # fmt: skip
def test_ground_that_is_none_is_refused(setting: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Scenario.load("robot-q8bot-stand", [setting])
