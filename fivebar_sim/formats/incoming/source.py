"""Reads a model of another program: MJCF, or URDF with a YAML of its closed loops."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.formats.incoming import extended_urdf
from fivebar_sim.model import quiet

HINGE = mujoco.mjtJoint.mjJNT_HINGE
EQUALITY = mujoco.mjtEq
WHOLE = np.array([1.0, 0.0, 0.0, 0.0])
"""The quaternion of no rotation."""


class Frame(NamedTuple):
    """A frame that is fixed to a body.

    Attributes:
        body: The body's number.
        pos: Its origin in the body's frame [m], (3,).
        quat: Its rotation in the body's frame, (4,).
    """

    body: int
    pos: Array
    quat: Array = WHOLE


class Closure(NamedTuple):
    """What closes a loop: two frames whose origins coincide.

    Attributes:
        name: Its name, for messages.
        one, other: The frames.
        rigid: Whether their axes coincide too, as in a weld.
    """

    name: str
    one: Frame
    other: Frame
    rigid: bool


@dataclass(frozen=True)
class Source:
    """A model that was read.

    Attributes:
        path: Its file.
        model: The compiled model.
        closures: What closes its loops.
        motors: Names of the driven joints.
        poses: Poses in which the loop may be closed, the likeliest first, (nq,) each.
        armature: Rotor inertia by joint, where the file's format has no word for it [kg m^2].
        notes: What could not be taken over, a line each.
    """

    path: Path
    model: mujoco.MjModel
    closures: tuple[Closure, ...]
    motors: tuple[str, ...]
    poses: tuple[Array, ...]
    armature: dict[str, float]
    notes: tuple[str, ...]

    def joint(self, name: str) -> int:
        """Return the number of a joint by its name, or by that of an actuator that drives it.

        Raises:
            ConfigError: Nothing has the name.
        """
        joints = names(self.model, "joint")
        if name in joints:
            return joints.index(name)
        actuators = names(self.model, "actuator")
        if name in actuators:
            return int(self.model.actuator_trnid[actuators.index(name), 0])
        raise ConfigError(f"{self.path}: {unknown('joint', name, filter(None, joints))}")


def names(model: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names of all things of a kind, "" where one has none."""
    counts = {"body": "nbody", "joint": "njnt", "geom": "ngeom", "site": "nsite"}
    counts |= {"actuator": "nu", "equality": "neq"}
    count = getattr(model, counts[kind])
    found = getattr(model, kind)
    return [found(k).name for k in range(count)]


def read(path: Path, closures: Path | None = None) -> Source:
    """Read an MJCF, or a URDF with the YAML that stands beside it.

    Args:
        path: The file.
        closures: The YAML; None: the file's name with .closures.yaml or .yaml, or robot.yaml.

    Raises:
        ConfigError: A file cannot be read, or MuJoCo cannot compile it; a mesh is missing.
    """
    try:
        root = ET.parse(path).getroot()
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from None
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigError(f"{path} is not XML: {error}") from None

    if root.tag == "mujoco":
        if closures is not None:
            raise ConfigError(f"{path} is MJCF, which has its closed loops in itself")
        return _of_mjcf(path)
    if root.tag == "robot":
        return _of_urdf(path, root, closures)
    raise ConfigError(
        f"{path} must be MJCF, <mujoco>, or URDF, <robot>; its first element is <{root.tag}>"
    )


def _of_mjcf(path: Path) -> Source:
    """Return what an MJCF has."""
    model = _compiled(path, lambda: mujoco.MjModel.from_xml_path(str(path)))
    closures = []
    notes = []
    for k in range(model.neq):
        name = model.equality(k).name or f"equality {k}"
        kind = mujoco.mjtEq(model.eq_type[k])
        if kind not in (EQUALITY.mjEQ_CONNECT, EQUALITY.mjEQ_WELD) or not model.eq_active0[k]:
            word = kind.name.removeprefix("mjEQ_").lower()
            state = "" if model.eq_active0[k] else ", which is off,"
            notes.append(f"{name}: an equality {word}{state} is not part of a leg")
            continue
        closures.append(_closure(model, k, name, rigid=kind == EQUALITY.mjEQ_WELD))

    driven = model.actuator_trnid[model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, 0]
    motors = tuple(dict.fromkeys(model.joint(int(k)).name for k in driven))
    keys = tuple(np.array(each) for each in model.key_qpos)
    return Source(path, model, tuple(closures), motors, (*keys, model.qpos0), {}, tuple(notes))


def _closure(model: mujoco.MjModel, k: int, name: str, *, rigid: bool) -> Closure:
    """Return a connect or a weld as two frames."""
    ends = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
    if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
        frames = [
            Frame(int(model.site_bodyid[end]), model.site_pos[end], model.site_quat[end])
            for end in ends
        ]
        return Closure(name, frames[0], frames[1], rigid)
    data = model.eq_data[k]
    if rigid:
        # Of a weld the anchor is in body 2, and in body 1 the place and rotation where it belongs.
        return Closure(name, Frame(ends[0], data[3:6], data[6:10]), Frame(ends[1], data[:3]), True)
    return Closure(name, Frame(ends[0], data[:3]), Frame(ends[1], data[3:6]), False)


def _of_urdf(path: Path, root: ET.Element, closures: Path | None) -> Source:
    """Return what a URDF and its YAML have."""
    beside = extended_urdf.find(path, closures)
    said = extended_urdf.read(beside)
    base = extended_urdf.root_link(root)
    text, notes = extended_urdf.for_mujoco(root, path)
    model = _compiled(path, lambda: mujoco.MjModel.from_xml_string(text))
    if said.gravity is not None:
        model.opt.gravity[:] = said.gravity

    bodies = names(model, "body")
    # MuJoCo welds the root to the world, which takes its place.
    bodies[0] = base
    found = []
    for (one, other), kind in zip(said.closed_loop, said.type, strict=True):
        frames = []
        for name in (one, other):
            if name not in bodies:
                raise ConfigError(f"{beside}: closed_loop: {unknown('link', name, bodies)}")
            frames.append(Frame(bodies.index(name), np.zeros(3)))
        found.append(Closure(f"{one}-{other}", frames[0], frames[1], kind == "6d"))
    pose = _pose(model, said.rest, beside)
    poses = (model.qpos0,) if pose is None else (pose, model.qpos0)
    return Source(path, model, tuple(found), said.name_mot, poses, said.armature, tuple(notes))


def _pose(model: mujoco.MjModel, rest: dict[str, float], where: Path) -> Array | None:
    """Return the pose in which joints have some angles, or None if there are none."""
    if not rest:
        return None
    pose = model.qpos0.copy()
    joints = names(model, "joint")
    for name, angle in rest.items():
        if name not in joints:
            raise ConfigError(f"{where}: rest: {unknown('joint', name, joints)}")
        pose[model.joint(name).qposadr[0]] = angle
    return pose


def _compiled(path: Path, compile_it: Any) -> mujoco.MjModel:
    """Return a compiled model; MuJoCo's messages span lines, ours are one line."""
    try:
        with quiet():
            model = compile_it()
    except ValueError as error:
        message = " ".join(str(error).split())
        raise ConfigError(f"{path}: MuJoCo cannot compile it: {message}") from None
    for name in ("body_pos", "body_quat", "jnt_axis", "qpos0", "eq_data", "site_pos"):
        if not np.isfinite(getattr(model, name)).all():
            raise ConfigError(f"{path}: a number is not finite: {name} of the compiled model")
    return model
