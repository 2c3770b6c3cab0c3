"""Legs on a device as a vector environment: what is refused, and the law of the processor's."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from test_warp import needs_warp
from test_warp import stamp as stamp_of

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim.control.friction import Friction
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, ExtraError, FiveBarError
from fivebar_sim.tasks import REASONS, Randomise
from fivebar_sim.warp import device as devices
from fivebar_sim.warp import memory

RANGES = Randomise(
    length=(0.97, 1.03),
    mass=(0.8, 1.2),
    trunk=(0.8, 1.2),
    friction=(0.6, 1.0),
    kp=(0.8, 1.2),
    kd=(0.8, 1.2),
    delay=(0.0, 0.012),
)
RUBBING = Friction(model="stribeck", base=0.01, stribeck=0.02)
LEGS = 4
STEPS = 200
KERNELS = [f"episodes/{name}.py" for name in ("draws", "structs", "looks", "periods")]


def legs(kind: str, **options: Any) -> Any:
    """Return legs of a task on Warp's processor, unless told otherwise."""
    options = {"device": "cpu-warp", **options}
    return gymnasium.make_vec(f"fivebar/{kind.capitalize()}-v0", **options)


# what is refused, before anything is compiled


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"device": "gpu"}, r"^device must be None .*, got 'gpu'$"),
        ({"sensors": Sensors(noise=0.01)}, r"noise of the sensors"),
        (
            {"servo": Servo(friction=Friction(model="stribeck", base=0.01))},
            r"friction that changes",
        ),
        ({"autoreset_mode": "Disabled"}, r"autoreset_mode must be \"NextStep\" or"),
        ({"nthread": 2}, r"^no device can use nthread"),
        ({"render_mode": "rgb_array"}, r"^no device can use render_mode"),
    ],
)
def test_what_no_device_can_do_is_refused_before_warp_is_looked_for(
    monkeypatch: Any, options: dict[str, Any], said: str
) -> None:
    monkeypatch.setitem(sys.modules, "warp", None)
    with pytest.raises(FiveBarError, match=said) as caught:
        legs("track", num_envs=2, **options)
    assert "\n" not in str(caught.value)


def test_missing_package_says_what_to_install(monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "warp", None)
    with pytest.raises(ExtraError, match=r"pip install 'fivebar-sim\[gpu\]'$"):
        legs("hop", num_envs=2)


def test_too_little_memory_says_how_many_legs_fit(monkeypatch: Any) -> None:
    card = SimpleNamespace(alias="cuda:0")
    monkeypatch.setattr(devices, "opened", lambda name: card)
    monkeypatch.setattr(memory, "bytes_of_leg", lambda model: 1000)
    monkeypatch.setattr(memory, "free_bytes", lambda device: 1_000_000)
    with pytest.raises(ConfigError, match=r"^1000 legs need .* free: \d+ legs fit$"):
        legs("track", num_envs=1000, device="cuda:0")


# the law


def at_ends(there: dict[str, Any], here: dict[str, Any], over: Any) -> float:
    """Return how far the angles at the end of episodes differ, whose reasons must not."""
    reasons = REASONS[np.asarray(np.from_dlpack(there["reason"]), dtype=np.int64)]
    if "final_obs" not in here:
        np.testing.assert_array_equal(reasons, here["reason"])
        return 0.0

    np.testing.assert_array_equal(reasons[over], here["final_info"]["reason"][over])
    np.testing.assert_array_equal(np.from_dlpack(there["_final_obs"]), over)
    last = np.stack(here["final_obs"][over])
    return float(np.abs(np.from_dlpack(there["final_obs"])[over] - last)[:, :2].max())


def compared(kind: str, steps: int, **options: Any) -> tuple[dict[str, float], int]:
    """Return the largest differences from the processor's environment, and how many episodes ended.

    Setpoints of the whole span, which jump every fifth control step; randomised legs.
    """
    options = {"num_envs": LEGS, "randomise": RANGES, "model_seed": 3, "duration": 0.3, **options}
    there = legs(kind, **options)
    here = legs(kind, **options, device=None)
    first = there.reset(seed=7)[0]
    seen = here.reset(seed=7)[0]
    found = {"start": float(np.abs(np.from_dlpack(first) - seen).max())}
    random = np.random.default_rng(0)
    low = here.single_action_space.low
    action = np.zeros((LEGS, len(low)), dtype=np.float32)
    ends = 0
    angles = []

    for k in range(steps):
        drawn = random.uniform(low, here.single_action_space.high, action.shape)
        action = (drawn if k % 5 == 0 else action + 0.1 * (drawn - action)).astype(np.float32)
        *theirs, info = there.step(action)
        *mine, more = here.step(action.astype(np.float64))
        device = [np.from_dlpack(each) for each in theirs]
        for name, part in here.unwrapped.layout.items():
            off = np.abs(device[0][:, part] - mine[0][:, part]).max()
            found[name] = max(found.get(name, 0.0), float(off))
        angles.append(np.abs(device[0] - mine[0])[:, :2])
        found["reward"] = max(found.get("reward", 0.0), float(np.abs(device[1] - mine[1]).max()))
        for ours, expected in zip(device[2:], mine[2:], strict=True):
            np.testing.assert_array_equal(ours, expected)
        ends += int((mine[2] | mine[3]).sum())
        found["theta"] = max(found["theta"], at_ends(info, more, mine[2] | mine[3]))
    found["typical"] = float(np.median(angles))
    return found, ends


AIR = {"start": 2e-7, "theta": 2e-6, "theta_dot": 4e-4, "foot": 1e-7, "reward": 1e-5}
"""In the air: a few roundings of angles between 2 and 4 rad [rad, rad/s, m]."""

BARE = {"start": 2e-7, "theta": 2e-4, "theta_dot": 1e-2, "foot": 1e-5, "reward": 1e-3}
"""Of bare motors in the air: no spring pulls back what rounding moved."""

GROUND = {
    "start": 2e-7,
    "theta": 1e-2,
    "theta_dot": 2.0,
    "foot": 1e-3,
    "reward": 0.1,
    "typical": 3e-6,
}
"""On the ground: what the processor's own legs move by if their states are rounded to single
precision before each control step, 9e-3 rad and 1.4 rad/s: setpoints that jump by the whole span
throw the leg onto its foot, and a contact begins a step earlier or later. "typical" is the median
of the angles' differences over all legs and steps."""

BELT = GROUND | {"theta": 0.2, "theta_dot": 50.0, "foot": 0.01, "reward": 5.0}
"""On the treadmill, where the processor's rounded legs move by 0.054 rad and 15 rad/s."""


def check(found: dict[str, float], bars: dict[str, float]) -> None:
    """Raise unless differences are within bars."""
    for name, bar in bars.items():
        assert found[name] < bar, (name, found[name])


@needs_warp
def test_a_few_steps_are_the_processors() -> None:
    if not stamp_of(*KERNELS).exists():
        pytest.skip("no warm cache of Warp's kernels: run the long tests once")
    found, ends = compared("track", 12, duration=0.03, autoreset_mode="SameStep")
    check(found, AIR)
    assert ends == 2 * LEGS


@needs_warp
@pytest.mark.long
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("action", ["position", "motion", "torque"])
def test_track_is_the_processors(mode: str, action: str) -> None:
    servo = Servo() if action == "position" else Servo(limit=0.3, speed=40.0)
    found, ends = compared("track", STEPS, servo=servo, action=action, autoreset_mode=mode)
    check(found, BARE if action == "torque" else AIR)
    assert ends >= 3 * LEGS


@needs_warp
@pytest.mark.long
@pytest.mark.parametrize("kind", ["hop", "stand", "gait"])
@pytest.mark.parametrize("limit", [None, 1.0])
def test_legs_on_the_ground_are_the_processors(kind: str, limit: float | None) -> None:
    found, ends = compared(kind, STEPS, servo=Servo(limit=limit), autoreset_mode="SameStep")
    check(found, BELT if kind == "gait" else GROUND)
    assert ends >= 3 * LEGS


@needs_warp
@pytest.mark.long
def test_sensors_and_bus_are_the_processors() -> None:
    """Readings between two timesteps, commands at a rate of their own, both rounded."""
    options: dict[str, Any] = {
        "sensors": Sensors(delay=0.0073, resolution=0.01),
        "servo": Servo(rate=125.0, delay=0.0034, resolution=0.02),
    }
    found, _ = compared("track", STEPS, **options)
    # A reading on the edge between two steps of the sensor may be rounded to either.
    found["theta"] = min(found["theta"], abs(found["theta"] - 0.01))
    check(found, {**AIR, "theta": 4e-6, "theta_dot": 2e-3, "foot": 1e-6, "reward": 1e-4})


# arrays


@needs_warp
@pytest.mark.long
def test_arrays_are_handed_over_without_a_copy() -> None:
    envs = legs("hop", num_envs=3)
    action = np.tile(0.5 * sum(envs.unwrapped.task.bounds), (3, 1)).astype(np.float32)
    first = envs.reset(seed=0)[0]
    seen = np.from_dlpack(first)
    stamp_of(*KERNELS).touch()
    assert seen.ctypes.data == first.ptr
    before = seen.copy()
    observation, reward, *_ = envs.step(devices.warp().from_dlpack(action))
    assert observation.ptr == first.ptr
    assert np.from_dlpack(reward).dtype == np.float32
    assert not np.array_equal(before, seen)
    assert seen in envs.observation_space


@needs_warp
@pytest.mark.long
def test_wrong_actions_are_refused_in_one_line() -> None:
    envs = legs("track", num_envs=2)
    middle = np.tile(0.5 * sum(envs.unwrapped.task.bounds), (2, 1))
    with pytest.raises(ArgumentError, match=r"^step comes after reset$"):
        envs.step(middle)
    envs.reset(seed=0)
    for wrong, said in (
        (middle.tolist(), r"knows DLPack, got <class 'list'>$"),
        (middle[:1], r"floats of shape \(2, 2\), got float64 of \(1, 2\)$"),
        (middle.astype(np.int64), r"got int64 of \(2, 2\)$"),
        (middle + np.diag([0.0, 9.0]), r"^action theta\[1\] of leg 1 must be in \[.*\] rad"),
        (middle * np.array([np.nan, 1.0]), r"^action theta\[0\] of leg \d must be in"),
    ):
        with pytest.raises(ArgumentError, match=said):
            envs.step(wrong)
    envs.reset(seed=0)
    envs.step(middle)
