"""leg.xml as it is, and the models that are made from it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim import kinematics, model
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import JOINTS
from fivebar_sim.scenario.scenes import Rail

LEGS = {name: FiveBar.load(name) for name in resources.shipped("models/legs")}
ODD = LEGS["extended"]
FILE = resources.folder("models") / "leg.xml"


@pytest.fixture(params=LEGS)
def leg(request: pytest.FixtureRequest) -> FiveBar:
    return LEGS[request.param]


def at_home(mj: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(mj)
    mujoco.mj_resetDataKeyframe(mj, data, mj.key("home").id)
    mujoco.mj_forward(mj, data)
    return data


def gap(data: mujoco.MjData) -> float:
    return float(np.linalg.norm(data.site("C_left").xpos - data.site("C_right").xpos))


def test_file_stands_at_home() -> None:
    mj = mujoco.MjModel.from_xml_path(str(FILE))
    data = at_home(mj)
    assert gap(data) < 1e-12
    np.testing.assert_array_equal(mj.qpos0, data.qpos)
    before = data.site("foot").xpos.copy()
    for _ in range(2000):
        mujoco.mj_step(mj, data)
    assert np.linalg.norm(data.site("foot").xpos - before) < 0.2e-3
    assert gap(data) < 1e-6
    assert sum(data.warning.number) == 0


def in_bytes(mj: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(mj), np.uint8)
    mujoco.mj_saveModel(mj, None, buffer)
    return buffer.tobytes()


def test_built_model_is_the_caller_s_own() -> None:
    """It is built once; who changes it changes nobody else's."""
    changed = model.build(ODD, servo=Servo(), scene="rail")
    changed.opt.timestep = 1.0
    changed.body_mass[:] = 0.0
    again = model.build(ODD, servo=Servo(), scene="rail")
    with model.quiet():
        compiled = model.leg_spec(ODD, servo=Servo(), scene=Rail()).compile()
    assert in_bytes(again) == in_bytes(compiled) != in_bytes(changed)


def test_file_is_the_classic_leg() -> None:
    """Every number of the file, but none of its joint stops' last digits."""
    file = mujoco.MjModel.from_xml_path(str(FILE))
    built = model.build(FiveBar.load("classic"), servo=Servo())
    compared = 0
    for field in dir(file):
        ours = getattr(built, field)
        theirs = getattr(file, field)
        if isinstance(theirs, np.ndarray) and theirs.dtype.kind == "f":
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-9, err_msg=field)
            compared += 1
    assert compared > 150
    for option in dir(file.opt):
        if not option.startswith("_"):
            np.testing.assert_array_equal(getattr(built.opt, option), getattr(file.opt, option))


def test_a_leg_leaves_nothing_in_the_next_one() -> None:
    """The files are parsed once; what is built changes a copy."""
    for scene in ("air", "payload", "rail"):
        first = content(model.build(ODD, scene=scene))
        model.build(LEGS["classic"], scene=scene, drive="torque", timestep=2e-3)
        assert content(model.build(ODD, scene=scene)) == first


def content(mj: mujoco.MjModel) -> bytes:
    whole = np.empty(mujoco.mj_sizeModel(mj), dtype=np.uint8)
    mujoco.mj_saveModel(mj, None, whole)
    return whole.tobytes()


def test_every_part_is_named() -> None:
    mj = mujoco.MjModel.from_xml_path(str(FILE))
    kinds = {"body": mj.nbody, "jnt": mj.njnt, "geom": mj.ngeom, "site": mj.nsite, "cam": mj.ncam,
             "light": mj.nlight, "eq": mj.neq, "tendon": mj.ntendon, "actuator": mj.nu,
             "sensor": mj.nsensor, "key": mj.nkey, "mat": mj.nmat,
             "exclude": mj.nexclude}  # fmt: skip
    objects = {"jnt": "joint", "cam": "camera", "eq": "equality", "mat": "material"}
    for kind, count in kinds.items():
        assert count > 0, kind
        number = getattr(mujoco.mjtObj, f"mjOBJ_{objects.get(kind, kind).upper()}")
        names = [mujoco.mj_id2name(mj, number, i) for i in range(count)]
        assert all(names), kind
    assert [mj.joint(i).name for i in range(4)] == list(JOINTS)
    assert [mj.actuator(i).name for i in range(2)] == ["A", "E"]


def test_home_is_closed_and_reads_the_kinematics(leg: FiveBar) -> None:
    mj = model.build(leg)
    data = at_home(mj)
    assert gap(data) < 1e-14 * leg.size / 0.1
    q = kinematics.home(leg)
    np.testing.assert_array_equal(data.qpos, q)
    np.testing.assert_array_equal(data.ctrl, q[[0, 2]])
    assert mj.tendon_range[0, 0] < data.ten_length[0] < mj.tendon_range[0, 1]
    for name, angle in zip(JOINTS, q, strict=True):
        assert mj.joint(name).range[0] < angle < mj.joint(name).range[1]


def test_forward_kinematics_is_mujocos(leg: FiveBar, rng: np.random.Generator) -> None:
    """At open poses too: both chains, with every sign of every angle."""
    mj = model.build(leg)
    data = mujoco.MjData(mj)
    for q in rng.uniform(-np.pi, np.pi, (20, 4)):
        data.qpos[:] = q
        mujoco.mj_forward(mj, data)
        points = kinematics.chain_points(leg, q)
        hip = data.body("hip").xpos
        found = {"C_left": points.C_left, "C_right": points.C_right, "foot": points.F}
        for site, expected in found.items():
            ours = (data.site(site).xpos - hip)[[0, 2]]
            np.testing.assert_allclose(ours, expected, atol=1e-14 * leg.size / 0.1 + 1e-15)
        np.testing.assert_allclose((data.body("L2").xpos - hip)[[0, 2]], points.B, atol=1e-14)
        np.testing.assert_allclose((data.body("L3").xpos - hip)[[0, 2]], points.D, atol=1e-14)
        np.testing.assert_allclose(data.sensor("foot").data[[0, 2]], points.F, atol=1e-14)


def test_inertias_are_the_legs(leg: FiveBar) -> None:
    mj = model.build(leg)
    for name, link in zip(("L1", "L2", "L3", "L4"), leg.links, strict=True):
        body = mj.body(name)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, body.iquat)
        R = rotation.reshape(3, 3)
        I_y = (R @ np.diag(body.inertia) @ R.T)[1, 1]
        np.testing.assert_allclose(body.mass, link.mass, rtol=1e-12)
        np.testing.assert_allclose(body.ipos, [link.com[0], 0, link.com[1]], atol=1e-12)
        np.testing.assert_allclose(I_y, link.inertia, rtol=1e-12)
    assert mj.joint("A").armature == mj.joint("E").armature == leg.armature
    assert mj.joint("B").armature == mj.joint("D").armature == 0.0
    np.testing.assert_array_equal(mj.opt.gravity, [leg.gravity[0], 0.0, leg.gravity[1]])


def test_servo_is_what_was_asked(leg: FiveBar) -> None:
    ideal = model.build(leg)
    driven = model.build(leg, servo=Servo(kp=3.0, kd=0.02, limit=0.5))
    for name in ("A", "E"):
        assert ideal.joint(name).damping == 0.0
        assert not ideal.actuator(name).forcelimited
        assert driven.joint(name).damping == 0.0
        assert driven.actuator(name).gainprm[0] == 3.0
        np.testing.assert_array_equal(driven.actuator(name).biasprm[:3], [0.0, -3.0, -0.02])
        np.testing.assert_array_equal(driven.actuator(name).forcerange, [-0.5, 0.5])
        assert driven.actuator(name).forcelimited
    assert driven.joint("B").damping == driven.joint("D").damping == 0.0


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_two_legs_attach_to_one_body(integrator: model.Integrator) -> None:
    alone = model.build(ODD, servo=Servo(limit=1.0), integrator=integrator, timestep=5e-4)
    parent = model.leg_spec(ODD, servo=Servo(limit=1.0), integrator=integrator, timestep=5e-4)
    body = parent.worldbody.add_body(name="trunk", pos=(0, 0, 1))
    for prefix, x in (("FL_", 0.1), ("RL_", -0.1)):
        leg = model.leg_spec(ODD, servo=Servo(limit=1.0), integrator=integrator, timestep=5e-4)
        body.add_frame(pos=(x, 0, 0)).attach_body(leg.body("hip"), prefix, "")
    parent.delete(parent.body("hip"))
    parent.delete(parent.key("home"))
    both = parent.compile()
    for option in dir(alone.opt):
        if not option.startswith("_"):
            np.testing.assert_array_equal(getattr(both.opt, option), getattr(alone.opt, option))
    assert (both.nq, both.nu, both.neq, both.ntendon) == (8, 4, 2, 2)
    np.testing.assert_array_equal(both.tendon_range, alone.tendon_range.repeat(2, axis=0))
    for prefix in ("FL_", "RL_"):
        assert both.tendon(f"{prefix}C_angle").id >= 0
        for kind in ("body", "joint", "geom", "site", "actuator", "equality", "sensor"):
            for i in range(getattr(alone, COUNT[kind])):
                name = getattr(alone, kind)(i).name
                if name in ("world", "floor"):
                    continue
                one = getattr(alone, kind)(name)
                two = getattr(both, kind)(prefix + name)
                for field in SAME[kind]:
                    np.testing.assert_array_equal(getattr(one, field), getattr(two, field))


def test_hip_frame_is_where_a_leg_is_attached(leg: FiveBar) -> None:
    """Every link and the foot are where the kinematics puts them, seen from the site."""
    parent = mujoco.MjSpec()
    trunk = parent.worldbody.add_body(name="trunk", pos=(0.3, -0.2, 1.0))
    site = trunk.add_site(name="shoulder", pos=(0.1, 0.04, -0.02))
    with model.quiet():  # the parent has its own options
        parent.attach(model.leg_spec(leg), site=site, prefix="FL_")
        mj = parent.compile()
    data = mujoco.MjData(mj)
    data.qpos[:] = kinematics.home(leg)
    mujoco.mj_kinematics(mj, data)

    hip = data.body("FL_hip").xpos
    np.testing.assert_allclose(hip, data.site("shoulder").xpos, atol=1e-12)
    np.testing.assert_allclose(hip, [0.4, -0.16, 0.98], atol=1e-12)
    points = kinematics.chain_points(leg, kinematics.home(leg))
    np.testing.assert_allclose((data.site("FL_foot").xpos - hip)[[0, 2]], points.F, atol=1e-12)


def test_leg_alone_hangs_over_its_floor_as_in_the_air(leg: FiveBar) -> None:
    alone = model.leg_spec(leg).compile()
    air = model.build(leg)
    heights = [mj.body("hip").pos[2] - mj.geom("floor").pos[2] for mj in (alone, air)]
    assert heights[0] == pytest.approx(heights[1], rel=1e-15)
    np.testing.assert_array_equal(alone.body("hip").pos, 0.0)


COUNT = {"body": "nbody", "joint": "njnt", "geom": "ngeom", "site": "nsite", "actuator": "nu",
         "equality": "neq", "sensor": "nsensor"}  # fmt: skip
SAME = {
    "body": ("mass", "inertia"),
    "joint": ("axis", "range", "armature", "damping", "qpos0"),
    "geom": ("size", "contype", "conaffinity", "condim", "friction", "rgba"),
    "site": ("size",),
    "actuator": ("gainprm", "biasprm", "forcerange", "ctrlrange"),
    "equality": ("solref", "solimp", "data"),
    "sensor": ("type", "dim"),
}


def test_only_the_foot_touches(leg: FiveBar) -> None:
    mj = model.build(leg)
    touching = [mj.geom(i).name for i in range(mj.ngeom) if mj.geom(i).contype]
    assert touching == ["foot"]
    assert [mj.geom(i).name for i in range(mj.ngeom) if mj.geom(i).conaffinity] == ["floor"]


def test_hip_is_out_of_the_floors_reach(leg: FiveBar) -> None:
    assert model.build(leg).body("hip").pos[2] > leg.size + leg.foot_radius


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"scene": "moon"}, "unknown scene 'moon'; known: air"),
        ({"integrator": "Euler"}, "unknown integrator 'Euler'; known: discrete, implicitfast"),
        ({"timestep": 0.0}, r"timestep must be in \(0, inf\) s, got 0\.0"),
        ({"timestep": float("nan")}, "timestep must be"),
    ],
)
def test_refusal(keywords: dict, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        model.build(ODD, **keywords)


def test_models_do_not_change_each_other() -> None:
    """The file is read once: each model is made of a copy."""
    before = model.build(LEGS["classic"])
    changed = model.leg_spec(LEGS["classic"], scene=Rail())
    changed.body("L1").pos[0] += 0.01
    changed.option.timestep = 0.5
    after = model.build(LEGS["classic"])
    for other in LEGS.values():
        model.build(other, scene="rail", timestep=2e-3)
    again = model.build(LEGS["classic"])
    for mj in (after, again):
        assert mj.opt.timestep == before.opt.timestep
        assert np.array_equal(mj.body_pos, before.body_pos)
        assert np.array_equal(mj.body_mass, before.body_mass)
