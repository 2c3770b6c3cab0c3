"""Scenes: their files alone, the legs that are built into them, and what they refuse."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, get_args

import mujoco
import numpy as np
import pytest
from fivebar_controllers.servo import Servo as Setpoint
from mujoco.batch import Batch

from fivebar_sim import dynamics, kinematics, model, rollout
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, GeometryError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics.columns import JOINTS
from fivebar_sim.paths import Line
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario, scenes
from fivebar_sim.scenario.scenes import Air, Ground, Payload, Rail, Scene, Treadmill

FILES = sorted((resources.folder("models") / "scenes").glob("*.xml"))
INTEGRATORS: tuple[Integrator, ...] = get_args(Integrator)
CLASSIC = FiveBar.load("classic")
ODD = FiveBar.load("extended")
HANGING = [
    leg
    for leg in (FiveBar.load(name) for name in resources.shipped("models/legs"))
    if leg.gravity[1] < 0.0
]
SCENES = [Air(), Payload(mass=0.2), Rail(mass=0.3, friction=0.7), Treadmill(mass=0.4, speed=0.2)]
SERVO = Servo(kp=3.0, kd=0.02, limit=0.5, friction=0.003)

SAME = {
    "body": ("mass", "inertia", "ipos", "iquat", "quat"),
    "joint": ("axis", "range", "armature", "damping", "frictionloss", "stiffness"),
    "geom": ("size", "pos", "quat", "contype", "conaffinity", "condim", "solref", "rgba"),
    "site": ("pos", "size"),
    "actuator": ("gainprm", "biasprm", "forcerange", "forcelimited", "gear"),
    "equality": ("solref", "solimp"),
}
"""What a scene leaves as it is, of every kind of part."""

LINKS = ("L1", "L2", "L3", "L4")


def loaded(file: Any) -> mujoco.MjModel:
    with model.quiet():
        return mujoco.MjModel.from_xml_path(str(file))


def at(mj: mujoco.MjModel, key: str) -> mujoco.MjData:
    data = mujoco.MjData(mj)
    mujoco.mj_resetDataKeyframe(mj, data, mj.key(key).id)
    mujoco.mj_forward(mj, data)
    return data


def gap(data: mujoco.MjData) -> float:
    return float(np.linalg.norm(data.site("C_left").xpos - data.site("C_right").xpos))


def options(mj: mujoco.MjModel) -> dict[str, Any]:
    """Return all options of a model."""
    return {name: getattr(mj.opt, name) for name in dir(mj.opt) if not name.startswith("_")}


def names(mj: mujoco.MjModel, kind: str) -> list[str]:
    counts = {"joint": "njnt", "actuator": "nu", "equality": "neq"}
    count = getattr(mj, counts.get(kind, f"n{kind}"))
    number = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    return [mujoco.mj_id2name(mj, number, i) for i in range(count)]


def assert_same(one: mujoco.MjModel, two: mujoco.MjModel, *but: str) -> None:
    """Raise unless the parts that one has are in two with the same numbers."""
    for kind, fields in SAME.items():
        for name in LINKS if kind == "body" else names(one, kind):
            for field in () if kind == "body" and name in but else fields:
                ours, theirs = (getattr(getattr(mj, kind)(name), field) for mj in (one, two))
                np.testing.assert_array_equal(theirs, ours, err_msg=f"{kind} {name} {field}")
    for body in LINKS:
        np.testing.assert_array_equal(two.body(body).pos, one.body(body).pos)
    np.testing.assert_array_equal(two.tendon_range, one.tendon_range)
    assert one.nexclude == two.nexclude == 1


def raised(spec: mujoco.MjSpec, leg: FiveBar) -> mujoco.MjSpec:
    """Return the leg alone, whose hip frame is the world's, as high over its floor as in air."""
    height = model.HIP_HEIGHT * leg.size
    np.testing.assert_allclose(spec.geom("floor").pos, [0.0, 0.0, -height], rtol=1e-15)
    spec.body("hip").pos = (0.0, 0.0, height)
    spec.geom("floor").pos = (0.0, 0.0, 0.0)
    return spec


def scene_id(scene: Scene) -> str:
    return scene.kind


def leg_id(leg: FiveBar) -> str:
    return leg.name


@cache
def held(*settings: str) -> Result:
    """Return a run that holds the classic leg's foot aside, until it is at rest."""
    at_rest = ["path.kind=step", "path.start=[0.01, -0.07]", "path.stop=[0.01, -0.07]"]
    shape = ["path.lift=0", "path.seconds=0.5", "path.ramp=0", "servo.kp=50", "servo.kd=0.3"]
    return rollout.run(Scenario.load("classic-ellipse", [*settings, *at_rest, *shape]))


# law


def test_every_scene_has_its_file_and_every_file_its_scene() -> None:
    assert [file.stem for file in FILES] == sorted(scenes.KINDS)
    assert all(scenes.named(kind).kind == kind for kind in scenes.KINDS)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_file_loads_alone_and_is_the_classic_leg(file: Any) -> None:
    mj = loaded(file)
    leg = loaded(resources.folder("models") / "leg.xml")
    assert {n: str(v) for n, v in options(mj).items()} == {
        n: str(v) for n, v in options(leg).items()
    }
    assert_same(leg, mj)
    for kind in SAME:
        assert all(names(mj, kind)), kind


@pytest.mark.parametrize("kind", ["rail", "treadmill"])
def test_file_of_a_ground_stands_in_its_keyframe(kind: str) -> None:
    mj = loaded(resources.folder("models") / "scenes" / f"{kind}.xml")
    data = at(mj, "stand")
    assert gap(data) < 1e-12
    assert data.site("foot").xpos[2] == pytest.approx(CLASSIC.foot_radius, abs=1e-12)
    assert data.joint("hip_z").qpos[0] == pytest.approx(data.site("hip").xpos[2], abs=1e-15)
    mj.geom_surfacevel[:] = 0.0
    for _ in range(1000):
        mujoco.mj_step(mj, data)
    # the contact is soft: the ball sinks in by 0.82 mm under 5 N
    assert data.site("foot").xpos[2] == pytest.approx(CLASSIC.foot_radius, abs=0.9e-3)
    # and the servos give way by tau / kp, some 0.14 N m of 8 N m/rad
    assert abs(data.joint("hip_z").qpos[0] - 0.0775) < 3e-3
    assert np.abs(data.qvel).max() < 1e-3
    assert sum(data.warning.number) == 0


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("scene", SCENES, ids=scene_id)
def test_options_are_the_legs(scene: Scene, integrator: Integrator) -> None:
    spec = model.leg_spec(ODD, servo=SERVO, integrator=integrator, timestep=5e-4)
    built = model.build(ODD, servo=SERVO, scene=scene, integrator=integrator, timestep=5e-4)
    for name, value in options(spec.compile()).items():
        np.testing.assert_array_equal(getattr(built.opt, name), value, err_msg=name)
    assert not built.opt.disableflags & ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


@pytest.mark.parametrize("scene", SCENES, ids=scene_id)
@pytest.mark.parametrize("leg", HANGING, ids=leg_id)
def test_leg_keeps_its_numbers(leg: FiveBar, scene: Scene) -> None:
    alone = raised(model.leg_spec(leg, servo=SERVO), leg).compile()
    built = model.build(leg, servo=SERVO, scene=scene)
    assert_same(alone, built, *(["L2"] if isinstance(scene, Payload) else []))
    np.testing.assert_array_equal(built.qpos0[-4:], alone.qpos0)
    assert [built.joint(built.njnt - 4 + i).name for i in range(4)] == list(JOINTS)
    assert [built.actuator(built.nu - 2 + i).name for i in range(2)] == ["A", "E"]


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_air_gives_the_bits_of_the_leg_alone(integrator: Integrator) -> None:
    """Another file, the same sums: attached to the scene the leg is compiled as in its own file."""
    runs = []
    t = np.arange(600)[:, None] * 1e-3
    for spec in (
        raised(model.leg_spec(ODD, servo=SERVO, integrator=integrator), ODD),
        model.leg_spec(ODD, servo=SERVO, scene=Air(), integrator=integrator),
    ):
        with model.quiet():
            mj = spec.compile()
        home = kinematics.home(ODD)
        ctrl = home[[0, 2]] + 0.2 * np.sin(20.0 * t + [0.0, 0.7])
        batch = Batch(mj, 1, 1)
        batch.qpos = home[None]
        runs.append(batch.rollout(600, ctrl[None], record=("qpos", "qvel", "qfrc_constraint")))
    assert np.ptp(runs[0]["qpos"], axis=1).max() > 0.1
    for name, values in runs[0].items():
        np.testing.assert_array_equal(values, runs[1][name], err_msg=str(name))


@pytest.mark.parametrize("scene", SCENES, ids=scene_id)
@pytest.mark.parametrize("leg", HANGING, ids=leg_id)
def test_home_is_closed_and_on_the_floor(leg: FiveBar, scene: Scene) -> None:
    mj = model.build(leg, scene=scene)
    data = at(mj, "home")
    home = kinematics.home(leg)
    height = float(data.site("hip").xpos[2])
    assert gap(data) < 1e-14 * leg.size / 0.1
    np.testing.assert_array_equal(data.qpos[-4:], home)
    np.testing.assert_array_equal(data.ctrl, [*[0.0] * (mj.nu - 2), home[0], home[2]])
    bottom = float(data.site("foot").xpos[2]) - leg.foot_radius
    if isinstance(scene, Ground):
        assert data.qpos[0] == pytest.approx(height, abs=1e-15)
        assert bottom == pytest.approx(0.0, abs=1e-15)
        stand = at(mj, "stand")
        np.testing.assert_array_equal(stand.qpos, data.qpos)
        np.testing.assert_array_equal(stand.ctrl, data.ctrl)
        assert mj.body("trunk").mass == scene.mass
        assert mj.geom("foot").friction[0] == scene.friction
    else:
        assert bottom > 0.0
        assert height > leg.size + leg.foot_radius


@pytest.mark.parametrize("leg", HANGING, ids=leg_id)
def test_payload_is_the_point_mass_of_dynamics(leg: FiveBar) -> None:
    """Kinetic energy of all the bodies = theta_dot' M theta_dot / 2 of the closed chain."""
    mj = model.build(leg, scene=Payload(mass=0.2))
    q = kinematics.home(leg)
    foot = kinematics.forward(leg, q[::2])
    M = np.zeros((4, 4))
    data = mujoco.MjData(mj)
    data.qpos[:] = q
    mujoco.mj_forward(mj, data)
    mujoco.mj_fullM(mj, data, M)
    for velocity in ([0.3, 0.0], [0.0, 0.4], [0.2, -0.5]):
        rate = kinematics.joint_motion(leg, foot, velocity, [0.0, 0.0]).q_dot
        inertia = dynamics.mass_matrix(leg, q[::2], payload=0.2)
        assert rate @ M @ rate == pytest.approx(rate[::2] @ inertia @ rate[::2], rel=1e-12)


# oracle


@pytest.mark.parametrize(
    ("settings", "payload", "force"),
    [
        (("scene={kind='payload', mass=0.15}",), 0.15, (0.0, 0.0)),
        (("scene=payload", "force={kind='constant', value=[1.5, -4.0]}"), 0.0, (1.5, -4.0)),
        (
            ("scene={kind='payload', mass=0.05}", "force={kind='constant', value=[-2.0, 3.0]}"),
            0.05,
            (-2.0, 3.0),
        ),
    ],
)
def test_load_of_a_held_foot_is_that_of_statics(
    settings: tuple[str, ...], payload: float, force: tuple[float, float]
) -> None:
    record = held(*settings).record
    theta, torque = (
        np.array([record[f"{name}_{side}"][-1] for side in "AE"]) for name in ("theta", "torque")
    )
    zero = np.zeros(2)
    expected = dynamics.inverse(CLASSIC, theta, zero, zero, force, payload=payload)
    assert np.abs(expected).max() > 0.02
    # the loop's gap at C, 1 um of 60 mm, turns the links by that much
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("leg", "high", "low"),
    [
        (replace(CLASSIC, mode=(1, -1), assembly=1), -0.075, -0.08),
        (FiveBar(0.02, 0.1, 0.05, 0.09, 0.03, tilt=1.57), -0.096, -0.1),
    ],
    ids=["upside down", "tilted"],
)
def test_leg_whose_rest_pose_is_above_its_hip_stands_where_it_hangs(
    leg: FiveBar, high: float, low: float
) -> None:
    assert kinematics.chain_points(leg, kinematics.home(leg)).F[1] > 0.0
    mj = model.build(leg, scene="rail")
    data = at(mj, "home")
    foot = data.geom("foot").xpos[2] - leg.foot_radius
    assert foot == pytest.approx(0.0, abs=1e-12)
    squat = Scenario(
        name="squat",
        leg=leg,
        path=Line(start=(0.0, high), stop=(0.0, low), frequency=1.0),
        controller=Setpoint(feedforward="torque"),
        controller_name="servo",
        scene=Rail(mass=0.3),
        duration=1.5,
    )
    result = rollout.run(squat)
    assert result.verdict == "not judged"
    assert result.metrics["tracking"]["rms"] < 1e-3


# refusal


@pytest.mark.parametrize("scene", ["rail", "treadmill"])
def test_refusal_of_a_leg_that_cannot_stand(scene: str) -> None:
    upward = FiveBar(0.02, 0.09, 0.09, 0.02, 0.05, 0.02, 2.0, assembly=1, name="upward")
    with pytest.raises(GeometryError, match=r"^leg 'upward' cannot stand: its foot must be below"):
        model.build(upward, scene=scene)
    settings = ["leg=airhockey", "path.centre=[0, 0.6]", f"scene={{kind='{scene}'}}"]
    settings += ["scene.speed=0.0"] if scene == "treadmill" else []
    with pytest.raises(GeometryError) as caught:
        rollout.plan(Scenario.load("classic-ellipse", settings))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("{kind='rail', mass=0}", r"scene.mass must be in \(0, 1e\+06\) kg, got 0.0"),
        ("{kind='rail', drop=-0.1}", r"scene.drop must be in \[0, 1000\] m, got -0.1"),
        ("{kind='rail', friction=-1}", r"scene.friction must be in \[0, 100\], got -1.0"),
        ("{kind='rail', speed=1}", r"\[scene\]: unknown key 'speed'"),
        ("{kind='treadmill', speed=1001}", r"scene.speed must be in \[-1000, 1000\] m/s"),
        ("treadmill", "scene.speed is missing: only a gait path says"),
        ("payload", r"scene.mass must be in \(0, inf\) kg where there is no \[force\]"),
        ("{kind='payload', mass=-1}", r"scene.mass must be in \[0, 1e\+06\] kg, got -1.0"),
        ("rails", r"unknown scene 'rails'; known: .* \(did you mean 'rail'\?\)"),
        ("{mass=1}", r"\[scene\] needs a kind; known: air, payload, rail, treadmill"),
    ],
)
def test_refusal_names_the_key(keys: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^classic-ellipse: {message}"):
        Scenario.load("classic-ellipse", [f"scene={keys}"])


def test_refusal_of_an_unknown_scene() -> None:
    with pytest.raises(ArgumentError, match="unknown scene 'moon'; known: air, payload"):
        scenes.named("moon")


def test_rail_that_ends_above_the_hip_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"^scene\.stop must be in \[0, 0\.136\] m, the hip's h"):
        rollout.plan(Scenario.load("rail-landing", ["scene.stop=1"]))
