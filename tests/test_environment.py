"""One leg in dm_control: dm_env's conformance, the bits of the others, ends, refusals."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Generator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("dm_control", reason="dm-control has no wheel for this Python (3.13 and newer)")

from dm_env import StepType, test_utils
from env_runs import actions, played, scenario, task_of

from fivebar_sim import environment, kinematics
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, UnreachableError
from fivebar_sim.gym import LegEnv
from fivebar_sim.tasks import KINDS, Randomise

# isort: split
from absl.testing import absltest
from dm_control.rl import control


class Conformance(test_utils.EnvironmentTestMixin):
    """The conformance tests of dm_env; an episode is over on the way."""

    KIND = "track"

    def make_object_under_test(self, **unused_kwargs: Any) -> control.Environment:
        """Return what is tested."""
        return environment.load(self.KIND, seed=0, duration=0.05)

    def make_action_sequence(self) -> Generator[Any, Any, None]:
        """Yield actions beyond the end of an episode."""
        spec = self.environment.action_spec()
        random = np.random.default_rng(0)
        for _ in range(25):
            yield random.uniform(spec.minimum, spec.maximum)


class TestTrack(Conformance, absltest.TestCase):
    """Of the task track."""

    KIND = "track"


class TestStand(Conformance, absltest.TestCase):
    """Of the task stand."""

    KIND = "stand"


class TestHop(Conformance, absltest.TestCase):
    """Of the task hop."""

    KIND = "hop"


class TestGait(Conformance, absltest.TestCase):
    """Of the task gait."""

    KIND = "gait"


# oracle


@pytest.mark.parametrize("kind", ["track", "hop", "stand"])
@pytest.mark.parametrize("settings", [(), ("servo.delay=0.007", "servo.rate=250.0")])
def test_states_are_the_scenarios(kind: str, settings: tuple[str, ...]) -> None:
    wanted = scenario(kind, *settings)
    task = task_of(kind, wanted)
    table = actions(task)
    theirs = played(wanted, table)
    env = environment.load(task, seed=0)
    step = env.reset()
    for row, action in enumerate(table):
        step = env.step(action)
        k = (row + 1) * task.every - 1
        np.testing.assert_array_equal(env.physics.data.qpos, theirs[0][k])
        np.testing.assert_array_equal(env.physics.data.qvel, theirs[1][k])
    assert step.step_type is StepType.LAST


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("action", ["position", "motion", "torque"])
def test_all_is_as_in_gymnasium(kind: str, action: str) -> None:
    """Episodes of random actions, one seed: the same bits in observation, reward and end."""
    options: dict[str, Any] = {
        "action": action,
        "duration": 0.05,
        "servo": Servo(limit=1.0, delay=0.003),
        "randomise": Randomise(length=(0.97, 1.03), kp=(0.8, 1.2), delay=(0.0, 0.01)),
        "model_seed": 4,
    }
    env = environment.load(kind, seed=5, **options)
    other = LegEnv(kind, **options)
    step = env.reset()
    observation, _ = other.reset(seed=5)
    random = np.random.default_rng(1)
    for _ in range(14):
        chosen = random.uniform(other.episodes.low, other.episodes.high)
        over = step.last()
        step = env.step(chosen)
        if over:
            observation, _ = other.reset()
        else:
            observation, reward, terminated, truncated, info = other.step(chosen)
            assert step.reward == reward
            assert step.last() == (terminated or truncated)
            assert env.task.terms == info["terms"]
            assert env.task.reason == info["reason"]
            if step.last():
                assert step.discount == (1.0 if truncated else 0.0)
        joined = np.concatenate(list(step.observation.values()))
        np.testing.assert_array_equal(joined, observation)
        np.testing.assert_array_equal(env.physics.data.qpos, other.episodes.qpos[0])


# edge


def test_specs_name_what_there_is() -> None:
    env = environment.load("hop", action="motion")
    assert env.action_spec().name.split("\t") == [
        "theta_A",
        "theta_E",
        "theta_dot_A",
        "theta_dot_E",
    ]
    shapes = {name: spec.shape for name, spec in env.observation_spec().items()}
    assert list(shapes) == list(env.task.episodes.task.parts)
    assert shapes["hip_z"] == (1,)
    flat = environment.load("hop", flat_observation=True).reset().observation
    assert flat["observations"].shape == (14,)


def test_foot_is_that_of_qpos_not_of_the_step_before() -> None:
    env = environment.load("track", seed=0)
    env.reset()
    step = env.step(0.5 * (env.action_spec().minimum + env.action_spec().maximum))
    leg = env.task.episodes.task.leg
    q = env.physics.data.qpos
    np.testing.assert_array_equal(
        step.observation["foot"], kinematics.chain_points(leg, np.array(q)).F
    )
    assert not np.array_equal(env.physics.named.data.site_xpos["foot", "x"], q[0])


def test_physics_does_not_step_the_legacy_way() -> None:
    assert not environment.load("track").physics.legacy_step


def test_seed_says_all() -> None:
    first, again, other = (
        environment.load("track", seed=seed).reset().observation["foot"] for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_leg_that_breaks_down_is_an_end_not_an_error() -> None:
    env = environment.load("track", action="torque", servo=Servo(limit=1e9), seed=0)
    env.reset()
    step = env.step(np.array([1e9, -1e9]))
    assert env.task.reason == "broken"
    assert step.last()
    assert step.discount == 0.0
    assert np.isfinite(np.concatenate(list(step.observation.values()))).all()
    assert env.step(np.zeros(2)).first()
    assert not env.step(np.zeros(2)).last()


def test_the_viewer_would_run_it() -> None:
    """What `dm_control.viewer` does without a window: its runtime, with its own default action."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from dm_control.viewer import runtime
    env = environment.load("stand", seed=0)
    run = runtime.Runtime(environment=env, policy=None)
    run.tick(0.0, paused=False)
    for _ in range(10):
        run.tick(0.02, paused=False)
    assert env.physics.time() > 0.1
    assert env.physics.data.qpos[0] > 0.03


def test_wrappers_of_the_suite_apply() -> None:
    """They draw from `task.random`, and scale actions to the bounds exactly."""
    # All of the suite's own robots come with them.
    from dm_control.suite.wrappers import action_noise, action_scale

    env = action_noise.Wrapper(environment.load("track", seed=0), scale=0.01)
    env = action_scale.Wrapper(env, minimum=-1.0, maximum=1.0)
    env.reset()
    for part in (-1.0, 1.0, 0.3):
        step = env.step(np.full(2, part))
    assert step.reward is not None


def test_a_random_state_takes_the_generators_place() -> None:
    """As Shimmy seeds the episodes of dm_control's environments."""
    seen = []
    for seed in (3, 3, 4):
        env = environment.load("hop", seed=0, sensors={"noise": 0.01})
        env.task.random = np.random.RandomState(seed)
        seen.append([np.hstack(list(env.reset().observation.values())) for _ in range(2)])
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])
    assert not np.array_equal(seen[0][0], seen[0][1])


# refusal


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.0], r"action must have shape \(\.\.\., 2\), got \(1,\)"),
        ([np.nan, -0.8], r"action theta\[0\] must be in \[-3.32707, -1.32707\] rad, got nan"),
        ([-2.3, 9.0], r"action theta\[1\] must be in \[-1.81452, 0.185479\] rad, got 9.0"),
    ],
)
def test_refusal_of_an_action(action: list[float], message: str) -> None:
    env = environment.load("track")
    env.reset()
    with pytest.raises(ArgumentError, match=f"^{message}"):
        env.step(action)


@pytest.mark.parametrize("seed", [-1, 1.5, float("nan"), "a"])
def test_refusal_of_a_seed(seed: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^seed must be a whole number in \[0, inf\), got"):
        environment.load("track", seed=seed)


def test_refusal_of_what_is_unknown() -> None:
    with pytest.raises(ArgumentError, match=r"^unknown task 'swim'; known: gait, hop, stand, trac"):
        environment.load("swim")
    with pytest.raises(
        ConfigError, match=r"^unknown leg preset 'clasic'; .*did you mean 'classic'"
    ):
        environment.load("track", leg="clasic")
    with pytest.raises(UnreachableError, match=r"^the leg drawn from seed 3: path out of reach"):
        environment.load("track", randomise=Randomise(length=(0.3, 0.35)), model_seed=3)


def test_dm_control_and_pictures_share_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """dm_control loads OpenGL, once and for all: it must be the one that pictures need."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    code = (
        "from fivebar_sim import environment, gym; environment.load('track', seed=0); "
        "env = gym.LegEnv('track', render_mode='rgb_array', width=64, height=48); "
        "env.reset(seed=0); "
        "print(env.render().shape)"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True)
    required = os.environ.get("FIVEBAR_GL") == "required"
    if b"ConfigError: cannot draw: neither EGL nor OSMesa" in done.stderr and not required:
        pytest.skip("nothing can be drawn here")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"(48, 64, 3)\n", b"")
