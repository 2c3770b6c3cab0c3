"""`fivebar export --mjcf` and `--urdf`: the same model, bit for bit, also to other programs."""

from __future__ import annotations

import ctypes
import importlib.util
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from shell import Shell

from fivebar_sim import FiveBar, Scenario, dynamics, kinematics, model, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.files import resources
from fivebar_sim.formats import mjcf, subject, urdf
from fivebar_sim.robots import Robot

LEGS = tuple(resources.shipped("models/legs"))


def reloaded(path: Path) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a model as a stock viewer has it: read from the file, in its keyframe."""
    compiled = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    mujoco.mj_forward(compiled, data)
    return compiled, data


@pytest.mark.parametrize("name", LEGS)
def test_mjcf_of_a_leg_is_the_built_model(name: str, tmp_path: Path) -> None:
    leg = FiveBar.load(name)
    place = tmp_path / "leg.xml"
    cleared = mjcf.write(subject.load(name), place)
    again, data = reloaded(place)
    # MuJoCo Warp refuses the one flag in which they differ.
    assert cleared == ["flag autoreset=disable"]
    built = model.build(leg, servo=Servo())
    assert list(mjcf.differences(built, again)) == ["disableflags"]
    assert again.opt.disableflags == 0
    assert again.names == built.names
    assert again.body_mass.tobytes() == built.body_mass.tobytes()
    gap = data.site("C_left").xpos - data.site("C_right").xpos
    assert np.abs(gap).max() < 1e-15
    np.testing.assert_array_equal(data.qpos, kinematics.home(leg))


@pytest.mark.parametrize("name", ["rail-hop", "robot-q8bot-trot", "airhockey-pd"])
def test_mjcf_of_a_scenario_is_its_model(name: str, tmp_path: Path) -> None:
    planned = rollout.plan(Scenario.load(name))
    place = tmp_path / "scenario.xml"
    mjcf.write(subject.load(name), place)
    assert list(mjcf.differences(planned.model, reloaded(place)[0])) == ["disableflags"]


def test_a_difference_is_found() -> None:
    one = model.build(FiveBar())
    other = model.build(FiveBar())
    other.body_mass[2] = np.nextafter(other.body_mass[2], 1.0)
    other.opt.timestep *= 2.0
    assert list(mjcf.differences(one, other)) == ["body_mass", "timestep"]


def test_noslip_is_cleared() -> None:
    spec = model.leg_spec(FiveBar())
    spec.option.noslip_iterations = 4
    assert mjcf.clear_for_warp(spec) == ["flag autoreset=disable", "noslip_iterations=4"]
    assert spec.compile().opt.noslip_iterations == 0


def read_urdf(name: str, folder: Path, *, robot: bool = False) -> tuple[Path, dict[str, Any]]:
    """Export to URDF; return the file and what its YAML says."""
    place = folder / "leg.urdf"
    beside = urdf.write(subject.load(name, robot=robot), place)
    return place, yaml.safe_load(beside.read_text("utf-8"))


@pytest.mark.parametrize("name", LEGS)
def test_urdf_has_the_legs_masses_limits_and_loop(name: str, tmp_path: Path) -> None:
    leg = FiveBar.load(name)
    place, said = read_urdf(name, tmp_path)
    root = ET.parse(place).getroot()
    assert said["closed_loop"] == [["C_left", "C_right"]]
    assert said["type"] == ["3d"]
    assert said["name_mot"] == ["A", "E"]
    assert said["armature"] == {"A": leg.armature, "E": leg.armature}
    assert list(said["rest"].values()) == kinematics.home(leg).tolist()
    for link, each in zip(("L1", "L2", "L3", "L4"), leg.links, strict=True):
        inertial = root.find(f"link[@name='{link}']/inertial")
        assert inertial is not None
        numbers = {e.tag: e.attrib for e in inertial}
        mass = float(numbers["mass"]["value"])
        com = [float(x) for x in numbers["origin"]["xyz"].split()]
        assert mass == pytest.approx(each.mass, rel=1e-15)
        assert com == pytest.approx([each.com[0], 0.0, each.com[1]], rel=1e-14, abs=1e-16)
        assert float(numbers["inertia"]["iyy"]) == pytest.approx(each.inertia, rel=1e-13)
    limit = root.find("joint[@name='A']/limit")
    assert limit is not None
    assert float(limit.attrib["upper"]) == pytest.approx(2.0 * np.pi, abs=1e-8)


def test_urdf_opens_in_mujoco_with_the_same_masses(tmp_path: Path) -> None:
    place, said = read_urdf("doggo", tmp_path, robot=True)
    compiled = mujoco.MjModel.from_xml_path(str(place))
    assert compiled.body_mass.sum() == pytest.approx(Robot.load("doggo").mass, rel=1e-14)
    assert len(said["closed_loop"]) == 4
    assert len(said["name_mot"]) == 8
    data = mujoco.MjData(compiled)
    for joint, angle in said["rest"].items():
        data.joint(joint).qpos[:] = angle
    mujoco.mj_forward(compiled, data)
    for one, other in said["closed_loop"]:
        np.testing.assert_allclose(data.body(one).xpos, data.body(other).xpos, atol=1e-15)


def test_command(shell: Shell) -> None:
    said = shell("export", "q8bot", "--mjcf", "leg.xml")
    assert said.status == 0
    assert "cleared for MuJoCo Warp: flag autoreset=disable" in said.out
    assert reloaded(Path("leg.xml"))[0].nu == 2
    assert shell("export", "q8bot", "--robot", "--mjcf", "robot.xml").status == 0
    assert reloaded(Path("robot.xml"))[0].nu == 8
    said = shell("export", "short.toml", "--urdf", "leg.urdf")
    assert said.status == 0
    assert "leg.closures.yaml" in said.out
    Path("mine.toml").write_text("L1 = 0.05\nL2 = 0.07\n")
    assert shell("export", "mine.toml", "--urdf", "mine.urdf").status == 0
    assert ET.parse("mine.urdf").getroot().get("name") == "mine"


def test_a_library_that_rounds_is_refused_in_one_line(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda path: ctypes.pythonapi)
    said = shell.refused("export", "classic", "--mjcf", "x.xml")
    assert "cannot write numbers with every digit" in said
    assert "x.xml" not in shell.names()


def test_refusals(shell: Shell) -> None:
    assert "did you mean 'classic'" in shell.refused("export", "clasic", "--mjcf", "x.xml")
    assert "known: doggo, minitaur, q8bot" in shell.refused(
        "export", "classic", "--robot", "--mjcf", "x.xml"
    )
    assert "must end in .xml" in shell.refused("export", "classic", "--mjcf", "x.toml")
    assert "must end in .urdf" in shell.refused("export", "classic", "--urdf", "x")
    assert "one at a time" in shell.refused("export", "classic", "--mjcf", "x.xml", "--c", "x")
    assert "--robot" in shell.refused("export", "q8bot", "--robot", "--c", "x")


# The wheel is large, and nothing but this test needs it: it is in no lock.
needs_pinocchio = pytest.mark.skipif(
    importlib.util.find_spec("pinocchio") is None, reason="pip install pin: Pinocchio is missing"
)


def pinocchio(place: Path, said: dict[str, Any]) -> Any:
    """Return a function that gives Pinocchio's accelerations of A and E.

    Its arguments are q and q_dot of (A, B, E, D) and tau of (A, E).
    """
    pin: Any = importlib.import_module("pinocchio")
    read = pin.buildModelFromUrdf(str(place))
    read.gravity.linear = np.array(said["gravity"])
    dofs = [read.joints[read.getJointId(joint)].idx_v for joint in ("A", "B", "E", "D")]
    motors = [dofs[0], dofs[2]]
    read.armature[motors] = list(said["armature"].values())
    frames = [read.frames[read.getFrameId(frame)] for frame in said["closed_loop"][0]]
    placed = [part for each in frames for part in (each.parentJoint, each.placement)]
    kind = pin.ContactType.CONTACT_3D
    closing = pin.RigidConstraintModel(kind, read, *placed, pin.ReferenceFrame.LOCAL)
    # Its bindings of C++ take no Python list here.
    closings = pin.StdVec_RigidConstraintModel()
    closings.append(closing)
    closed = pin.StdVec_RigidConstraintData()
    closed.append(closing.createData())
    data = read.createData()
    pin.initConstraintDynamics(read, data, closings, closed)

    def accelerations(q: Array, q_dot: Array, tau: Array) -> Array:
        given = np.zeros((3, 4))
        given[:2, dofs] = q, q_dot
        given[2, motors] = tau
        settings = pin.ProximalSettings(1e-14, 1e-12, 100)
        return pin.constraintDynamics(read, data, *given, closings, closed, settings)[motors]

    return accelerations


@needs_pinocchio
@pytest.mark.parametrize("name", LEGS)
def test_pinocchio_moves_the_leg_as_we_do(name: str, tmp_path: Path) -> None:
    """Pinocchio's constrained dynamics of the URDF and its YAML, against `dynamics.forward`."""
    leg = FiveBar.load(name)
    accelerations = pinocchio(*read_urdf(name, tmp_path))
    strong = 100.0 if name == "airhockey" else 1.0
    rng = np.random.default_rng(7)
    for _ in range(20):
        theta = kinematics.home(leg)[[0, 2]] + rng.uniform(-0.2, 0.2, 2)
        theta_dot = rng.uniform(-5.0, 5.0, 2)
        tau = strong * rng.uniform(-0.1, 0.1, 2)
        foot_dot = kinematics.jacobian(leg, theta) @ theta_dot
        moved = kinematics.joint_motion(leg, kinematics.forward(leg, theta), foot_dot, np.zeros(2))
        ours = dynamics.forward(leg, theta, theta_dot, tau)
        theirs = accelerations(moved[0], moved[1], tau)
        assert np.abs(theirs - ours).max() < 1e-12 * np.abs(ours).max()
