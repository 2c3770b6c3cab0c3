"""Many legs at once: the bits of each alone, autoreset, seeds, what is drawn, what is refused."""

from __future__ import annotations

import resource
from typing import Any

import gymnasium
import numpy as np
import pytest
from env_runs import actions, played, scenario, task_of
from gymnasium.vector import AutoresetMode

import fivebar_sim.gym
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.gym import LegEnv
from fivebar_sim.tasks import KINDS, Hop, Randomise
from fivebar_sim.vector import LegVectorEnv

RANGES = Randomise(
    length=(0.95, 1.05),
    mass=(0.8, 1.2),
    trunk=(0.8, 1.2),
    friction=(0.5, 1.0),
    kp=(0.8, 1.2),
    kd=(0.8, 1.2),
    delay=(0.0, 0.012),
)
LEGS = 3


# oracle


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("randomise", [None, RANGES])
def test_each_leg_has_the_bits_of_it_alone(kind: str, randomise: Randomise | None) -> None:
    """Wild actions, noisy sensors, episodes that end at their own times; 2 threads."""
    options: dict[str, Any] = {
        "randomise": randomise,
        "action": "motion" if randomise else "position",
        "duration": 0.05,
        "span": 2.0,
        "sensors": Sensors(noise=0.01, delay=0.002),
    }
    legs = LegVectorEnv(kind, LEGS, nthread=2, model_seed=3, **options)
    alone = [LegEnv(kind, model_seed=3 + i, **options) for i in range(LEGS)]
    seen = legs.reset(seed=7)[0]
    np.testing.assert_array_equal(seen, [env.reset(seed=7 + i)[0] for i, env in enumerate(alone)])
    random = np.random.default_rng(0)
    over = [False] * LEGS
    ends = 0
    for _ in range(34):
        chosen = random.uniform(legs.episodes.low, legs.episodes.high, legs.action_space.shape)
        seen, reward, terminated, truncated, info = legs.step(chosen)
        for i, env in enumerate(alone):
            row = (reward[i], terminated[i], truncated[i], str(info["reason"][i]))
            if over[i]:
                observation = env.reset()[0]
                expected = (0.0, False, False, "")
            else:
                observation, *rest, more = env.step(chosen[i])
                expected = (*rest, more["reason"])
                assert {name: term[i] for name, term in info["terms"].items()} == more["terms"]
            assert row == expected
            np.testing.assert_array_equal(seen[i], observation)
            np.testing.assert_array_equal(legs.episodes.qpos[i], env.episodes.qpos[0])
            np.testing.assert_array_equal(legs.episodes.qvel[i], env.episodes.qvel[0])
            over[i] = bool(expected[1] or expected[2])
            ends += over[i]
    assert ends > 2 * LEGS


@pytest.mark.parametrize("kind", ["track", "hop"])
def test_states_are_the_scenarios(kind: str) -> None:
    wanted = scenario(kind, "servo.delay=0.002")
    task = task_of(kind, wanted)
    tables = np.stack([actions(task, seed) for seed in range(3)])
    legs = LegVectorEnv(task, 3, nthread=2)
    legs.reset(seed=0)
    runs = [played(wanted, table) for table in tables]
    for row in range(task.periods):
        legs.step(tables[:, row])
        k = (row + 1) * task.every - 1
        for i, theirs in enumerate(runs):
            np.testing.assert_array_equal(legs.episodes.qpos[i], theirs[0][k])
            np.testing.assert_array_equal(legs.episodes.qvel[i], theirs[1][k])


def test_legs_are_alike_on_any_number_of_threads() -> None:
    seen = []
    for threads in (1, 2, 3):
        legs = LegVectorEnv("hop", 4, nthread=threads, randomise=RANGES)
        row = legs.reset(seed=0)[0]
        random = np.random.default_rng(0)
        low = legs.episodes.low
        high = legs.episodes.high
        for _ in range(30):
            row = legs.step(random.uniform(low, high, (4, 2)))[0]
        seen.append(row)
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[0], seen[2])


# edge


def test_gymnasium_makes_it() -> None:
    assert fivebar_sim.gym.LegEnv
    legs = gymnasium.make_vec("fivebar/Hop-v0", num_envs=3, action="motion")
    assert isinstance(legs.unwrapped, LegVectorEnv)
    assert legs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, info = legs.reset(seed=0)
    assert seen in legs.observation_space
    assert info == {}
    seen, reward, terminated, truncated, info = legs.step(legs.action_space.sample())
    assert seen in legs.observation_space
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    assert terminated.dtype == truncated.dtype == bool
    legs.close()


def test_seeds_are_each_legs() -> None:
    legs = LegVectorEnv("track", 3)
    seen = legs.reset(seed=4)[0]
    np.testing.assert_array_equal(seen, legs.reset(seed=[4, 5, 6])[0])
    np.testing.assert_array_equal(seen[[2, 1, 0]], legs.reset(seed=[6, 5, 4])[0])
    mixed = legs.reset(seed=[4, None, 6])[0]
    np.testing.assert_array_equal(seen[[0, 2]], mixed[[0, 2]])
    assert not np.array_equal(legs.reset()[0], mixed)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_masked_reset_leaves_the_others_be(mode: str) -> None:
    """Each leg is as alone, with noise, at whatever step the others are reset."""
    options: dict[str, Any] = {"sensors": Sensors(noise=0.01), "duration": 0.5}
    legs = LegVectorEnv("hop", LEGS, nthread=1, autoreset_mode=mode, **options)
    alone = [LegEnv("hop", **options) for _ in range(LEGS)]
    seen = legs.reset(seed=7)[0]
    for i, env in enumerate(alone):
        env.reset(seed=7 + i)
    random = np.random.default_rng(1)
    for k in range(20):
        mask = random.random(LEGS) < 0.4
        if k % 3 == 0 and mask.any():
            seeds = None if k % 2 else [100 * k + i for i in range(LEGS)]
            again = legs.reset(seed=seeds, options={"reset_mask": mask})[0]
            for i in np.flatnonzero(mask).tolist():
                first = alone[i].reset(seed=seeds[i] if seeds else None)[0]
                np.testing.assert_array_equal(again[i], first)
            np.testing.assert_array_equal(again[~mask], seen[~mask])
        chosen = random.uniform(legs.episodes.low, legs.episodes.high, (LEGS, 2))
        seen = legs.step(chosen)[0]
        expected = [env.step(action)[0] for env, action in zip(alone, chosen, strict=True)]
        np.testing.assert_array_equal(seen, expected)


def test_same_step_autoreset_is_gymnasiums() -> None:
    """Against Gymnasium's own vector environment of single ones: every number, at every end."""
    options: dict[str, Any] = {"sensors": Sensors(noise=0.01), "duration": 0.05, "span": 2.0}
    legs = LegVectorEnv("hop", 3, nthread=1, autoreset_mode="SameStep", **options)
    theirs = gymnasium.vector.SyncVectorEnv(
        [lambda: LegEnv("hop", **options)] * 3, autoreset_mode=AutoresetMode.SAME_STEP
    )
    np.testing.assert_array_equal(legs.reset(seed=2)[0], theirs.reset(seed=2)[0])
    random = np.random.default_rng(0)
    ends = 0
    for _ in range(35):
        chosen = random.uniform(legs.episodes.low, legs.episodes.high, (3, 2))
        *ours, info = legs.step(chosen)
        *expected, more = theirs.step(chosen)
        for mine, other in zip(ours, expected, strict=True):
            np.testing.assert_array_equal(mine, other)
        assert ("final_obs" in info) == ("final_obs" in more)
        for i in np.flatnonzero(info.get("_final_obs", np.zeros(3))).tolist():
            np.testing.assert_array_equal(info["final_obs"][i], more["final_obs"][i])
            assert info["final_info"]["reason"][i] == more["final_info"]["reason"][i] != ""
            ends += 1
    assert ends > 9


def test_disabled_autoreset_waits_for_a_reset() -> None:
    legs = LegVectorEnv("track", 2, nthread=1, autoreset_mode="Disabled", duration=0.01)
    legs.reset(seed=0)
    legs.reset(options={"reset_mask": np.array([False, True])})
    middle = np.tile(0.5 * (legs.episodes.low + legs.episodes.high), (2, 1))
    legs.step(middle)
    assert legs.step(middle)[3].all()
    with pytest.raises(ArgumentError, match=r"^the episodes of legs \[0, 1\] are over: reset them"):
        legs.step(middle)
    legs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ArgumentError, match=r"^the episodes of legs \[1\] are over"):
        legs.step(middle)


def test_picture_of_all_legs_has_each_in_its_place() -> None:
    legs = LegVectorEnv("track", 3, nthread=1, render_mode="rgb_array", width=60, height=40)
    each = LegVectorEnv("track", 3, nthread=1, render_mode="rgb_array_list", width=60, height=40)
    legs.reset(seed=0)
    each.reset(seed=0)
    try:
        whole = legs.render()
    except ConfigError as error:
        pytest.skip(str(error))
    parts = each.render()
    assert whole.shape == (80, 120, 3)
    places = (np.s_[:40, :60], np.s_[:40, 60:], np.s_[40:, :60])
    for place, part in zip(places, parts, strict=True):
        np.testing.assert_array_equal(whole[place], part)
        assert part.std() > 5.0
    assert not whole[40:, 60:].any()
    legs.close()
    each.close()
    assert LegVectorEnv("track", 2, nthread=1).render() is None


def test_what_came_before_stays_as_it_was() -> None:
    legs = LegVectorEnv("track", 2)
    first = legs.reset(seed=0)[0]
    copy = first.copy()
    second = legs.step(legs.action_space.sample())
    kept = [np.copy(part) for part in second[:4]]
    legs.step(legs.action_space.sample())
    np.testing.assert_array_equal(first, copy)
    for part, before in zip(second[:4], kept, strict=True):
        np.testing.assert_array_equal(part, before)


def test_drawn_legs_differ() -> None:
    legs = LegVectorEnv("hop", 4, randomise=RANGES)
    assert len({task.leg.L2 for task in legs.drawn}) == 4
    assert len({task.servo.kp for task in legs.drawn}) == 4
    assert len({each.mass for each in legs.drawn if isinstance(each, Hop)}) == 4


@pytest.mark.long
def test_memory_is_flat_over_resets() -> None:
    env = LegEnv("hop", sensors=Sensors(noise=0.01))
    for _ in range(10_000):
        env.reset()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(100_000):
        env.reset()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1024  # [kB]


# refusal


@pytest.mark.parametrize(
    ("actions_", "message"),
    [
        ([[-2.3, -0.8]], r"action must have shape \(2, 2\), got \(1, 2\)"),
        (
            [[-2.3, -0.8], [-2.3, np.nan]],
            r"action theta\[1\] must be in \[-1.81452, 0.185479\] rad, got nan at index \(1, 1\)",
        ),
    ],
)
def test_refusal_of_actions(actions_: Any, message: str) -> None:
    legs = LegVectorEnv("track", 2)
    legs.reset(seed=0)
    with pytest.raises(ArgumentError, match=f"^{message}"):
        legs.step(actions_)


@pytest.mark.parametrize("seed", [-1, 1.5, "a", [0, -1]])
def test_refusal_of_a_seed(seed: Any) -> None:
    with pytest.raises((gymnasium.error.Error, ArgumentError)):
        LegVectorEnv("track", 2).reset(seed=seed)


@pytest.mark.parametrize("number", [0, -1, 1.5, float("nan"), "2"])
def test_refusal_of_a_number_of_legs(number: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^num_envs must be in \[1, inf\), got"):
        LegVectorEnv("track", number)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mask": 1}, r"unknown option of reset 'mask'; known: reset_mask$"),
        ({"reset_mask": [True, False]}, r"reset_mask must be an array of 2 bools, one True at"),
        ({"reset_mask": np.ones(2)}, r"reset_mask must be an array of 2 bools"),
        ({"reset_mask": np.ones(3, bool)}, r"reset_mask must be an array of 2 bools"),
        ({"reset_mask": np.zeros(2, bool)}, r"reset_mask must be an array of 2 bools"),
        ({"reset_mask": np.array([True, False])}, r"reset_mask leaves legs out that were never"),
        ("reset_mask", r"options of reset must be None or a table, got 'reset_mask'"),
    ],
)
def test_refusal_of_reset_options(options: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{message}"):
        LegVectorEnv("track", 2, nthread=1).reset(options=options)


def test_refusal_of_too_few_seeds() -> None:
    with pytest.raises(ArgumentError, match=r"^seed must be 2 numbers, got 1"):
        LegVectorEnv("track", 2).reset(seed=[1])
