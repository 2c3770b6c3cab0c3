"""Options of environments: tables from YAML or JSON, and what is refused with what is legal."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim import Scenario, tasks
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.gym import LegEnv
from fivebar_sim.paths import Circle
from fivebar_sim.tasks import Randomise
from fivebar_sim.vector import LegVectorEnv

TABLES: dict[str, Any] = json.loads("""{
    "leg": {"preset": "classic", "L2": 0.065},
    "servo": {"preset": "xl330", "delay": 0.002},
    "path": {"kind": "circle", "centre": [0.0, -0.075], "radius": 0.01, "frequency": 2.0},
    "sensors": {"noise": 0.001},
    "weights": {"effort": -0.2}
}""")
RANGES = {"mass": [0.9, 1.1], "delay": [0.0, 0.004]}


def made(name: str = "Track", **more: Any) -> Any:
    return gymnasium.make(f"fivebar/{name}-v0", **more)


def made_vec(name: str = "Track", **more: Any) -> Any:
    return gymnasium.make_vec(f"fivebar/{name}-v0", **{"num_envs": 2, **more})


# law


def test_tables_are_the_objects_of_a_scenario() -> None:
    """With the rotor that comes with the servo, as `fivebar run` has it."""
    task = tasks.task("track", **TABLES)
    table = {"name": "same", **{name: TABLES[name] for name in ("leg", "servo", "path", "sensors")}}
    scenario = Scenario.from_table(table, "same", Path())
    for name in ("leg", "servo", "path", "sensors"):
        assert getattr(task, name) == getattr(scenario, name)
    assert task.leg.armature == task.servo.armature == 1.31e-4
    assert task.weight("effort") == -0.2
    for leg in ({"leg": "q8bot"}, {"leg": {"preset": "q8bot"}}, {}):
        assert tasks.task("track", servo="xl330", **leg).leg.armature == 1.31e-4
    own = FiveBar()
    assert tasks.task("track", servo="xl330", leg=own).leg == own


def test_a_whole_task_may_be_a_table() -> None:
    given = {"kind": "hop", "target": 0.03, "duration": 1.0}
    assert tasks.task(given) == tasks.task("hop", target=0.03, duration=1.0)
    assert tasks.task(given, duration=2.0) == tasks.task("hop", target=0.03, duration=2.0)


@pytest.mark.parametrize("options", [TABLES, {"leg": FiveBar(L2=0.065), "servo": Servo(kp=5.0)}])
def test_spec_is_json_and_makes_the_same_again(options: dict[str, Any]) -> None:
    path = Circle(centre=(0.0, -0.075), radius=0.01, frequency=2.0)
    more = {"path": path, "sensors": Sensors(noise=1e-3), "randomise": Randomise(mass=(0.9, 1.1))}
    env = made(**{**options, **more}, period=0.01, render_mode="rgb_array")
    assert env.spec.max_episode_steps == 400
    text = env.spec.to_json()
    again: Any = gymnasium.make(EnvSpec.from_json(text))
    assert again.unwrapped.task == env.unwrapped.task
    assert again.unwrapped.render_mode == "rgb_array"
    assert again.spec.max_episode_steps == 400
    first = env.reset(seed=3)[0]
    np.testing.assert_array_equal(first, again.reset(seed=3)[0])


def test_spec_of_a_vector_environment_makes_the_same_again() -> None:
    options = {"randomise": RANGES, "autoreset_mode": "SameStep", "nthread": 1, **TABLES}
    envs = made_vec(**options)
    spec = EnvSpec.from_json(envs.spec.to_json())
    assert spec.max_episode_steps == envs.unwrapped.task.periods
    again: Any = gymnasium.make_vec(spec)
    assert again.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    assert again.unwrapped.drawn == envs.unwrapped.drawn


def test_fewer_steps_are_an_episodes_end() -> None:
    envs = made_vec(max_episode_steps=3, nthread=1)
    envs.reset(seed=0)
    middle = 0.5 * (envs.unwrapped.episodes.low + envs.unwrapped.episodes.high)
    ends = [envs.step(np.tile(middle, (2, 1)))[3].tolist() for _ in range(3)]
    assert ends == [[False] * 2, [False] * 2, [True] * 2]


# refusal

NUMBERS = ("4", None, [1.0], {"x": 1}, float("nan"), float("inf"), True, b"1")
"""What is no number for a scenario."""

WRONG: dict[str, tuple[Any, ...]] = {
    "leg": (3, 3.5, True, ["classic"], b"classic", {"L9": 1.0}, {"L1": "a"}, {"preset": 3}, "nope"),
    "servo": (3, None, True, ["xl330"], {"kp": "a"}, {"gain": 1.0}, {"preset": []}, "nope"),
    "path": (3, "circle", ["circle"], {}, {"kind": "square"}, {"kind": "circle"}, {"kind": [1]}),
    "sensors": (3, None, "exact", [0.1], {"nois": 0.1}, {"noise": "a"}, {"noise": -1.0}),
    "weights": (3, None, "effort", [1.0], {"effrt": 1.0}, {"effort": "a"}, {1: 1.0}),
    "action": (3, None, ["position"], "speed", {"a": 1}, np.zeros(2)),
    "integrator": (3, None, ["discrete"], "rk4", {"a": 1}, np.zeros(2)),
    "span": NUMBERS,
    "spread": NUMBERS,
    "period": NUMBERS,
    "duration": NUMBERS,
    "timestep": NUMBERS,
    "mass": NUMBERS,
    "friction": NUMBERS,
    "drop": NUMBERS,
    "frequency": NUMBERS,
    "randomise": (3, "mass", [0.9, 1.1], {"mas": [1, 1]}, {"mass": 1.0}, {"mass": ["a", 1]}),
    "model_seed": ("4", None, [1], 1.5, -1, float("nan"), True),
}
ENVIRONMENT: dict[str, tuple[Any, ...]] = {
    "width": ("4", None, [1], 1.5, 0, 10_000),
    "height": ("4", None, [1], 1.5, 0, 10_000),
    "camera": (3, "front", [1], {"zoom": 1}, {"azimuth": "a"}, {"lookat": 3}, {"lookat": [1, 2]}),
}
VECTOR: dict[str, tuple[Any, ...]] = {
    "num_envs": ("2", None, [1], 1.5, 0),
    "nthread": ("2", None, [1], 1.5, -1),
    "autoreset_mode": ("next", None, 3, ["SameStep"]),
    "max_episode_steps": ("4", [1], 1.5, 0),
    "render_mode": ("human", "ansi"),
}
DM_CONTROL: dict[str, tuple[Any, ...]] = {
    "seed": ("4", [1], 1.5, -1, float("nan"), True),
    "flat_observation": ("yes", None, 1, [True]),
}


def load(**more: Any) -> Any:
    pytest.importorskip("dm_control", reason="dm-control has no wheel for this Python")
    from fivebar_sim import environment

    return environment.load("hop", **more)


@pytest.mark.parametrize(
    ("make", "table"),
    [
        (lambda **more: made("Hop", **more), WRONG | ENVIRONMENT),
        (lambda **more: made_vec("Hop", **more), WRONG | ENVIRONMENT | VECTOR),
        (load, WRONG | DM_CONTROL),
    ],
)
def test_refusal_of_wrong_options(
    make: Callable[..., Any], table: dict[str, tuple[Any, ...]]
) -> None:
    assert sum(map(len, table.values())) > 130  # three tables: above 400 rows
    for name, values in table.items():
        for value in values:
            with pytest.raises(ArgumentError) as caught:
                make(**{name: value})
            line = str(caught.value)
            where = f"{name}={value!r}: {line}"
            assert re.search(r"must be|known: |is missing|needs a kind", line), where
            assert name in line or re.search("option|reward term", line), where
            assert "\n" not in line, where


def test_refusal_of_tables_is_a_config_error_too() -> None:
    """What catches the errors of scenarios and files catches these."""
    for leg in ("nope", {"L9": 1}, {"preset": "nope"}, "nope.toml"):
        with pytest.raises(ConfigError):
            tasks.task("track", leg=leg)


@pytest.mark.parametrize("task", [3, None, ["track"], {"kind": "run"}, {}, {"kind": ["track"]}])
def test_refusal_of_a_task_that_is_none(task: Any) -> None:
    for make in (LegEnv, LegVectorEnv):
        with pytest.raises(ArgumentError, match=r"^unknown task .*known: gait, hop, stand, track"):
            make(task)
