"""Writes legs and robots as URDF, which knows trees only, with the closed loops in a YAML beside.

The YAML is what Pinocchio's toolbox for parallel robots reads ("Extended URDF"): pairs of frames
that coincide, the kind of each pair, the names of the motors. Gravity, armature and rest pose, for
which URDF has no word, stand there too.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np

from fivebar_sim import model
from fivebar_sim.arrays import Array
from fivebar_sim.files import whole_file
from fivebar_sim.formats.subject import Subject
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.model import quiet

NO_LIMIT = 1e4
"""Effort that stands for a motor without a limit, which URDF does not know [N m]."""

CLOSURES = ".closures.yaml"
"""End of the name of the file beside the URDF."""

KEEP = "strippath='false' discardvisual='false' fusestatic='false'"
"""MuJoCo, which fuses what is fixed by default, keeps the frames of the loop."""


def write(subject: Subject, place: Path) -> Path:
    """Write a leg or a robot as URDF; return the YAML file with its closed loops.

    A scenario gives its leg and its servos: a URDF has no ground and no actuators.

    Args:
        subject: What is written.
        place: The URDF.

    Raises:
        ConfigError: A file cannot be written.
        GeometryError: MuJoCo cannot compile the leg.
    """
    with quiet():
        compiled = _spec(subject).compile()
    beside = place.with_name(place.stem + CLOSURES)
    whole_file.write(beside, closures(compiled))
    whole_file.write(place, text(compiled, subject))
    return beside


def _spec(subject: Subject) -> mujoco.MjSpec:
    """Return a spec without a scene."""
    if subject.robot is not None:
        return model.robot_spec(subject.robot)
    return model.leg_spec(subject.leg, servo=subject.servo)


def text(compiled: mujoco.MjModel, subject: Subject) -> str:
    """Return the URDF of a compiled leg or robot; q = 0 is theta = 0."""
    root = ET.Element("robot", name=subject.name)
    root.append(ET.Comment(f" Written by fivebar-sim: {subject.words}, SI units, radians. "))
    root.append(ET.fromstring(f"<mujoco><compiler {KEEP}/></mujoco>"))
    for body in range(1, compiled.nbody):
        _add_link(root, compiled, body)
        # The body under the world, the hip or the trunk, is the root of the tree.
        if compiled.body_parentid[body] != 0:
            _add_joint(root, compiled, body, subject)
    for site in range(compiled.nsite):
        if compiled.site(site).name.endswith(("foot", "C_left", "C_right")):
            _add_frame(root, compiled, site)

    ET.indent(root)
    return "<?xml version='1.0'?>\n" + ET.tostring(root, encoding="unicode") + "\n"


def _add_link(root: ET.Element, compiled: mujoco.MjModel, body: int) -> None:
    """Add a body's link: its inertia about the centre of mass, and its capsules to look at."""
    link = ET.SubElement(root, "link", name=compiled.body(body).name)
    if compiled.body_mass[body] > 0.0:
        inertial = ET.SubElement(link, "inertial")
        _add_origin(inertial, compiled.body_ipos[body])
        ET.SubElement(inertial, "mass", value=_full(compiled.body_mass[body]))
        turn = _matrix(compiled.body_iquat[body])
        about = turn @ np.diag(compiled.body_inertia[body]) @ turn.T
        pairs = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2)}
        pairs |= {"iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
        values = {key: _number(about[pair], about.max()) for key, pair in pairs.items()}
        ET.SubElement(inertial, "inertia", values)

    for geom in np.flatnonzero(compiled.geom_bodyid == body):
        _add_visual(link, compiled, int(geom))


def _add_visual(link: ET.Element, compiled: mujoco.MjModel, geom: int) -> None:
    """Add what a geom looks like; URDF has no capsules, so those are cylinders."""
    size = compiled.geom_size[geom]
    kind = mujoco.mjtGeom(compiled.geom_type[geom])
    visual = ET.SubElement(link, "visual", name=compiled.geom(geom).name)
    _add_origin(visual, compiled.geom_pos[geom], _matrix(compiled.geom_quat[geom]))
    shape = ET.SubElement(visual, "geometry")
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        ET.SubElement(shape, "sphere", radius=_full(size[0]))
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        ET.SubElement(shape, "box", size=_numbers(2.0 * size))
    else:
        ET.SubElement(shape, "cylinder", radius=_full(size[0]), length=_full(2.0 * size[1]))


def _add_joint(root: ET.Element, compiled: mujoco.MjModel, body: int, subject: Subject) -> None:
    """Add the joint between a body and its parent."""
    child = compiled.body(body).name
    count = compiled.body_jntnum[body]
    hinge = int(compiled.body_jntadr[body])
    name = compiled.joint(hinge).name if count else f"{child}_fixed"
    joint = ET.SubElement(root, "joint", name=name, type="revolute" if count else "fixed")
    turn = _matrix(compiled.body_quat[body])
    if count:
        # MuJoCo's body pose is that at the reference angle, URDF's that at 0.
        turn = turn @ _about(compiled.jnt_axis[hinge], -compiled.qpos0[compiled.jnt_qposadr[hinge]])
    _add_origin(joint, compiled.body_pos[body], turn)
    ET.SubElement(joint, "parent", link=compiled.body(compiled.body_parentid[body]).name)
    ET.SubElement(joint, "child", link=child)
    if not count:
        return

    ET.SubElement(joint, "axis", xyz=_numbers(compiled.jnt_axis[hinge]))
    motor = hinge in compiled.actuator_trnid[:, 0]
    low, high = (_full(each) for each in compiled.jnt_range[hinge])
    effort = (subject.servo.limit or NO_LIMIT) if motor else 0.0
    speed = (subject.servo.speed if motor else None) or SPEED_LIMIT
    ET.SubElement(
        joint, "limit", lower=low, upper=high, effort=_full(effort), velocity=_full(speed)
    )
    dof = compiled.jnt_dofadr[hinge]
    damping = _full(compiled.dof_damping[dof])
    friction = _full(compiled.dof_frictionloss[dof])
    ET.SubElement(joint, "dynamics", damping=damping, friction=friction)


def _add_frame(root: ET.Element, compiled: mujoco.MjModel, site: int) -> None:
    """Add a link without mass where a site is."""
    name = compiled.site(site).name
    ET.SubElement(root, "link", name=name)
    joint = ET.SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
    _add_origin(joint, compiled.site_pos[site])
    ET.SubElement(joint, "parent", link=compiled.body(compiled.site_bodyid[site]).name)
    ET.SubElement(joint, "child", link=name)


def _add_origin(of: ET.Element, pos: Array, turn: Array | None = None) -> None:
    """Add the pose of something in what it is fixed to."""
    rpy = np.zeros(3) if turn is None else _rpy(turn)
    ET.SubElement(of, "origin", xyz=_numbers(pos), rpy=_numbers(rpy))


def closures(compiled: mujoco.MjModel) -> str:
    """Return the YAML of a model's closed loops."""
    loops = [
        [compiled.site(compiled.eq_obj1id[k]).name, compiled.site(compiled.eq_obj2id[k]).name]
        for k in range(compiled.neq)
    ]
    motors = [compiled.joint(compiled.actuator_trnid[k, 0]).name for k in range(compiled.nu)]
    hinges = np.flatnonzero(compiled.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    dofs = {name: compiled.joint(name).dofadr[0] for name in motors}

    armature = {name: float(compiled.dof_armature[dof]) for name, dof in dofs.items()}
    rest = {compiled.joint(k).name: float(compiled.qpos0[compiled.jnt_qposadr[k]]) for k in hinges}
    return "\n".join(
        [
            "# Extended URDF: the pairs of frames that coincide, and what drives the joints.",
            f"closed_loop: {loops}",
            f"type: {['3d'] * len(loops)}",
            f"name_mot: {motors}",
            "joint_name: []",
            "joint_type: []",
            "# What URDF has no word for: gravity [m/s^2], rotor inertia [kg m^2], and a pose that",
            "# closes the loops [rad].",
            f"gravity: [{', '.join(_yaml(float(each)) for each in compiled.opt.gravity)}]",
            f"armature: {_flow(armature)}",
            f"rest: {_flow(rest)}",
            "",
        ]
    )


def _flow(values: dict[str, float]) -> str:
    """Return numbers by name as YAML."""
    return "{" + ", ".join(f"{name}: {_yaml(value)}" for name, value in values.items()) + "}"


def _yaml(value: float) -> str:
    """Return a number as YAML, which takes 1e-05 for a text, but not 1.0e-05."""
    mantissa, _, exponent = repr(value).partition("e")
    whole = exponent and "." not in mantissa
    return f"{mantissa}{'.0' if whole else ''}{'e' if exponent else ''}{exponent}"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(value, 1.0) for value in values)


def _number(value: float, scale: float) -> str:
    """Return a number in full; what rounding left of a zero is 0."""
    return _full(value) if abs(value) > 1e-15 * scale else "0"


def _full(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _matrix(quat: Array) -> Array:
    """Return the rotation matrix of a quaternion, (3, 3)."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.ascontiguousarray(quat, np.float64))
    return matrix.reshape(3, 3)


def _about(axis: Array, angle: float) -> Array:
    """Return the rotation matrix about an axis, (3, 3)."""
    quat = np.empty(4)
    mujoco.mju_axisAngle2Quat(quat, np.ascontiguousarray(axis, np.float64), float(angle))
    return _matrix(quat)


def _rpy(turn: Array) -> Array:
    """Return roll, pitch and yaw of a rotation: turn = Rz(yaw) Ry(pitch) Rx(roll) [rad]."""
    pitch = np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0]))
    # Straight up or down roll and yaw are one turn.
    if np.hypot(turn[0, 0], turn[1, 0]) < 1e-12:
        return np.array([np.arctan2(-turn[1, 2], turn[1, 1]), pitch, 0.0])
    roll = np.arctan2(turn[2, 1], turn[2, 2])
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    return np.array([roll, pitch, yaw])
