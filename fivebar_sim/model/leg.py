"""The leg as a MuJoCo model: loads its MJCF and sets the numbers of a `FiveBar` and a scene.

The structure lives in models/leg.xml, and in models/scenes/, whose files attach it; nothing here
rebuilds it.
"""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import get_args

import mujoco
import numpy as np

from fivebar_sim import kinematics, units
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.errors import ArgumentError, GeometryError, unknown
from fivebar_sim.files import resources
from fivebar_sim.geometry import LONGEST, FiveBar
from fivebar_sim.integrator import CONNECT, Integrator, solref
from fivebar_sim.kinematics.stops import stops_at_B, stops_at_C
from fivebar_sim.links import Link, combined
from fivebar_sim.metrics.columns import JOINTS, MOTORS
from fivebar_sim.model.file import quiet, read
from fivebar_sim.model.friction import rub
from fivebar_sim.scenario.scenes import Ground, Payload, Scene, Treadmill, named

HIP_HEIGHT = 1.3
"""Height of a fixed hip above the floor, in leg sizes: the foot cannot touch the floor."""

CLEAR = 1e-9
"""Least height of a foot above the floor at the start of a run [m]: exactly on it, the last bit of
that height, another on other processors, would decide whether it touches in the first step."""

KEPT = 32
"""Models that are kept, of 0.3 MB each: to compile one takes fourteen times as long as a copy."""


def build(
    leg: FiveBar,
    *,
    servo: Servo | None = None,
    scene: Scene | str = "air",
    timestep: float | None = None,
    integrator: Integrator = "discrete",
    drive: Drive = "position",
) -> mujoco.MjModel:
    """Return the compiled model of a leg in a scene, closed in its rest pose.

    qpos ends with (theta_A, theta_B, theta_E, theta_D), and ctrl with (A, E). The keyframe `home`
    is the rest pose; on a rail the foot stands on the floor.

    Args:
        leg: The leg.
        servo: Gains and limits of the servos at A and E; None: no damping, no limit, and the
            position gain of leg.xml.
        scene: A scene, or its name for one with default values.
        timestep: [s]; None: the one in the MJCF file.
        integrator: "discrete" or "implicitfast".
        drive: Whether ctrl is an angle or a torque.

    Raises:
        ArgumentError: Unknown scene, integrator or drive, or a timestep that is not positive.
        GeometryError: MuJoCo cannot compile the leg, for example because its mass is tiny.
    """
    placed = named(scene) if isinstance(scene, str) else scene
    # A copy, since whoever has a model may change it.
    return copy.copy(_compiled(leg, servo, placed, timestep, integrator, drive))


@lru_cache(maxsize=KEPT, typed=True)
def _compiled(
    leg: FiveBar,
    servo: Servo | None,
    scene: Scene,
    timestep: float | None,
    integrator: Integrator,
    drive: Drive,
) -> mujoco.MjModel:
    """Return the compiled model, kept; arguments and errors are those of `build`."""
    spec = leg_spec(
        leg, servo=servo, scene=scene, timestep=timestep, integrator=integrator, drive=drive
    )
    try:
        with quiet():
            return spec.compile()
    except ValueError as error:
        # MuJoCo's messages span lines; ours are one line.
        message = " ".join(str(error).split())
        raise GeometryError(f"MuJoCo refuses leg {leg.name!r}: {message}") from None


def leg_spec(
    leg: FiveBar,
    *,
    servo: Servo | None = None,
    scene: Scene | None = None,
    timestep: float | None = None,
    integrator: Integrator = "discrete",
    drive: Drive = "position",
) -> mujoco.MjSpec:
    """Return leg.xml with the numbers of a leg, ready to compile or to attach by its body `hip`.

    Arguments and errors are those of `build`; with a scene it is the scene's file, leg included.
    Without one the hip frame is the world's, so that attached at a site or frame it is that one:

        trunk.add_frame(pos=(0.1, 0, 0)).attach_body(leg_spec(leg).body("hip"), "FL_", "")
    """
    if drive not in get_args(Drive):
        raise ArgumentError(unknown("drive", str(drive), get_args(Drive)))

    file = "leg.xml" if scene is None else f"scenes/{scene.kind}.xml"
    spec = read(resources.folder("models") / file)
    set_options(spec, leg, timestep, integrator)

    # The model is compiled in this pose: a closed one, far from every singularity.
    q = kinematics.hanging(leg) if isinstance(scene, Ground) else kinematics.home(leg)
    _place(spec, leg, q)
    _size(spec, leg)
    _weigh(spec, leg)
    _drive(spec, servo, drive)
    _close(spec, leg, integrator, q)

    if scene is None:
        _lower(spec)
    elif isinstance(scene, Payload):
        _load(spec, leg, scene)
    elif isinstance(scene, Ground):
        _stand(spec, leg, scene, q)
    return spec


def set_options(
    spec: mujoco.MjSpec, leg: FiveBar, timestep: float | None, integrator: Integrator
) -> None:
    """Set timestep, integrator and gravity of a spec; what is attached to it keeps none of its own.

    Raises:
        ArgumentError: Unknown integrator, or a timestep that is not positive.
    """
    if integrator not in get_args(Integrator):
        raise ArgumentError(unknown("integrator", str(integrator), get_args(Integrator)))
    if timestep is not None:
        if not 0.0 < timestep < np.inf:
            raise ArgumentError(f"timestep must be in (0, inf) s, got {timestep!r}")
        spec.option.timestep = timestep

    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    gx, gz = leg.gravity
    # MuJoCo is three-dimensional: the leg moves in its xz-plane, y points away.
    spec.option.gravity = (gx, 0.0, gz)


def _lower(spec: mujoco.MjSpec) -> None:
    """Move the whole world down until the hip frame is at its origin: floor, light and camera too.

    An attached body keeps its own pose within what it is attached to.
    """
    down = np.array(spec.body("hip").pos)
    spec.body("hip").pos = (0.0, 0.0, 0.0)
    for thing in (*spec.worldbody.geoms, *spec.worldbody.lights, *spec.worldbody.cameras):
        thing.pos = np.array(thing.pos) - down


def _load(spec: mujoco.MjSpec, leg: FiveBar, scene: Payload) -> None:
    """Add the payload to the link that carries the foot."""
    if scene.mass > 0.0:
        point = Link(scene.mass, leg.foot_offset, 0.0)
        _explicit(spec.body("L2"), combined(leg.links[1], point))


def _stand(spec: mujoco.MjSpec, leg: FiveBar, scene: Ground, q: Array) -> None:
    """Put hip and trunk on the rail; in the keyframes the foot stands on the floor."""
    spec.body("hip").pos = (0.0, 0.0, 0.0)
    hip_z = spec.joint("hip_z")
    # With reference 0 the joint's coordinate is the hip's height above the floor itself.
    hip_z.ref = 0.0
    if scene.stop is not None:
        hip_z.range = (scene.stop, LONGEST)
        hip_z.limited = mujoco.mjtLimited.mjLIMITED_TRUE

    trunk = spec.body("trunk")
    trunk.mass = scene.mass
    trunk.ipos = (0.0, 0.0, 0.0)
    # Drawn above the hip, so that it hides no link; its mass sits in the hip.
    spec.geom("trunk").pos = (0.0, 0.0, 2.5 * leg.radius)
    spec.geom("foot").friction[0] = scene.friction

    if isinstance(scene, Treadmill):
        # The belt runs backward, so the leg walks forward on the spot.
        spec.geom("floor").surfacevel = (-(scene.speed or 0.0), 0.0, 0.0, 0.0, 0.0, 0.0)

    for key in spec.keys:
        key.qpos = (standing(leg, q), *q)
        key.ctrl = spec.key("home").ctrl


def standing(leg: FiveBar, q: Array) -> float:
    """Return the height of the hip frame's origin at which the foot just touches the floor [m].

    Args:
        leg: The leg.
        q: Joint angles [rad], (4,).

    Raises:
        GeometryError: The foot is not below the hip.
    """
    height = leg.foot_radius - float(kinematics.chain_points(leg, q).F[1])
    if not height > 0.0:
        raise GeometryError(
            f"leg {leg.name!r} cannot stand: its foot must be below the hip (z points up), "
            f"got {units.text(1e3 * (leg.foot_radius - height), 'mm')} above"
        )
    return height


def _place(spec: mujoco.MjSpec, leg: FiveBar, q: Array) -> None:
    """Put the links, joints, sites and the keyframe into the rest pose q."""
    A, E = kinematics.bases(leg)
    spec.body("hip").pos = (0.0, 0.0, HIP_HEIGHT * leg.size)
    origins = {"L1": A, "L2": (leg.L1, 0.0), "L4": E, "L3": (leg.L4, 0.0)}
    for (body, (x, z)), joint, angle in zip(origins.items(), JOINTS, q, strict=True):
        spec.body(body).pos = (x, 0.0, z)
        # The joints turn about -y, so that a positive angle turns +x towards +z.
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
    # A scene may have actuators of its own, and they come before the leg's two.
    spec.key("home").ctrl = (*[0.0] * (len(spec.actuators) - 2), *q[[0, 2]])


def _size(spec: mujoco.MjSpec, leg: FiveBar) -> None:
    """Give the geoms their lengths and radii; a leg with L6 gets one more, its extension."""
    for name in ("L1", "L2", "L3", "L4"):
        _capsule(spec.geom(name), leg.radius, (0.0, 0.0), (getattr(leg, name), 0.0))

    along, across = leg.foot_offset
    if leg.L6 > 0.0:
        extension = spec.body("L2").add_geom(spec.geom("L2").classname, name="L6")
        # A geom added here takes class defaults, but not what its neighbour sets itself.
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
    for joint in MOTORS:
        spec.joint(joint).armature = leg.armature
    for name, link in zip(("L1", "L2", "L3", "L4"), leg.links, strict=True):
        # Densities let MuJoCo weigh the geoms itself: a check of `FiveBar.links`, which
        # computes the same inertia in closed form.
        if leg.mass is None:
            for geom in spec.body(name).geoms:
                geom.density = leg.density
        else:
            _explicit(spec.body(name), link)


def _explicit(body: mujoco.MjsBody, link: Link) -> None:
    """Give a body the link's inertia; out of the plane it is that of a slender rod.

    Only the moment about y matters for the leg; the other two matter to a body that carries it.
    """
    along, across = link.com
    body.explicitinertial = True
    body.mass = link.mass
    body.ipos = (along, 0.0, across)
    body.inertia = (1e-3 * link.inertia, link.inertia, link.inertia)


def _drive(spec: mujoco.MjSpec, servo: Servo | None, drive: Drive) -> None:
    """Set the motors at A and E: the law of `Servo`, or a bare motor, whose ctrl at rest is 0."""
    for name in MOTORS:
        joint = spec.joint(name)
        actuator = spec.actuator(name)
        joint.damping[0] = 0.0 if servo is None else servo.passive(drive) + servo.gear.viscous
        if drive == "torque":
            actuator.set_to_motor()
        elif servo is not None:
            actuator.set_to_position(kp=servo.kp, kv=0.0 if servo.limit is None else servo.kd)
        if servo is None:
            continue
        if servo.limit is not None:
            actuator.forcerange = (-servo.limit, servo.limit)
            actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE

    if servo is not None:
        rub(spec, servo)
    if drive == "torque":
        spec.key("home").ctrl = np.zeros(len(spec.actuators))


def _close(spec: mujoco.MjSpec, leg: FiveBar, integrator: Integrator, q: Array) -> None:
    """Set the loop's stiffness, and stops that keep the angle at C on the rest pose's branch."""
    connect = spec.equality("C")
    connect.solref = solref(integrator, spec.option.timestep)
    connect.solimp[:3] = CONNECT[integrator][1]
    spec.tendon("C_angle").range = stops_at_C(q)
    spec.joint("B").range = stops_at_B(leg, q)
