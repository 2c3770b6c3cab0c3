"""The leg as a MuJoCo model: loads models/leg.xml and moves its numbers to a `FiveBar`.

The structure lives in the file alone; nothing here rebuilds it.
"""

from __future__ import annotations

from typing import Literal, get_args

import mujoco
import numpy as np

from fivebar_sim import kinematics, resources
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, GeometryError, unknown
from fivebar_sim.geometry import FiveBar, Link
from fivebar_sim.kinematics.stops import stops_at_C
from fivebar_sim.servo import Integrator, Servo

Scene = Literal["air"]

JOINTS = ("A", "B", "E", "D")
"""The joints in the order of qpos, and of every (..., 4) array of joint angles."""

HIP_HEIGHT = 1.3
"""Height of a fixed hip above the floor, in leg sizes: the foot cannot touch."""

CONNECT = {
    "discrete": ((1e-4, 1.0), (0.95, 0.99, 0.001)),
    "implicitfast": ((2.0, 1.0), (0.9999, 0.9999, 0.001)),  # time constant in timesteps
}
"""solref and solimp of the loop's closure, by integrator; measured in docs/model.md."""


def build(
    leg: FiveBar,
    *,
    servo: Servo | None = None,
    scene: Scene = "air",
    timestep: float | None = None,
    integrator: Integrator = "discrete",
) -> mujoco.MjModel:
    """Return the compiled model of a leg, closed in its rest pose.

    qpos reads (theta_A, theta_B, theta_E, theta_D). The keyframe `home` is the rest pose.

    Args:
        leg: The leg.
        servo: Gains and limit of the servos at A and E; None leaves ideal joints: no damping,
            no limit, the file's position gain.
        scene: "air" fixes the hip above the floor.
        timestep: [s]; None is the file's.
        integrator: "discrete" or "implicitfast".

    Raises:
        ArgumentError: Unknown scene or integrator, or a timestep that is not positive.
        GeometryError: A leg that MuJoCo does not compile, as one with next to no mass.
    """
    if scene not in get_args(Scene):
        raise ArgumentError(unknown("scene", str(scene), get_args(Scene)))
    spec = leg_spec(leg, servo=servo, timestep=timestep, integrator=integrator)
    try:
        return spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split())
        raise GeometryError(f"MuJoCo refuses leg {leg.name!r}: {said}") from None


def leg_spec(
    leg: FiveBar,
    *,
    servo: Servo | None = None,
    timestep: float | None = None,
    integrator: Integrator = "discrete",
) -> mujoco.MjSpec:
    """Return leg.xml with the numbers of a leg, to compile or to attach by its body `hip`.

    Arguments and errors are those of `build`.
    """
    if integrator not in get_args(Integrator):
        raise ArgumentError(unknown("integrator", str(integrator), get_args(Integrator)))
    spec = mujoco.MjSpec.from_file(str(resources.folder("models") / "leg.xml"))
    if timestep is not None:
        if not 0.0 < timestep < np.inf:
            raise ArgumentError(f"timestep must be in (0, inf) s, got {timestep!r}")
        spec.option.timestep = timestep
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    gx, gz = leg.gravity
    spec.option.gravity = (gx, 0.0, gz)

    q = kinematics.home(leg)
    _place(spec, leg, q)
    _size(spec, leg)
    _weigh(spec, leg)
    _drive(spec, servo)
    _close(spec, integrator, q)
    return spec


def _place(spec: mujoco.MjSpec, leg: FiveBar, q: Array) -> None:
    """Put the links, joints, sites and the keyframe into the rest pose q."""
    A, E = kinematics.bases(leg)
    spec.body("hip").pos = (0.0, 0.0, HIP_HEIGHT * leg.size)
    origins = {"L1": A, "L2": (leg.L1, 0.0), "L4": E, "L3": (leg.L4, 0.0)}
    for (body, (x, z)), joint, angle in zip(origins.items(), JOINTS, q, strict=True):
        spec.body(body).pos = (x, 0.0, z)
        # about -y, so that a positive angle turns +x to +z
        spec.body(body).quat = (np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0)
        spec.joint(joint).ref = angle
    along, across = leg.foot_offset
    for site, pos in {
        "foot": (along, 0.0, across),
        "C_left": (leg.L2, 0.0, 0.0),
        "C_right": (leg.L3, 0.0, 0.0),
    }.items():
        spec.site(site).pos = pos
    spec.key("home").qpos = q
    spec.key("home").ctrl = q[[0, 2]]


def _size(spec: mujoco.MjSpec, leg: FiveBar) -> None:
    """Give the geoms their lengths and radii; a leg with L6 gets one more, its extension."""
    for name in ("L1", "L2", "L3", "L4"):
        _capsule(spec.geom(name), leg.radius, (0.0, 0.0), (getattr(leg, name), 0.0))
    along, across = leg.foot_offset
    if leg.L6 > 0.0:
        extension = spec.body("L2").add_geom(spec.geom("L2").classname, name="L6")
        extension.material = spec.geom("L2").material
        _capsule(extension, leg.radius, (leg.L2, 0.0), (along, across))
    foot = spec.geom("foot")
    foot.pos = (along, 0.0, across)
    foot.size = (leg.foot_radius, 0.0, 0.0)
    hip = spec.geom("L5")
    hip.size = (0.5 * leg.L5 + 1.5 * leg.radius, *hip.size[1:])
    hip.quat = (np.cos(leg.tilt / 2), 0.0, -np.sin(leg.tilt / 2), 0.0)


def _capsule(
    geom: mujoco.MjsGeom, radius: float, start: tuple[float, float], end: tuple[float, float]
) -> None:
    """Make a geom a capsule between two points (x, z) of its body [m]."""
    geom.size = (radius, 0.0, 0.0)
    geom.fromto = (start[0], 0.0, start[1], end[0], 0.0, end[1])


def _weigh(spec: mujoco.MjSpec, leg: FiveBar) -> None:
    """Set the masses: densities of the geoms, or the leg's explicit inertias."""
    for joint in ("A", "E"):
        spec.joint(joint).armature = leg.armature
    for name, link in zip(("L1", "L2", "L3", "L4"), leg.links, strict=True):
        if leg.mass is None:
            for geom in spec.body(name).geoms:
                geom.density = leg.density
        else:
            _explicit(spec.body(name), link)


def _explicit(body: mujoco.MjsBody, link: Link) -> None:
    """Give a body the link's inertia. Out of the plane it is a slender rod along the link.

    Only the moment about y moves the leg; the other two serve bodies that carry the leg.
    """
    along, across = link.com
    body.explicitinertial = True
    body.mass = link.mass
    body.ipos = (along, 0.0, across)
    body.inertia = (1e-3 * link.inertia, link.inertia, link.inertia)


def _drive(spec: mujoco.MjSpec, servo: Servo | None) -> None:
    """Set the servos at A and E."""
    for name in ("A", "E"):
        joint, actuator = spec.joint(name), spec.actuator(name)
        if servo is None:
            joint.damping[0] = 0.0
            continue
        joint.damping[0] = servo.kd
        actuator.set_to_position(kp=servo.kp, kv=0.0)
        if servo.limit is not None:
            actuator.forcerange = (-servo.limit, servo.limit)
            actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE


def _close(spec: mujoco.MjSpec, integrator: Integrator, q: Array) -> None:
    """Set the loop's stiffness, and the stops of the angle at C around the rest pose's branch."""
    (timeconst, ratio), solimp = CONNECT[integrator]
    if integrator == "implicitfast":
        timeconst *= spec.option.timestep
    connect = spec.equality("C")
    connect.solref = (timeconst, ratio)
    connect.solimp[:3] = solimp
    spec.tendon("C_angle").range = stops_at_C(q)
