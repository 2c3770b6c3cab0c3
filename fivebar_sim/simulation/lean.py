"""What MuJoCo does in every step and nobody sees: left out, and the states keep their bits.

All that is left out is chosen here, from the model and from what is recorded.
"""

from __future__ import annotations

import copy
import ctypes
import hashlib
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from fivebar_sim.arrays import Bools
from fivebar_sim.model import friction_law

RECORDED = "ground"
"""The sensor that is recorded; those of a robot end with it, after the leg's name."""

WRAPPED = (mujoco.mjtWrap.mjWRAP_SPHERE.value, mujoco.mjtWrap.mjWRAP_CYLINDER.value)
"""What a tendon may be wound round."""

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""The quaternion of what is not turned."""

_lock = threading.Lock()
_stopped: list[int | None] = []
"""MuJoCo's clock, once for every `without_clock` that is going on."""


def lean(models: Sequence[mujoco.MjModel], *, forces: bool = True) -> list[mujoco.MjModel]:
    """Return copies that are stepped faster, to the same states: one for all models that are equal.

    See `left_out`. Sensors that are not recorded stay at zero, and geoms that are only seen at the
    world's origin.

    Args:
        models: The models.
        forces: Whether the ground's force is recorded.
    """
    alone = len({id(model) for model in models}) == 1
    copies: dict[bytes, mujoco.MjModel] = {}
    names: dict[int, bytes] = {}
    name = b""
    last = b""
    for model in models:
        if id(model) in names:
            continue
        # Many models would not stay in the processor's cache: equal ones are one.
        if not alone:
            whole = _saved(model)
            # Most are like the one before them: to compare two takes a hundredth of a digest.
            if whole != last:
                name = hashlib.blake2b(whole, digest_size=16).digest()
                last = whole
        names[id(model)] = name
        if name not in copies:
            copies[name] = _short(model, forces=forces)
    return [copies[names[id(model)]] for model in models]


def _saved(model: mujoco.MjModel) -> bytes:
    """Return all bytes of a model, which equal models have in common."""
    whole = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, whole)
    return whole.tobytes()


def _short(model: mujoco.MjModel, *, forces: bool) -> mujoco.MjModel:
    short = copy.copy(model)
    flags = left_out(model, forces=forces)
    short.opt.disableflags |= flags
    if not flags & mujoco.mjtDisableBit.mjDSBL_SENSOR.value:
        short.sensor_needstage[~_recorded(model)] = mujoco.mjtStage.mjSTAGE_NONE.value
    # The search for contacts begins with the axes along which all geoms of moving bodies lie.
    seen = only_seen(model)
    short.geom_bodyid[seen] = 0
    short.geom_sameframe[seen] = mujoco.mjtSameFrame.mjSAMEFRAME_BODY.value
    return short


def left_out(model: mujoco.MjModel, *, forces: bool = True) -> int:
    """Return the flags of what MuJoCo can leave out of a leg's steps, bit by bit the same.

    Always the search for islands, since the loop makes one of a leg, and the one for pairs within
    bodies, of which one geom collides. The sensors if none is recorded; contacts if nothing can
    touch; friction and springs of joints where there are none.
    """
    off = mujoco.mjtDisableBit
    chosen = [off.mjDSBL_ISLAND, off.mjDSBL_MIDPHASE]
    if not (forces and _recorded(model).any()):
        chosen.append(off.mjDSBL_SENSOR)
    if not can_touch(model):
        chosen.append(off.mjDSBL_CONTACT)
    rubs = model.dof_frictionloss.any() or friction_law(model) is not None
    if not (rubs or model.tendon_frictionloss.any()):
        chosen.append(off.mjDSBL_FRICTIONLOSS)

    stiff = (model.jnt_stiffness, model.jnt_stiffnesspoly, model.tendon_stiffness)
    if not any(each.any() for each in (*stiff, model.tendon_stiffnesspoly)):
        chosen.append(off.mjDSBL_SPRING)
    return sum(flag.value for flag in chosen)


def only_seen(model: mujoco.MjModel) -> Bools:
    """Return which geoms neither collide, nor push on air or water, nor wind a tendon, (ngeom,)."""
    if model.opt.density or model.opt.viscosity:
        return np.zeros(model.ngeom, dtype=bool)
    seen = (model.geom_contype | model.geom_conaffinity) == 0
    seen[model.pair_geom1] = False
    seen[model.pair_geom2] = False
    wound = [kind in WRAPPED for kind in model.wrap_type.tolist()]
    seen[model.wrap_objid[wound]] = False
    return seen


def _recorded(model: mujoco.MjModel) -> Bools:
    """Return which sensors are recorded, (nsensor,)."""
    names = [_name(model, i) for i in range(model.nsensor)]
    return np.array([name.split("_")[-1] == RECORDED for name in names], dtype=bool)


def _name(model: mujoco.MjModel, i: int) -> str:
    """Return the name of a sensor; `model.sensor` would look up all that the model has."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, i) or ""


def recorded_columns(model: mujoco.MjModel) -> list[int]:
    """Return where sensordata has the floor's forces on the feet.

    Of a leg alone x and z, since it moves in a plane; of each leg of a robot x, y and z, and all
    else that its sensor has.
    """
    columns = []
    for i in np.flatnonzero(_recorded(model)):
        # Before the force is a number that says whether there is any.
        start = int(model.sensor_adr[i]) + 1
        alone = _name(model, int(i)) == RECORDED
        stop = int(model.sensor_adr[i] + model.sensor_dim[i])
        columns += [start, start + 2] if alone else range(start, stop)
    return columns


def can_touch(model: mujoco.MjModel) -> bool:
    """Return whether a geom of a leg can come to another one that it collides with.

    Not if only the floor is left, below the ball about the fixed hip in which the geom stays.
    """
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    moving = np.flatnonzero(collides & (model.body_weldid[model.geom_bodyid] != 0))
    return bool(model.npair) or any(_can_touch(model, int(geom)) for geom in moving)


def _can_touch(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether one geom can come to another one."""
    meets = (model.geom_contype & model.geom_conaffinity[geom]) | (
        model.geom_conaffinity & model.geom_contype[geom]
    )
    others = np.flatnonzero((meets != 0) & (model.geom_bodyid != model.geom_bodyid[geom]))
    if not others.size:
        return False

    planes = model.geom_type[others] == mujoco.mjtGeom.mjGEOM_PLANE.value
    level = (model.geom_quat[others] == UPRIGHT).all() and not model.geom_bodyid[others].any()
    lowest = _lowest(model, geom)
    if lowest is None or not planes.all() or not level:
        return True
    return bool((model.geom_pos[others, 2] >= lowest).any())


def _lowest(model: mujoco.MjModel, geom: int) -> float | None:
    """Return a height that a geom never comes below [m].

    None where it hangs on other joints than hinges through the origins of their bodies, or these
    on a body that is not upright.
    """
    reach = float(np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom])
    body = int(model.geom_bodyid[geom])
    while model.body_weldid[body] != 0:
        joints = np.flatnonzero(model.jnt_bodyid == body)
        hinges = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE.value
        if not hinges.all() or model.jnt_pos[joints].any():
            return None
        reach += float(np.linalg.norm(model.body_pos[body]))
        body = int(model.body_parentid[body])

    height = 0.0
    while body != 0:
        if (model.body_quat[body] != UPRIGHT).any():
            return None
        height += float(model.body_pos[body, 2])
        body = int(model.body_parentid[body])
    return height - reach


@contextmanager
def without_clock() -> Iterator[None]:
    """Keep MuJoCo from reading the time at every stage of every step, for its profile.

    Its Python package sets a clock when it is imported. The clock is there again afterwards, once
    the last of those that run at the same time is through.
    """
    clock = _clock()
    if clock is None:
        yield
        return

    with _lock:
        # The first one finds the clock; those within it find none.
        _stopped.append(_stopped[0] if _stopped else clock.value)
        clock.value = None
    try:
        yield
    finally:
        with _lock:
            found = _stopped.pop()
            if not _stopped:
                clock.value = found


@cache
def _clock() -> ctypes.c_void_p | None:
    """Return where MuJoCo keeps its clock; None where its library is not found."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for file in folder.glob(pattern):
            try:
                return ctypes.c_void_p.in_dll(ctypes.CDLL(str(file)), "mjcb_time")
            except (OSError, ValueError):
                continue
    return None
