"""The record and what is measured from it, in every scene, and as the command writes it."""

from __future__ import annotations

import json
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from shell import Shell

from fivebar_sim import kinematics, metrics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.metrics import branch, energy, ground, load
from fivebar_sim.metrics.catalogue import ROBOTS, SHOWN, shown
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import record
from fivebar_sim.simulation.steps import simulate

COLUMNS = (
    "time target_x target_z foot_x foot_z theta_A theta_B theta_E theta_D theta_dot_A theta_dot_B "
    "theta_dot_E theta_dot_D ctrl_A ctrl_E torque_A torque_E gap"
).split()
HIP = ["hip_z", "hip_dot_z"]
GROUND = ["ground_x", "ground_z", "rail_end"]
GAIT = "path={kind='gait', centre=[0, -0.07], stride=0.02, lift=0.01, frequency=4, ramp=0.1}"
SCENES = {
    "air": ["scene=air"],
    "payload": ["scene={kind='payload', mass=0.05}", "force={kind='constant', value=[0, -1]}"],
    "rail": ["scene={kind='rail', drop=0.01}", GAIT],
    "treadmill": ["scene={kind='treadmill', drop=0.01}", GAIT],
}
FORCE = "time_s,x_N,z_N\n0,0,0\n0.3,0,-1\n0.6,0.5,0\n"


WHOLE_SERVO = (
    *("servo.limit=5.0", "servo.speed=200.0", "servo.kt=1.0", "servo.resistance=1.0"),
    *("servo.thermal_resistance=1.0", "servo.thermal_time=60.0", "servo.temperature_max=80.0"),
)
"""A servo's table with all that its metrics come from."""


@cache
def done(kind: str, *settings: str) -> tuple[Plan, Result]:
    base = ["limits={}", "duration=0.35", "path.frequency=4", "path.ramp=0.1"]
    plan = rollout.plan(Scenario.load("classic-ellipse", [*base, *SCENES[kind], *settings]))
    return plan, rollout.execute(plan)


def pair(result: Result, name: str) -> Array:
    return np.stack([result.record[f"{name}_{side}"] for side in "AE"], axis=-1)


def file_of(folder: Path) -> dict[str, Array]:
    table = pyarrow.parquet.read_table(folder / "rollout.parquet")
    return {name: table[name].to_numpy() for name in table.column_names}


# law


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("air", []),
        ("payload", []),
        ("rail", [*HIP, *GROUND]),
        ("treadmill", [*HIP, *GROUND, "belt_x"]),
    ],
)
def test_columns_of_every_scene(kind: str, more: list[str]) -> None:
    plan, result = done(kind)
    assert list(result.record) == [*COLUMNS, *more]
    for name, column in result.record.items():
        assert column.shape == (350,), name
        assert column.dtype == np.float64
        assert column.flags.c_contiguous
        assert np.isfinite(column).all()
    np.testing.assert_array_equal(result.record["time"], np.arange(1, 351) * 1e-3)
    assert plan.model.nu == 2 + 2 * (kind == "payload")


@pytest.mark.parametrize("kind", SCENES)
def test_columns_are_the_states(kind: str) -> None:
    plan, result = done(kind)
    states = simulate(plan.model, plan.start[None], plan.ctrl[None])
    leg = plan.scenario.leg
    q = states.qpos[0, :, -4:]
    for i, joint in enumerate("ABED"):
        np.testing.assert_array_equal(result.record[f"theta_{joint}"], q[:, i])
        rate = states.qvel[0, :, states.qvel.shape[-1] - 4 + i]
        np.testing.assert_array_equal(result.record[f"theta_dot_{joint}"], rate)
    foot = kinematics.chain_points(leg, q).F
    np.testing.assert_array_equal(result.record["foot_x"], foot[:, 0])
    np.testing.assert_array_equal(result.record["foot_z"], foot[:, 1])
    np.testing.assert_array_equal(pair(result, "ctrl"), plan.setpoints)
    target = plan.motion.foot[1:]
    np.testing.assert_array_equal(result.record["target_x"], target[:, 0])
    np.testing.assert_array_equal(result.record["target_z"], target[:, 1])
    if "hip_z" in result.record:
        np.testing.assert_array_equal(result.record["hip_z"], states.qpos[0, :, 0])
        np.testing.assert_array_equal(result.record["hip_dot_z"], states.qvel[0, :, 0])
        np.testing.assert_array_equal(result.record["ground_z"], states.ground[0, :, 1])
    if "belt_x" in result.record:
        speed = 0.02 * 4 / 0.5  # that of the gait's stance
        np.testing.assert_allclose(result.record["belt_x"], -speed * result.record["time"])


@pytest.mark.parametrize("drive", ["position", "torque"])
def test_torque_is_that_of_the_servos_law(drive: str) -> None:
    settings = ["controller.name=pd"] if drive == "torque" else ["servo={kp=8.0, kd=0.05}"]
    _, result = done("air", *settings)
    u, q, v = (pair(result, name) for name in ("ctrl", "theta", "theta_dot"))
    expected = u if drive == "torque" else 8.0 * (u - q) - 0.05 * v
    np.testing.assert_allclose(pair(result, "torque"), expected, rtol=0, atol=1e-15)


def test_saturation_is_counted_in_the_window_with_the_state_at_a_steps_end() -> None:
    plan, result = done("air", "servo.limit=0.006")
    kd = plan.scenario.servo.kd
    spring = 8.0 * (pair(result, "ctrl") - pair(result, "theta"))
    clips = np.abs(spring - kd * pair(result, "theta_dot")) > 0.006
    states = simulate(plan.model, plan.start[None], plan.ctrl[None])
    np.testing.assert_array_equal(record.saturated(plan, record.Part(states, 0, plan.start)), clips)
    share = clips[plan.scenario.window].mean(axis=0)
    assert 0.05 < share.min() <= share.max() < 1.0
    assert result.metrics["load"]["saturated"] == dict(zip("AE", share.tolist(), strict=True))
    assert done("air")[1].metrics["load"]["saturated"] == {"A": 0.0, "E": 0.0}


def test_load_in_stance_is_that_of_the_steps_with_ground_force() -> None:
    plan, result = done("treadmill")
    window = plan.scenario.window
    down = result.record["ground_z"][window] > 0.0
    assert 0.2 < down.mean() < 0.98
    tau = pair(result, "torque")[window]
    rms = np.sqrt(np.mean(tau[down] ** 2, axis=0))
    measured = result.metrics["load"]["stance"]
    np.testing.assert_allclose(list(measured["torque_rms"].values()), rms)
    assert measured["share_A"] is not None


def test_load_in_stance_without_a_ground_is_that_of_the_plan() -> None:
    plan, result = done("air", GAIT)
    window = plan.scenario.window
    h = 1e-3
    cycle = ((np.arange(350) * h - 0.05) * 4 + 0.25) % 1.0  # half its ramp of 0.1 s late
    tau = pair(result, "torque")[window]
    rms = np.sqrt(np.mean(tau[(cycle < 0.5 - 1e-9)[window]] ** 2, axis=0))
    measured = result.metrics["load"]["stance"]["torque_rms"]
    np.testing.assert_allclose(list(measured.values()), rms, rtol=1e-9)
    assert "stance" not in done("air")[1].metrics["load"]


def test_phases_are_those_of_the_steps_begin() -> None:
    """The histogram over a period is `load.measure`'s of where the path is as each step begins."""
    plan, result = done("air")
    window = plan.scenario.window
    theta = np.concatenate([plan.motion.q[:1, [0, 2]], pair(result, "theta")])
    begun = result.record["time"][window] - 1e-3
    phase = np.round((begun - 0.05) * 4.0, 9) % 1.0  # half its ramp of 0.1 s late
    turned = theta[window.start : window.stop + 1]
    expected = load.measure(pair(result, "torque")[window], turned, 1e-3, phase=phase)
    measured = dict(result.metrics["load"])
    assert measured.pop("saturated") == {"A": 0.0, "E": 0.0}
    assert measured.keys() - expected.keys() == {"serial_friction", "serial_heat"}
    assert {key: measured[key] for key in expected} == expected


@pytest.mark.parametrize("kind", SCENES)
def test_metrics_are_finite_json(kind: str) -> None:
    measured = done(kind)[1].metrics
    assert json.loads(json.dumps(measured, allow_nan=False))["verdict"] == "not judged"
    assert ("ground" in measured) == (kind in ("rail", "treadmill"))


def test_every_limit_resolves_and_is_shown() -> None:
    """Of a real servo on a ground all of them, and each has a name and a unit for people."""
    measured = done("treadmill", *WHOLE_SERVO)[1].metrics
    for key in metrics.LIMIT_KEYS:
        value = metrics.look_up(measured, key)
        assert isinstance(value, (int, float)), key
        assert shown(key, value)
    assert set(SHOWN) == {*metrics.LIMIT_KEYS, *(metric.key for metric in ROBOTS)}
    limits: dict[str, tuple[float, float]] = {key: (-1e9, 1e9) for key in metrics.LIMIT_KEYS}
    judged = metrics.judge(measured, limits)
    assert [limit.key for limit in judged] == list(metrics.LIMIT_KEYS)
    assert all(limit.ok for limit in judged)


def test_undefined_metric_fails_its_limit() -> None:
    idle = ["controller.name=pd", "controller.kp=0", "controller.kd=0", "leg.gravity=[0, 0]"]
    _, still = done("air", *idle)
    assert still.metrics["load"]["share_A"] is None
    (limit,) = metrics.judge(still.metrics, {"load.share_A": (0.0, 1.0)})
    assert not limit.ok
    json.dumps(still.metrics, allow_nan=False)


# refusal


@pytest.mark.parametrize("key", metrics.GROUND_KEYS)
@pytest.mark.parametrize("kind", ["air", "payload"])
def test_refusal_of_limits_on_a_ground_that_is_not_there(kind: str, key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Scenario.load("classic-ellipse", [*SCENES[kind], f"limits.{key}=1"])
    assert str(caught.value) == (
        f"classic-ellipse: limits.{key} needs a ground: scene must be rail or treadmill, "
        f"got {kind!r}"
    )


# the command


@pytest.mark.parametrize(
    "settings",
    [
        ["scene=rail"],
        ["scene.kind=rail", "scene.drop=0.01", "scene.mass=0.3"],
        ["scene.kind=treadmill", "scene.speed=0.1"],
        ["scene=treadmill", GAIT],
        ["scene.kind=payload", "scene.mass=0.1"],
        ["scene=payload", "force.kind=constant", "force.value=[0,-5]"],
        ["scene=rail", "force.kind=constant", "force.value=[0,5]", "servo.kp=8"],
        ["scene=payload", "force.kind=csv", "force.file=push.csv"],
        ["servo=xl330"],
        ["servo.preset=xl330", "servo.kp=1.0"],
        ["controller.name=pd", "sensors.noise=1e-4", "sensors.delay=0.001", "sim.seed=3"],
    ],
)
@pytest.mark.usefixtures("light")
def test_resolved_scenario_runs_again_to_the_same_bits(shell: Shell, settings: list[str]) -> None:
    (shell.folder / "push.csv").write_text(FORCE, encoding="utf-8")
    changes = [word for setting in ["duration=0.35", *settings] for word in ("--set", setting)]
    assert shell("run", "short.toml", "--out", "one", *changes).err == ""
    (shell.folder / "push.csv").unlink()
    assert shell("run", "one/scenario.toml", "--out", "two").status == 0
    one = file_of(shell.folder / "one")
    two = file_of(shell.folder / "two")
    assert list(one) == list(two)
    for name, column in one.items():
        np.testing.assert_array_equal(column, two[name], err_msg=name)
    texts = [(shell.folder / run / "scenario.toml").read_text("utf-8") for run in ("one", "two")]
    assert texts[0] == texts[1]


@pytest.mark.usefixtures("light")
def test_csv_force_is_copied_beside_under_a_name_of_its_own(shell: Shell) -> None:
    """Also where the path's CSV has the same name."""
    folder = shell.folder
    (folder / "foot.csv").write_text(
        "time_s,x_m,z_m\n0,0,-0.08\n0.2,0.01,-0.075\n0.4,0,-0.07\n0.7,-0.01,-0.075\n"
    )
    (folder / "sub").mkdir()
    (folder / "sub" / "foot.csv").write_text(FORCE, encoding="utf-8")
    settings = ["scene=payload", "path={kind='csv', file='foot.csv', ramp=0.1}",
                "force={kind='csv', file='sub/foot.csv'}"]  # fmt: skip
    changes = [word for setting in settings for word in ("--set", setting)]
    assert shell("run", "short.toml", "--out", "run", *changes).status == 0
    table = tomllib.loads((folder / "run" / "scenario.toml").read_text("utf-8"))
    assert (table["path"]["file"], table["force"]["file"]) == ("foot.csv", "force-foot.csv")
    assert (folder / "run" / "force-foot.csv").read_text("utf-8") == FORCE


@pytest.mark.usefixtures("light")
def test_ground_is_shown_where_there_is_one(shell: Shell) -> None:
    said = shell("run", "short.toml", "--set", "scene=rail", "--out", "a").out
    assert "time in stance" in said
    assert "slip, all stances" in said
    said = shell("run", "short.toml", "--out", "b").out
    assert "stance" not in said


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["scene=treadmill"], "scene.speed is missing"),
        (["scene=payload"], "scene.mass must be in (0, inf) kg where there is no [force]"),
        (["scene=rail", "scene.drop=1001"], "scene.drop must be in [0, 1000] m, got 1001.0"),
        (["scene=rail", "scene.mass=0"], "scene.mass must be in (0, 1e+06) kg, got 0.0"),
        (["scene={}"], "[scene] needs a kind; known: air, payload, rail, treadmill"),
        (["scene=air", "scene.mass=1"], "[scene]: unknown key 'mass'; known: kind"),
        (["path.kind=hop", "path.low=0.06", "path.high=0.08", "path.thrust=0.3", "path.flight=0.3"],
         "path.kind 'hop' needs a ground"),
        (["force={kind='constant', value=[0, 5]}"], "[force] has no effect in scene 'air'"),
        (["scene=rail", "force={kind='stance', peak=[0, 5]}"], 'a force of kind "stance"'),
        (["force.value=[0, 1]"], "[force] needs a kind; known: constant, csv, stance"),
        (["controller.name=pd", "controller.period=0"], "controller.period must be in (0, inf) s"),
        (["controller.name=pd", "sensors.delay=11"], "sensors.delay must be in [0, 10] s"),
        (["scene=rail", "servo.limit=0.01"], "servo.limit cannot hold the leg at t = 0 s: motor"),
        (["leg=airhockey", "scene=rail", "path.centre=[0, 0.6]"], "leg 'airhockey' cannot stand"),
    ],
)  # fmt: skip
def test_refusal_is_one_line(shell: Shell, settings: list[str], message: str) -> None:
    changes = [word for setting in settings for word in ("--set", setting)]
    assert shell.refused("run", "short.toml", *changes).startswith(f"short.toml: {message}")


@pytest.mark.parametrize("kind", SCENES)
def test_what_the_recorder_keeps_is_what_the_record_tells(kind: str) -> None:
    """Branch, joints' heights and directions are taken of the simulated states, block by block."""
    plan, result = done(kind)
    (recorder,) = rollout._recorded([plan], 1)
    leg = plan.scenario.leg
    kept = recorder.unrecorded
    assert kept.signs is not None
    assert np.array_equal(kept.signs, branch.signs_of(leg, result.record))
    assert (kept.heights == {}) == ("ground_z" not in result.record)
    for name, height in (kept.heights or {}).items():
        assert np.array_equal(height, ground.heights_of(leg, result.record)[name])
    body = energy.Body(leg, plan.scenario.payload, plan.scenario.trunk)
    found = energy.balance(body, result.record, kept.steps)
    told = energy.balance(body, result.record, kept.steps._replace(before=None))
    assert np.array_equal(found.ground, told.ground)
    assert np.array_equal(found.step, told.step)
    assert np.array_equal(found.unaccounted, told.unaccounted)
