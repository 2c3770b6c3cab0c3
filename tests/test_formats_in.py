"""`fivebar import`: a leg with the kinematics and masses of another program's model."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from fivebar_sim import FiveBar, dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, GeometryError
from fivebar_sim.files import resources
from fivebar_sim.formats import mjcf, subject, urdf
from fivebar_sim.formats.incoming import preset
from fivebar_sim.formats.incoming.understood import Understood, understand
from fivebar_sim.geometry import MODES

LONG = pytest.mark.long
LEGS = tuple(resources.shipped("models/legs"))
SOURCES = Path(__file__).parent / "sources"

EXACT = ("mode", "assembly", "radius", "foot_radius", "armature", "gravity")
MEASURED = ("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt")


class Expected(NamedTuple):
    """What a file in tests/sources is, worked out by hand.

    Attributes:
        lengths: L1 to L6 [mm].
        mass: Of L1 to L4 [g].
        com: Along L1 to L4 [mm].
        foot: The body and the place in it that is the foot.
        hinges: The motors A and E.
        plane: Forward and up in the world.
        mode: Working mode and assembly mode.
    """

    lengths: tuple[float, ...]
    mass: tuple[float, ...]
    com: tuple[float, ...]
    foot: tuple[str, tuple[float, float, float]]
    hinges: tuple[str, str]
    plane: tuple[str, str] = ("x", "z")
    mode: tuple[int, int, int] = (-1, 1, -1)


Q8BOT = (25.0, 40.0, 40.0, 25.0, 19.5, 0.0)
DOGGO = (90.0, 162.0, 162.0, 90.0, 0.0, 0.0)
MINITAUR = (112.0, 199.0, 199.0, 112.0, 0.0, 32.5)
HOCKEY = (335.0, 602.5, 602.5, 335.0, 492.5, 0.0)
INFANTRY = (150.0, 270.0, 270.0, 150.0, 150.0, 0.0)
BARS = ((48.0, 124.0, 124.0, 48.0), (163.0, 450.0, 450.0, 163.0))
UPRIGHT = (1, -1, 1)
# The wheel at the hub: (0.21 kg at 120 mm, 0.3 kg at 270 mm).
CALF = (0.21 * 120.0 + 0.3 * 270.0) / 0.51

FILES = {
    "q8bot.xml": Expected(
        Q8BOT,
        (0.75, 1.8, 1.0, 0.75),
        (12.5, (20.0 + 0.8 * 40.0) / 1.8, 20.0, 12.5),
        ("rear_rod", (0.04, 0.0, 0.0)),
        ("rear_servo", "front_servo"),
    ),
    "q8bot.urdf": Expected(
        Q8BOT,
        (1.2, 2.1, 1.9, 1.2),
        (12.5, 21.0, 20.0, 12.5),
        ("rear_rod", (0.04, 0.0, 0.0)),
        ("rear_motor", "front_motor"),
    ),
    "doggo.xml": Expected(
        DOGGO,
        (50.0, 60.0, 61.0, 52.0),
        (43.0, 79.0, 81.0, 41.0),
        ("shin_0", (0.0, 0.162, 0.0)),
        ("motor_1", "motor_0"),
        ("y", "z"),
    ),
    "doggo.urdf": Expected(
        DOGGO,
        (50.0, 60.0, 61.0, 52.0),
        (43.0, 79.0, 81.0, 41.0),
        ("ankle_1", (0.0, 0.0, 0.0)),
        ("coxa_2", "coxa_1"),
        ("y", "z"),
    ),
    # Capsules of 1100 kg/m^3: the foot pad, the bushing and the bracket are lumped.
    "minitaur.xml": Expected(
        MINITAUR,
        (18.384848289858696, 40.86395228230388, 25.752263300006256, 14.928848289858698),
        (49.23268824205519, 146.52651183173, 99.5, 56.0),
        ("pad", (0.0, 0.0, 0.0)),
        ("motor_l", "motor_r"),
    ),
    "minitaur.urdf": Expected(
        MINITAUR,
        (34.0, 72.0, 50.0, 33.0),
        (50.0, (70.0 * 110.0 + 2.0 * 199.0) / 72.0, 100.0, 55.0),
        ("toe", (0.0, 0.0, 0.0)),
        ("mot_l", "mot_r"),
    ),
    "airhockey.xml": Expected(
        HOCKEY, *BARS, ("bar_2", (0.6025, 0, 0)), ("drive_1", "drive_4"), ("x", "y"), UPRIGHT
    ),
    "airhockey.urdf": Expected(
        HOCKEY, *BARS, ("wrist_2", (0.0, 0, 0)), ("drive_1", "drive_4"), ("x", "y"), UPRIGHT
    ),
    "infantry.xml": Expected(
        INFANTRY,
        (190.0, 200.0, 510.0, 230.0),
        (75.0, 130.0, CALF, (0.19 * 75.0 + 0.04 * 30.0) / 0.23),
        ("calf_rear", (0.27, 0.0, 0.0)),
        ("hip_rear", "hip_front"),
        ("y", "z"),
    ),
    "infantry.urdf": Expected(
        INFANTRY,
        (190.0, 200.0, 510.0, 230.0),
        (75.0, 130.0, CALF, 70.0),
        ("hub_r", (0.0, 0.0, 0.0)),
        ("hip_r", "hip_f"),
    ),
    "chain.xml": Expected(
        (60.0, 70.0, 80.0, 50.0, 40.0, 0.0),
        (12.0, 18.0, 20.0, 10.0),
        (35.0, 40.0, 40.0, 20.0),
        ("c", (0.0, 0.0, 0.0)),
        ("j5", "j1"),
    ),
}
"""Five public legs' numbers, each by hand as MJCF and as URDF, and a chain that a weld closes; the
files say where they are from."""


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("suffix", [".xml", ".urdf"])
def test_an_exported_leg_comes_back(name: str, suffix: str, tmp_path: Path) -> None:
    leg = FiveBar.load(name)
    place = tmp_path / f"{name}{suffix}"
    (mjcf if suffix == ".xml" else urdf).write(subject.load(name), place)
    seen = understand(place)
    (tmp_path / "again.toml").write_text(preset.text(seen), "utf-8")
    back = FiveBar.load(tmp_path / "again.toml")
    assert seen.notes == ()
    assert [getattr(back, key) for key in EXACT] == [getattr(leg, key) for key in EXACT]
    for key in MEASURED:
        assert getattr(back, key) == pytest.approx(getattr(leg, key), rel=1e-12, abs=1e-15), key
    for ours, theirs in zip(leg.links, back.links, strict=True):
        assert theirs.mass == pytest.approx(ours.mass, rel=1e-15)
        assert theirs.com == pytest.approx(ours.com, rel=1e-12, abs=1e-14 * leg.size)
        assert theirs.inertia == pytest.approx(ours.inertia, rel=1e-12)


def drawn(rng: np.random.Generator) -> FiveBar:
    """Return a leg with every number drawn, that some pose closes."""
    while True:
        # None of the four can be longer than the others together.
        lengths = rng.uniform(0.07, 0.2, 4).tolist()
        along = rng.uniform(-0.1, 0.2, 4).tolist()
        across = rng.uniform(-0.05, 0.05, 4).tolist()
        leg = FiveBar(
            *lengths,
            L5=float(rng.choice([0.0, 0.07])),
            L6=float(rng.choice([0.0, 0.04])),
            tilt=float(rng.uniform(-1.5, 1.5)),
            mode=MODES[rng.integers(4)],
            assembly=int(rng.choice([-1, 1])),
            mass=tuple(rng.uniform(0.001, 1.0, 4).tolist()),
            com=tuple(along),
            com_across=tuple(across),
            inertia=tuple((10.0 ** rng.uniform(-8.0, -3.0, 4)).tolist()),
            gravity=tuple(rng.uniform(-10.0, 10.0, 2).tolist()),
        )
        leg = dataclasses.replace(
            leg,
            # Undefined where there is nothing that it turns.
            bend=float(rng.uniform(-3.0, 3.0)) if leg.L6 else 0.0,
            tilt=leg.tilt if leg.L5 else 0.0,
        )
        try:
            kinematics.home(leg)
        except GeometryError:
            continue
        return leg


@pytest.mark.parametrize("count", [pytest.param(2, id="few"), pytest.param(300, marks=LONG)])
def test_any_leg_comes_back(count: int, tmp_path: Path) -> None:
    """In every mode, tilted, with gravity anywhere and centres off the lines; A and E by name."""
    rng = np.random.default_rng(20)
    for _ in range(count):
        leg = drawn(rng)
        what = dataclasses.replace(subject.load("classic"), leg=leg)
        for writer, name in ((mjcf, "leg.xml"), (urdf, "leg.urdf")):
            writer.write(what, tmp_path / name)
            back = understand(tmp_path / name, motors=("A", "E"), foot_name="foot").leg
            assert (back.mode, back.assembly) == (leg.mode, leg.assembly)
            for key in (*MEASURED, "com", "com_across", "gravity"):
                wanted = pytest.approx(getattr(leg, key), rel=1e-11, abs=1e-12)
                assert getattr(back, key) == wanted, key
            assert back.mass == leg.mass
            assert back.inertia == pytest.approx(leg.inertia, rel=1e-11)


def test_a_robots_leg_is_taken_by_its_loop(tmp_path: Path) -> None:
    place = tmp_path / "robot.xml"
    mjcf.write(subject.load("q8bot", robot=True), place)
    leg = subject.load("q8bot", robot=True).leg
    for loop in ("FL_C", "RR_C"):
        back = understand(place, loop_name=loop).leg
        assert [back.L1, back.L2, back.L5] == pytest.approx([leg.L1, leg.L2, leg.L5], rel=1e-12)
        # Of a leg that is turned about, A and E have changed places.
        assert (back.mode, back.assembly, back.tilt) == ((-1, 1), -1, 0.0)


@pytest.mark.parametrize("file", FILES)
def test_a_public_leg_is_understood(file: str) -> None:
    right = FILES[file]
    leg = understand(SOURCES / file).leg
    lengths = [1e3 * getattr(leg, f"L{k}") for k in range(1, 7)]
    assert lengths == pytest.approx(right.lengths, rel=1e-12, abs=1e-12)
    assert [1e3 * link.mass for link in leg.links] == pytest.approx(right.mass, rel=1e-14)
    assert [1e3 * link.com[0] for link in leg.links] == pytest.approx(right.com, rel=1e-12)
    assert (*leg.mode, leg.assembly) == right.mode
    assert (leg.tilt, leg.bend) == (0.0, 0.0)


def test_the_air_hockey_study_is_the_preset() -> None:
    preset = FiveBar.load("airhockey")
    for file in ("airhockey.xml", "airhockey.urdf"):
        leg = understand(SOURCES / file).leg
        assert [link.inertia for link in leg.links] == pytest.approx(preset.inertia, rel=1e-14)
        assert leg.gravity == preset.gravity


class Moved:
    """A source in MuJoCo alone, with its motors at some angles and its loop closed."""

    def __init__(self, seen: Understood) -> None:
        spec = mujoco.MjSpec.from_file(str(seen.source.path))
        if seen.source.path.suffix == ".urdf":
            spec.compiler.fusestatic = False
            self._close(spec, seen)
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.loop = [k for k in seen.loop.hinges if k >= 0]
        self.driven = [self.model.joint(k).dofadr[0] for k in (self.loop[0], self.loop[-1])]
        dofs = [int(self.model.jnt_dofadr[k]) for k in self.loop]
        self.passive = [dof for dof in dofs if dof not in self.driven]

    @staticmethod
    def _close(spec: mujoco.MjSpec, seen: Understood) -> None:
        """Close the loop of a URDF, between sites at the origins of its two links."""
        meshes = [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_MESH]
        for thing in (*meshes, *spec.meshes):
            spec.delete(thing)
        names = seen.loop.closure.name.split("-")
        for name in names:
            spec.body(name).add_site(name=f"at_{name}")
        rigid = seen.loop.closure.rigid
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD if rigid else mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"at_{names[0]}",
            name2=f"at_{names[1]}",
        )

    def to(self, pose: Array, q: Array) -> None:
        """Put the motors to two angles, and close the loop next to a pose by Newton's method."""
        self.data.qpos[:] = pose
        for dof, angle in zip(self.driven, q, strict=True):
            self.data.qpos[self.model.jnt_qposadr[self.model.dof_jntid[dof]]] = angle
        gap = np.full(1, np.inf)
        for _ in range(50):
            mujoco.mj_forward(self.model, self.data)
            rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
            slopes = self.data.efc_J.reshape(-1, self.model.nv)[rows]
            gap = self.data.efc_pos[rows]
            if np.abs(gap).max() < 1e-14:
                return
            step = np.zeros(self.model.nv)
            step[self.passive] = -np.linalg.lstsq(slopes[:, self.passive], gap, rcond=None)[0]
            mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
        assert np.abs(gap).max() < 1e-12

    def energy(self, seen: Understood, q_dot: Array) -> tuple[float, float]:
        """Return kinetic and potential energy of L1 to L4 with the motors at two rates [J]."""
        rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        slopes = self.data.efc_J.reshape(-1, self.model.nv)[rows]
        rates = np.zeros(self.model.nv)
        rates[self.driven] = q_dot
        wanted = -slopes @ rates
        rates[self.passive] = np.linalg.lstsq(slopes[:, self.passive], wanted, rcond=None)[0]
        self.data.qvel[:] = rates
        mujoco.mj_forward(self.model, self.data)
        kinetic = 0.0
        potential = 0.0
        for body in {body for link in seen.loop.links[1:] for body in link}:
            about = np.zeros((3, self.model.nv))
            along = np.zeros((3, self.model.nv))
            mujoco.mj_jacBodyCom(self.model, self.data, along, about, body)
            turn = self.data.ximat[body].reshape(3, 3).T @ (about @ rates)
            mass = self.model.body_mass[body]
            kinetic += 0.5 * mass * float((along @ rates) @ (along @ rates))
            kinetic += 0.5 * float(turn @ (self.model.body_inertia[body] * turn))
            potential -= mass * float(self.model.opt.gravity @ self.data.xipos[body])
        return kinetic, potential


@pytest.mark.parametrize("file", FILES)
def test_the_source_moves_as_the_leg(file: str, tmp_path: Path) -> None:
    """Foot to 1e-9 m and energies to 1e-9, against MuJoCo's own kinematics of the file."""
    right = FILES[file]
    seen = understand(SOURCES / file, motors=right.hinges)
    (tmp_path / "leg.toml").write_text(preset.text(seen), "utf-8")
    leg = FiveBar.load(tmp_path / "leg.toml")
    moved = Moved(seen)
    signs, offsets = np.transpose([seen.reading(0), seen.reading(4)])
    x, z = (np.eye(3)["xyz".index(letter)] for letter in right.plane)
    pose, rest = closed(seen, leg, moved)
    rng = np.random.default_rng(5)
    heights = []

    for _ in range(2):
        theta = rest + rng.uniform(-0.15, 0.15, 2)
        theta_dot = rng.uniform(-3.0, 3.0, 2)
        moved.to(pose, signs * (theta - offsets))
        hip = 0.5 * sum(moved.data.joint(name).xanchor for name in right.hinges)
        body = moved.data.body(right.foot[0])
        foot = body.xpos + body.xmat.reshape(3, 3) @ right.foot[1] - hip
        assert np.abs(kinematics.forward(leg, theta) - [foot @ x, foot @ z]).max() < 1e-9
        kinetic, potential = moved.energy(seen, signs * theta_dot)
        ours = dynamics.energy(leg, theta, theta_dot)
        rotors = 0.5 * leg.armature * float(theta_dot @ theta_dot)
        assert float(ours.kinetic) - rotors == pytest.approx(kinetic, rel=1e-9)
        heights.append(potential - float(ours.potential))
    assert np.ptp(heights) < 1e-12


def closed(seen: Understood, leg: FiveBar, moved: Moved) -> tuple[Array, Array]:
    """Return a pose of the source next to one that closes, and theta in it."""
    begun = seen.source.poses[0]
    # Its hinge at C, a joint, would stay far from where the knees go.
    if seen.source.path.name == "chain.xml":
        return begun, seen.angles(begun)[[0, 2]]
    q = kinematics.home(leg)
    pose = moved.data.qpos.copy()
    for theta, k in zip(q, (0, 1, 4, 3), strict=True):
        joint = seen.loop.hinges[k]
        if joint >= 0:
            pose[moved.model.jnt_qposadr[joint]] = coordinate(seen, k, float(theta))
    return pose, q[[0, 2]]


def coordinate(seen: Understood, k: int, angle: float) -> float:
    """Return the coordinate at which hinge k of a source has an angle of a leg [rad]."""
    sign, offset = seen.reading(k)
    return sign * (angle - offset)


def test_two_closures_on_one_axis_are_one(tmp_path: Path) -> None:
    """Some close a hinge at two points of its axis, which holds the links in the plane."""
    text = (SOURCES / "doggo.xml").read_text("utf-8")
    second = '<connect body1="shin_1" body2="shin_0" anchor="0.026 0.162 0"/></equality>'
    (tmp_path / "two.xml").write_text(text.replace("</equality>", second), "utf-8")
    assert understand(tmp_path / "two.xml").leg.L2 == 0.162


def test_what_is_not_taken_over_is_named() -> None:
    assert understand(SOURCES / "infantry.xml").notes[:1] == (
        "joint wheel is not of the loop: taken as fixed",
    )
    notes = understand(SOURCES / "minitaur.xml").notes
    assert "knee_r: its damping, 0.001 N m s/rad, is not of a leg" in notes
    notes = understand(SOURCES / "airhockey.urdf").notes
    assert "2 meshes are not looked at: their links say what they weigh" in notes


def test_motors_and_foot_by_name() -> None:
    """A and E, and the foot, as they are named, by joints or actuators, in either order."""
    file = SOURCES / "minitaur.xml"
    straight = understand(file, motors=("m_l", "m_r"), foot_name="foot_pad").leg
    assert straight.L6 == 0.0325
    at_C = understand(file, motors=("motor_r", "motor_l"), foot_name="C").leg
    # Seen from the other motor the same leg is its own mirror image, with A right of E.
    assert (at_C.L6, at_C.mode, at_C.assembly) == (0.0, (1, -1), 1)
    with pytest.raises(ConfigError, match="on the link of the second motor"):
        understand(file, motors=("motor_r", "motor_l"))
    with pytest.raises(ConfigError, match="did you mean 'foot_pad'"):
        understand(file, foot_name="foot_pat")
    with pytest.raises(ConfigError, match="motors must be two hinges of the loop"):
        understand(SOURCES / "infantry.xml", motors=("wheel", "hip_rear"))
