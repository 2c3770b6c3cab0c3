"""What a model has that a leg has no place for: each is named, with its number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fivebar_sim.formats.incoming import flat
from fivebar_sim.formats.incoming.flat import Plane
from fivebar_sim.formats.incoming.foot import Foot
from fivebar_sim.formats.incoming.loop import CLOSING, Loop, hinge_name, outside_joints
from fivebar_sim.formats.incoming.source import Source

SIDES = {0: "A", 4: "E"}
"""The driven hinges."""


def armature(source: Source, loop: Loop, k: int) -> float:
    """Return the rotor inertia at hinge k [kg m^2]."""
    joint = loop.hinges[k]
    if joint == CLOSING:
        return 0.0
    name = source.model.joint(joint).name
    return source.armature.get(name, float(source.model.dof_armature[_dof(source, joint)]))


def _dof(source: Source, joint: int) -> int:
    return int(source.model.jnt_dofadr[joint])


def remarks(source: Source, loop: Loop, plane: Plane, foot: Foot) -> Iterator[str]:
    """Yield a line for everything that was not taken over."""
    yield from _about_joints(source, loop)
    rotors = [armature(source, loop, k) for k in SIDES]
    if rotors[0] != rotors[1]:
        yield f"rotor inertia differs, {rotors[0]:g} and {rotors[1]:g} kg m^2: that of A is taken"

    for k in np.flatnonzero(source.model.tendon_stiffness > 0.0):
        name = source.model.tendon(int(k)).name or f"tendon {k}"
        yield f"{name}: a spring between joints is not of a leg"
    if plane.off > 1e-9:
        yield f"axes are up to {plane.off:.2g} rad off parallel: taken as parallel"
    if foot.radius is None:
        yield f"no ball at the foot ({foot.name}): its radius is a guess"
    across = _gravity_across(source, loop, plane)
    if abs(across) > 1e-6:
        yield f"gravity has {across:.4g} m/s^2 across the plane, which moves no joint"


def _about_joints(source: Source, loop: Loop) -> Iterator[str]:
    """Yield what the joints have besides angles."""
    model = source.model
    for name in outside_joints(source, loop):
        yield f"joint {name} is not of the loop: taken as fixed"
    for k, joint in enumerate(loop.hinges):
        if joint == CLOSING:
            continue
        name = hinge_name(source, loop, k)
        dof = _dof(source, joint)

        if model.jnt_stiffness[joint] > 0.0:
            yield f"{name}: its spring, {model.jnt_stiffness[joint]:g} N m/rad, is not of a leg"
        if k not in SIDES and model.dof_damping[dof] > 0.0:
            yield f"{name}: its damping, {model.dof_damping[dof]:g} N m s/rad, is not of a leg"
        if model.dof_frictionloss[dof] > 0.0 and k not in SIDES:
            yield f"{name}: its friction, {model.dof_frictionloss[dof]:g} N m, is not of a leg"
        if k not in SIDES and armature(source, loop, k) > 0.0:
            yield f"{name}: its armature, {armature(source, loop, k):g} kg m^2, is not of a leg"


def _gravity_across(source: Source, loop: Loop, plane: Plane) -> float:
    """Return gravity across the plane [m/s^2]."""
    ground = flat.Posed(source, loop, source.poses[0]).ground()
    return float(np.cross(ground @ plane.x, ground @ plane.z) @ source.model.opt.gravity)
