"""One leg in Gymnasium: its checker, the scenario's bits, what is refused, what is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from env_runs import SHORT, actions, played, scenario, task_of
from fivebar_controllers.servo import Servo as Feedforward
from gymnasium.utils.env_checker import check_env

import fivebar_sim.gym
from fivebar_sim import Scenario, kinematics, motion, run
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.gym import LegEnv
from fivebar_sim.metrics import ground
from fivebar_sim.scenario.scenes import Treadmill
from fivebar_sim.tasks import KINDS
from fivebar_sim.tasks.episodes import to_bounds
from fivebar_sim.walking.env import WalkEnv

ROOT = Path(__file__).resolve().parents[1]
SPACES_IN_SI = pytest.mark.filterwarnings(
    "ignore:.*symmetric and normalized", "ignore:.*A Box observation space m"
)


def states(env: LegEnv, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return qpos and qvel after each control step, (periods, n) each, and check the end."""
    env.reset(seed=0)
    rows = []
    for row, action in enumerate(table):
        *_, terminated, truncated, info = env.step(action)
        rows.append((env.episodes.qpos[0].copy(), env.episodes.qvel[0].copy()))
        assert not terminated, info["reason"]
        assert truncated == (row == len(table) - 1)
    qpos, qvel = zip(*rows, strict=True)
    return np.stack(qpos), np.stack(qvel)


# law


@SPACES_IN_SI
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_gymnasiums_checker_passes(kind: str) -> None:
    env = gymnasium.make(f"fivebar/{kind.capitalize()}-v0").unwrapped
    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("kind", ["track", "hop"])
def test_a_seed_says_all(kind: str) -> None:
    """Three episodes of the same seed are alike, those of another differ, and go on from it."""
    env = LegEnv(kind)
    first = [env.reset(seed=5)[0], env.reset()[0], env.reset()[0]]
    again = [env.reset(seed=5)[0], env.reset()[0], env.reset()[0]]
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(first[0], env.reset(seed=6)[0])


@pytest.mark.parametrize("kind", ["track", "stand"])
def test_a_later_episode_is_as_the_first(kind: str) -> None:
    """Nothing is left of an episode that was broken off: bus, sensors, solver, noise."""
    options: dict[str, Any] = {
        "servo": Servo(delay=0.012, rate=1.0 / 0.003),
        "sensors": Sensors(delay=0.007, noise=0.01),
        "duration": 0.1,
    }
    env = LegEnv(kind, **options)
    table = actions(env.task, 0)
    seen = []
    for _ in range(2):
        rows = [env.reset(seed=3)[0]]
        for action in table:
            observation, reward, *_ = env.step(action)
            rows.append(np.append(observation, reward))
        seen.append(np.concatenate(rows))
        env.reset()
        for action in actions(env.task, 1)[:7]:
            env.step(action)
    np.testing.assert_array_equal(*seen)


def scaled(low: np.ndarray, high: np.ndarray, part: np.ndarray, dtype: type) -> np.ndarray:
    """Return the actions that a policy's answers in [-1, 1] stand for, as SAC computes them."""
    half = ((high - low) / 2.0).astype(dtype)
    middle = ((high + low) / 2.0).astype(dtype)
    return part.astype(dtype) * half + middle


@pytest.mark.parametrize("preset", sorted(resources.shipped("models/legs")))
def test_rounding_is_not_out_of_bounds(preset: str) -> None:
    """10,000 spans of legs that differ: what float32 makes of a bound is the bound."""
    random = np.random.default_rng(0)
    rest = kinematics.home(FiveBar.load(preset))[::2] + random.uniform(-0.3, 0.3, (10_000, 2))
    span = random.uniform(1e-3, np.pi, (10_000, 1))
    low = rest - span
    high = rest + span
    for dtype in (np.float32, np.float64):
        for end, part in ((low, -np.ones_like(rest)), (high, np.ones_like(rest))):
            for sent in (end.astype(dtype), scaled(low, high, part, dtype)):
                inside, outside = to_bounds(sent.astype(np.float64), low, high)
                np.testing.assert_array_equal(inside, np.clip(sent, low, high))
                assert not outside.any()
            assert to_bounds(end + 4e-6 * part, low, high)[1].all()

    within = random.uniform(low, high)
    np.testing.assert_array_equal(to_bounds(within, low, high)[0], within)


@pytest.mark.parametrize("span", [0.96, 0.3])
def test_actions_of_wrappers_and_float32_reach_the_bounds(span: float) -> None:
    env = LegEnv("track", span=span)
    outer = gymnasium.wrappers.RescaleAction(env, np.float64(-1.0), np.float64(1.0))
    for part in (np.ones(2), -np.ones(2), np.ones(2, np.float32), -np.ones(2, np.float32)):
        outer.reset(seed=0)
        outer.step(part)
    upper: Any = env.episodes.high.astype(np.float32)
    env.step(upper)
    with pytest.raises(ArgumentError, match=r"^action theta\[0\] must be in"):
        env.step(env.episodes.high + 4e-6)


# oracle


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize(
    "settings",
    [
        (),
        ("servo.delay=0.007", "servo.rate=250.0", "servo.resolution=0.01"),
        ("sim.timestep=0.0005", "sim.integrator=implicitfast", "servo.limit=0.6"),
    ],
)
def test_states_are_the_scenarios(kind: str, settings: tuple[str, ...]) -> None:
    wanted = scenario(kind, *settings)
    task = task_of(kind, wanted)
    ground = task.scene
    if isinstance(ground, Treadmill):  # whose rail ends where the task says
        wanted = Scenario.load(
            "treadmill-trot",
            [*SHORT, *settings, f"scene.stop={ground.stop}", f"scene.speed={ground.speed}"],
        )
    table = actions(task)
    theirs = played(wanted, table)
    qpos, qvel = states(LegEnv(task), table)
    every = slice(task.every - 1, None, task.every)
    np.testing.assert_array_equal(qpos, theirs[0][every])
    np.testing.assert_array_equal(qvel, theirs[1][every])


def test_torques_give_the_scenarios_states() -> None:
    wanted = scenario("track", "servo.limit=0.3", "servo.speed=60.0", "servo.delay=0.003")
    task = task_of("track", wanted, action="torque", duration=0.1)
    table = 0.02 * actions(task)
    theirs = played(wanted, np.tile(table, (5, 1)), "torque")
    qpos, _ = states(LegEnv(task), table)
    np.testing.assert_array_equal(qpos, theirs[0][4:100:5])


def test_feedforward_policy_tracks_as_the_run_does() -> None:
    """The servo with torque feedforward, wrapped as a policy: `fivebar run`'s tracking error."""
    wanted = Scenario.load("classic-ellipse", ["controller.feedforward=torque", "duration=0.8"])
    h = wanted.sim.timestep
    env = LegEnv(task_of("track", wanted, period=h))
    plan = motion.plan(wanted.leg, wanted.path, wanted.steps, h)
    policy = Feedforward(feedforward="torque").setpoints(wanted.leg, wanted.servo, plan, "discrete")
    observation, _ = env.reset(seed=0)
    feet = []
    for action in policy:
        observation, *_ = env.step(action)
        feet.append(observation[env.layout["foot"]])
    error = np.hypot(*(np.array(feet) - plan.foot[1:]).T)[wanted.window]
    rms = np.sqrt(np.mean(error**2))
    assert rms == pytest.approx(run(wanted).metrics["tracking"]["rms"], rel=1e-9)
    assert rms < 0.12e-6


def test_observation_is_the_state() -> None:
    env = LegEnv("hop")
    env.reset(seed=0)
    observation = env.step(env.action_space.sample())[0]
    q = env.episodes.qpos[0]
    v = env.episodes.qvel[0]
    seen = {name: observation[where] for name, where in env.layout.items()}
    np.testing.assert_array_equal(seen["theta"], q[[1, 3]])
    np.testing.assert_array_equal(seen["theta_dot"], v[[1, 3]])
    np.testing.assert_array_equal(seen["foot"], kinematics.chain_points(env.task.leg, q[1:]).F)
    assert seen["hip_z"] == q[0]
    record = {"hip_z": q[:1], "foot_z": seen["foot"][1:]}
    height = float(ground.height(env.task.leg, record)[0])
    assert seen["contact"] == (height <= 1e-6)


def test_sensors_are_seen_late_and_noisy() -> None:
    exact = LegEnv("track")
    late = LegEnv("track", sensors=Sensors(delay=0.005))
    noisy = LegEnv("track", sensors=Sensors(noise=0.01))
    seen = {}
    for name, env in (("exact", exact), ("late", late), ("noisy", noisy)):
        first, _ = env.reset(seed=1)
        rows = [first]
        for _ in range(3):
            rows.append(env.step(env.episodes.qpos[0, ::2] * 0.98)[0])
        seen[name] = np.array(rows)[:, :2]
    np.testing.assert_array_equal(seen["late"][1:], seen["exact"][:-1])
    assert 1e-4 < np.abs(seen["noisy"][0] - seen["exact"][0]).max() < 0.05


# edge


def test_the_loop_is_ended_with_its_reason() -> None:
    env = LegEnv("hop", span=3.0)
    env.reset(seed=0)
    ends = set()
    random = np.random.default_rng(0)
    low = env.episodes.low
    high = env.episodes.high
    for _ in range(20):
        env.reset()
        for _ in range(100):
            *_, terminated, _, info = env.step(np.where(random.random(2) < 0.5, low, high))
            if terminated:
                ends.add(info["reason"])
                break
            assert info["reason"] == ""
    assert ends
    assert ends <= {"gap", "flip", "limit"}


def test_a_leg_that_breaks_down_ends_as_it_was() -> None:
    env = LegEnv("track", servo=Servo(limit=1e9), action="torque")
    before, _ = env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step(np.array([1e9, -1e9]))
    assert info["reason"] == "broken"
    assert terminated
    assert not truncated
    assert np.isfinite(observation).all()
    assert np.isfinite(reward)
    np.testing.assert_array_equal(observation[:8], before[:8])
    env.reset(seed=0)
    assert env.step(np.zeros(2))[4]["reason"] == ""


def test_registered_twice_is_once() -> None:
    before = len(gymnasium.registry)
    fivebar_sim.gym.register()
    assert len(gymnasium.registry) == before


# refusal


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.0], r"action must have shape \(\.\.\., 2\), got \(1,\)"),
        ([[-2.3, -0.8]], r"action must have shape \(2,\), got \(1, 2\)"),
        ([np.nan, -0.8], r"action theta\[0\] must be in \[-3.32707, -1.32707\] rad, got nan"),
        ([-2.3, np.inf], r"action theta\[1\] must be in \[-1.81452, 0.185479\] rad, got inf"),
        ([-2.3, 0.2], r"action theta\[1\] must be in \[-1.81452, 0.185479\] rad, got 0.2 at index"),
        (["a", "b"], r"action must be numbers of shape \(\.\.\., 2\)"),
    ],
)
def test_refusal_of_an_action(action: Any, message: str) -> None:
    env = LegEnv("track")
    env.reset(seed=0)
    with pytest.raises(ArgumentError, match=f"^{message}"):
        env.step(action)


def test_refusal_of_a_step_before_reset() -> None:
    with pytest.raises(ArgumentError, match=r"^step comes after reset"):
        LegEnv("track").step(np.array([-2.3, -0.8]))


@pytest.mark.parametrize("seed", [-1, 1.5, "a"])
def test_refusal_of_a_seed(seed: Any) -> None:
    with pytest.raises(gymnasium.error.Error, match="must be"):
        LegEnv("track").reset(seed=seed)


def test_refusal_of_reset_options() -> None:
    env = LegEnv("track")
    env.reset(options={})
    with pytest.raises(ArgumentError, match=r"^reset has no options, got 'spread'"):
        env.reset(options={"spread": 0.0})


def test_refusal_of_what_is_unknown() -> None:
    with pytest.raises(ArgumentError, match=r"^unknown task 'run'; known: gait, hop, stand, track"):
        LegEnv("run")
    with pytest.raises(ArgumentError, match=r"^unknown render_mode 'human'; known: rgb_array"):
        LegEnv("track", render_mode="human")


def test_picture_shows_the_robot_and_follows_it() -> None:
    made = WalkEnv(render_mode="rgb_array", width=80, height=60)
    with pytest.raises(ArgumentError, match=r"^render comes after reset"):
        made.render()
    made.reset(seed=1)
    try:
        picture = made.render()
    except ConfigError as error:
        pytest.skip(str(error))
    assert picture.shape == (60, 80, 3)
    assert picture.std() > 5.0
    np.testing.assert_array_equal(picture, made.render())
    made.step(np.full(8, 0.5))
    assert (picture != made.render()).any()
    made.close()
