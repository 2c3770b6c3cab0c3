"""Copies of environments go on with the same bits: deep, pickled, wrapped, in a forked process."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.gym import LegEnv
from fivebar_sim.vector import LegVectorEnv

OPTIONS: dict[str, Any] = {
    "servo": Servo(delay=0.012, rate=250.0, limit=0.5, speed=40.0),
    "sensors": Sensors(noise=0.01, delay=0.0075),
    "randomise": {"length": [0.95, 1.05], "mass": [0.8, 1.2]},
    "duration": 0.1,
}
"""A bus and sensors that remember, limits that clip, noise, and episodes that end on the way."""

COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


def single() -> Any:
    return LegEnv("hop", **OPTIONS)


def wrapped() -> Any:
    env = gymnasium.make("fivebar/Hop-v0", **OPTIONS)
    # Gymnasium's RescaleAction itself cannot be pickled.
    return gymnasium.wrappers.FrameStackObservation(env, 2)


def vector() -> Any:
    return LegVectorEnv("hop", 3, nthread=2, autoreset_mode="SameStep", **OPTIONS)


def played(env: Any, seed: int, steps: int) -> list[np.ndarray]:
    """Return all numbers that some steps give; a single environment is reset at its ends."""
    random = np.random.default_rng(seed)
    space = env.action_space
    seen = []
    for _ in range(steps):
        observation, *numbers, _ = env.step(random.uniform(space.low, space.high))
        seen.append(np.hstack([np.ravel(part) for part in (observation, *numbers)]))
        if space.shape == (2,) and (numbers[1] or numbers[2]):
            seen.append(np.ravel(env.reset()[0]))
    return seen


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("make", [single, wrapped, vector])
def test_a_copy_goes_on_with_the_same_bits(make: Callable[[], Any], how: str) -> None:
    env = make()
    env.reset(seed=4)
    played(env, 0, 13)
    other = COPIES[how](env)
    theirs = played(other, 1, 30)
    ours = played(env, 1, 30)
    assert len(ours) == len(theirs)
    for one, two in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, two)
    # Its steps are not the first one's.
    before = env.unwrapped.episodes.qpos.copy()
    played(other, 2, 1)
    np.testing.assert_array_equal(env.unwrapped.episodes.qpos, before)


def test_a_copy_of_what_was_never_reset_is_as_good() -> None:
    env = copy.deepcopy(single())
    first = env.reset(seed=1)[0]
    np.testing.assert_array_equal(first, single().reset(seed=1)[0])


@pytest.mark.parametrize("how", COPIES)
def test_dm_control_is_copied_too(how: str) -> None:
    pytest.importorskip("dm_control", reason="dm-control has no wheel for this Python")
    from fivebar_sim import environment

    options = {name: value for name, value in OPTIONS.items() if name != "duration"}
    env = environment.load("hop", seed=0, duration=1.0, **options)
    env.reset()
    low = env.task.episodes.low
    env.step(low)
    other = COPIES[how](env)
    for action in (low, env.task.episodes.high, low):
        ours = env.step(action).observation
        for name, part in other.step(action).observation.items():
            np.testing.assert_array_equal(part, ours[name])


FORK = """
import os, sys
import numpy as np
from fivebar_sim.vector import LegVectorEnv

env = LegVectorEnv("track", 4, nthread=2)
env.reset(seed=0)
actions = np.tile(0.5 * (env.episodes.low + env.episodes.high), (4, 1))
env.step(actions)
unused = LegVectorEnv("track", 2, nthread=2)
read, write = os.pipe()
child = os.fork()
seen = env.step(actions)[0].tobytes()
if not child:
    os.write(write, seen)
    sys.exit()
status = os.waitpid(child, 0)[1]
print(status, os.read(read, len(seen)) == seen)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_forked_process_steps_on_and_ends() -> None:
    """A batch's threads stay behind: its steps waited for them for ever, and its end aborted."""
    command = [sys.executable, "-W", "ignore", "-c", FORK]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=100)
    assert done.stdout == "0 True\n"
