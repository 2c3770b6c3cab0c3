"""Gymnasium's wrappers about the environments, their pictures, and MuJoCo's objects of them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim import kinematics
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.gym import LegEnv
from fivebar_sim.tasks.pictures import Pictures
from fivebar_sim.vector import LegVectorEnv

ONE = np.float64(1.0)


def doubled(values: Any) -> Any:
    """Return twice some values."""
    return 2.0 * values


WRAPPERS: dict[str, Callable[[Any], Any]] = {
    "AddWhiteNoise": lambda env: wrappers.AddWhiteNoise(env, probability_of_noise_per_pixel=0.1),
    "AddRenderObservation": lambda env: wrappers.AddRenderObservation(env),
    "Autoreset": lambda env: wrappers.Autoreset(env),
    "ClipAction": lambda env: wrappers.ClipAction(env),
    "ClipReward": lambda env: wrappers.ClipReward(env, 0.0, 1.0),
    "DelayObservation": lambda env: wrappers.DelayObservation(env, delay=2),
    "DiscretizeAction": lambda env: wrappers.DiscretizeAction(env, bins=5),
    "DtypeObservation": lambda env: wrappers.DtypeObservation(env, np.float32),
    "FlattenObservation": lambda env: wrappers.FlattenObservation(env),
    "FrameStackObservation": lambda env: wrappers.FrameStackObservation(env, 3),
    "MaxAndSkipObservation": lambda env: wrappers.MaxAndSkipObservation(env, skip=2),
    "NormalizeObservation": lambda env: wrappers.NormalizeObservation(env),
    "NormalizeReward": lambda env: wrappers.NormalizeReward(env),
    "OrderEnforcing": lambda env: wrappers.OrderEnforcing(env),
    "PassiveEnvChecker": lambda env: wrappers.PassiveEnvChecker(env),
    "RecordEpisodeStatistics": lambda env: wrappers.RecordEpisodeStatistics(env),
    "RenderCollection": lambda env: wrappers.RenderCollection(env),
    "RepeatAction": lambda env: wrappers.RepeatAction(env, num_repeats=2),
    "RescaleAction": lambda env: wrappers.RescaleAction(env, -ONE, ONE),
    "ReshapeObservation": lambda env: wrappers.ReshapeObservation(env, (7, 2)),
    "StickyAction": lambda env: wrappers.StickyAction(env, 0.5),
    "TimeAwareObservation": lambda env: wrappers.TimeAwareObservation(env),
    "TimeLimit": lambda env: wrappers.TimeLimit(env, 3),
    "TransformAction": lambda env: wrappers.TransformAction(env, lambda a: a, env.action_space),
    "TransformObservation": lambda env: wrappers.TransformObservation(
        env, doubled, env.observation_space
    ),
    "TransformReward": lambda env: wrappers.TransformReward(env, doubled),
}
"""Those that apply; the others are for observations that are pictures or bounded, or need another
library (moviepy, pygame, torch, jax)."""

OF_VECTORS: dict[str, Callable[[Any], Any]] = {
    "ClipAction": lambda envs: vector_wrappers.ClipAction(envs),
    "ClipReward": lambda envs: vector_wrappers.ClipReward(envs, 0.0, 1.0),
    "DictInfoToList": lambda envs: vector_wrappers.DictInfoToList(envs),
    "DtypeObservation": lambda envs: vector_wrappers.DtypeObservation(envs, np.float32),
    "FlattenObservation": lambda envs: vector_wrappers.FlattenObservation(envs),
    "NormalizeObservation": lambda envs: vector_wrappers.NormalizeObservation(envs),
    "NormalizeReward": lambda envs: vector_wrappers.NormalizeReward(envs),
    "RecordEpisodeStatistics": lambda envs: vector_wrappers.RecordEpisodeStatistics(envs),
    "RescaleAction": lambda envs: vector_wrappers.RescaleAction(envs, -ONE, ONE),
    "TransformAction": lambda envs: vector_wrappers.TransformAction(envs, lambda a: a),
    "TransformReward": lambda envs: vector_wrappers.TransformReward(envs, doubled),
}

CAST = pytest.mark.filterwarnings("ignore:.*precision lowered by casting to float32")

# law


@CAST
@pytest.mark.parametrize("name", WRAPPERS)
def test_wrapper_of_gymnasium_applies(name: str) -> None:
    """Episodes to their end and beyond, with actions from the wrapper's own space."""
    drawn = name in ("AddRenderObservation", "RenderCollection")
    options: dict[str, Any] = (
        {"render_mode": "rgb_array", "width": 32, "height": 24} if drawn else {}
    )
    bare = gymnasium.make("fivebar/Track-v0", duration=0.015, **options)
    try:
        env = WRAPPERS[name](bare)
        seen, _ = env.reset(seed=0)
    except ConfigError as error:
        pytest.skip(str(error))
    env.action_space.seed(0)
    ends = 0
    for _ in range(4 if drawn else 12):
        # Clipped actions have no bounds: from the leg's own space.
        space = bare.action_space if name == "ClipAction" else env.action_space
        seen, reward, terminated, truncated, _ = env.step(space.sample())
        assert np.isfinite(np.asarray(seen, dtype=np.float64)).all()
        assert np.isfinite(reward)
        if terminated or truncated:
            ends += 1
            env.reset()
    assert ends >= 1
    if name not in ("AddWhiteNoise", "TransformObservation", "NormalizeObservation"):
        assert np.shape(seen) == env.observation_space.shape
    env.close()


@CAST
@pytest.mark.parametrize(
    ("name", "mode"),
    [
        (name, mode)
        for name in OF_VECTORS
        for mode in ("NextStep", "SameStep")
        # Gymnasium's wrappers of observations refuse that mode themselves.
        if mode == "NextStep" or not name.endswith("Observation")
    ],
)
def test_wrapper_of_vectors_applies(name: str, mode: str) -> None:
    bare = LegVectorEnv("track", 2, nthread=1, autoreset_mode=mode, duration=0.03)
    envs = OF_VECTORS[name](bare)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    space = bare.action_space if name == "ClipAction" else envs.action_space
    space.seed(0)
    ends = 0
    for _ in range(12):
        seen, reward, _, truncated, info = envs.step(space.sample())
        assert np.isfinite(seen).all()
        assert np.shape(reward) == (2,)
        ends += int(truncated.sum())
        if name == "RecordEpisodeStatistics" and truncated.any():
            assert info["episode"]["l"].tolist() == [6, 6]
        if name == "DictInfoToList":
            assert [each["reason"] for each in info] == ["time" if t else "" for t in truncated]
    assert ends >= 2
    envs.close()


# edge


def test_model_and_data_are_the_legs() -> None:
    env = LegEnv("hop", servo=Servo(limit=1.0))
    env.reset(seed=0)
    for _ in range(5):
        env.step(env.episodes.low)
    data = env.data
    np.testing.assert_array_equal(data.qpos, env.episodes.qpos[0])
    np.testing.assert_array_equal(data.qvel, env.episodes.qvel[0])
    assert data.time == pytest.approx(0.025)
    foot = data.site("foot").xpos - data.body("hip").xpos
    q = env.episodes.qpos[0, 1:]
    np.testing.assert_allclose(foot[[0, 2]], kinematics.chain_points(env.task.leg, q).F, atol=1e-12)
    assert env.model.nq == len(data.qpos)
    data.qpos[:] = 0.0
    env.step(env.episodes.low)
    assert env.data.qpos.any()


def test_pictures_have_the_size_and_the_camera_that_are_asked_for() -> None:
    moved = {}
    for distance, width, height in ((0.4, 96, 64), (1.2, 480, 360)):
        camera = {"distance": distance}
        env = LegEnv("track", render_mode="rgb_array", width=width, height=height, camera=camera)
        env.reset(seed=0)
        try:
            first = env.render()
        except ConfigError as error:
            pytest.skip(str(error))
        assert first.shape == (height, width, 3)
        for _ in range(10):
            env.step(env.episodes.low)
        moved[distance] = (env.render() != first).any(axis=-1).mean()
        env.close()
    # From three times as far the leg takes a ninth of the picture.
    assert 0.02 < moved[0.4] < 0.5
    assert moved[1.2] < 0.2 * moved[0.4]


def test_picture_shows_the_leg() -> None:
    env = LegEnv("stand", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        first = env.render()
    except ConfigError as error:
        pytest.skip(str(error))
    for _ in range(40):
        env.step(env.episodes.low)
    second = env.render()
    env.close()
    env.close()
    assert first.shape == (480, 640, 3)
    assert first.std() > 5.0
    assert (first != second).any()
    assert LegEnv("stand").render() is None


def test_picture_has_a_shadow_as_fine_as_it_is() -> None:
    env = LegEnv("stand")
    bare = copy.copy(env.model)
    bare.light_castshadow[:] = False
    seen = []
    try:
        for model in (env.model, bare):
            picture = Pictures.of(None, 64, 48).of_leg(model, env.task.leg)
            assert picture._model.vis.quality.shadowsize == 128
            seen.append(picture.take(model.key("home").qpos))
            picture.close()
    except ConfigError as error:
        pytest.skip(str(error))
    assert (seen[0] != seen[1]).any(axis=-1).mean() > 0.02
