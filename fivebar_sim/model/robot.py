"""A robot as a MuJoCo model: a trunk, and the same leg four times.

The structure lives in models/robots/ and models/leg.xml; nothing here rebuilds it.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Drive
from fivebar_sim.errors import ArgumentError, GeometryError
from fivebar_sim.files import resources
from fivebar_sim.integrator import Integrator
from fivebar_sim.model.file import quiet, read
from fivebar_sim.model.friction import tell_law
from fivebar_sim.model.ground import lay
from fivebar_sim.model.leg import HIP_HEIGHT, leg_spec, set_options, standing
from fivebar_sim.robots import LEGS, Air, Floor, Hip, Robot, Scene
from fivebar_sim.robots.floor import Payload
from fivebar_sim.robots.ground import Ground
from fivebar_sim.robots.hips.turned import in_trunk
from fivebar_sim.robots.push import Push

BACKWARD = (0.0, 0.0, 0.0, 1.0)
"""Half a turn about z, as a quaternion."""

SMALLEST_INERTIA = 1e-14
"""Of a body that MuJoCo takes [kg m^2]."""

NET_FORCE = (3, 3, 1)
"""A contact sensor's parameters for "found force", "netforce", one contact."""

NET_WRENCH = (23, 3, 1)
"""The same for "found force torque pos": on uneven ground a foot has several contacts."""


def build_robot(
    robot: Robot,
    scene: Scene | None = None,
    *,
    timestep: float | None = None,
    integrator: Integrator = "discrete",
    drive: Drive = "position",
    pushes: Sequence[Push] = (),
) -> mujoco.MjModel:
    """Return the compiled model of a robot, its loops closed in the legs' rest pose.

    On a floor qpos begins with the trunk's position (3) and quaternion (4). Then come (theta_A,
    theta_B, theta_E, theta_D) of FL, FR, RL and RR, each after theta_T and theta_S where legs have
    these motors; ctrl is (A, E) of each, after the commands of all T and S, leg by leg. Names are
    those of a leg with the leg's name in front, `FL_A`; `trunk` is the body between them, and
    `FL_ground` the force of the floor on a foot, along the world's axes, after a number that says
    whether there is any; on uneven ground its torque and its place follow. The keyframe is `home`,
    in the air, or `stand`, with the lowest foot on the floor.

    Args:
        robot: The robot.
        scene: What it stands on; None: a floor with its defaults.
        timestep: [s]; None: the one in the MJCF file.
        integrator: "discrete" or "implicitfast".
        drive: Whether ctrl is an angle or a torque.
        pushes: Forces on the trunk: ctrl begins with x, y and z of each [N], whatever its time.

    Raises:
        ArgumentError: Unknown integrator or drive, a timestep that is not positive, or a scene that
            is none of a robot's.
        GeometryError: The legs do not reach below the trunk, or MuJoCo cannot compile them.
    """
    spec = robot_spec(
        robot, scene, timestep=timestep, integrator=integrator, drive=drive, pushes=pushes
    )
    try:
        with quiet():
            return spec.compile()
    except ValueError as error:
        # MuJoCo's messages span lines; ours are one line.
        message = " ".join(str(error).split())
        raise GeometryError(f"MuJoCo refuses robot {robot.name!r}: {message}") from None


def robot_spec(
    robot: Robot,
    scene: Scene | None = None,
    *,
    timestep: float | None = None,
    integrator: Integrator = "discrete",
    drive: Drive = "position",
    pushes: Sequence[Push] = (),
) -> mujoco.MjSpec:
    """Return what `build_robot` compiles; its arguments and errors are the same."""
    scene = Floor() if scene is None else scene
    # A leg's scenes have the same base, and no file for robots.
    if not isinstance(scene, Air | Floor):
        raise ArgumentError(f"scene must be robots.Air() or robots.Floor(), got {scene!r}")

    q = kinematics.hanging(robot.leg)
    with quiet():
        spec = read(resources.folder("models") / "robots" / f"{scene.kind}.xml")
        set_options(spec, robot.leg, timestep, integrator)
        if isinstance(scene, Floor):
            spec.option.gravity = _downhill(spec.option.gravity, scene.slope)
            lay(spec, scene.ground)
            _carry(spec, robot, scene.payload)
        _weigh(spec, robot)
        _push(spec, pushes)
        for name in LEGS:
            _turn(spec, robot.hips[name], name)
        for name in LEGS:
            leg = leg_spec(
                robot.leg,
                servo=robot.servo,
                timestep=timestep,
                integrator=integrator,
                drive=drive,
            )
            _attach(spec, leg, robot, name, scene)

        tell_law(spec, robot.servo)
        _place(spec, robot, scene, q)
        _rest(spec, robot, scene, q, drive, len(pushes))
    return spec


def standing_height(
    robot: Robot, q: Array, ground: Ground | None = None, turns: Array | None = None
) -> float:
    """Return the trunk's height above the floor with the lowest foot just on it [m].

    Args:
        robot: The robot, level, at the origin.
        q: Joint angles of its legs [rad], (4,) for all or (4, 4) in the order of `LEGS`.
        ground: What lies on the floor; None: nothing.
        turns: Angles of the motors of their hips [rad], (4, m); None: all 0.

    Raises:
        GeometryError: A foot is not below its hip.
    """
    poses = np.broadcast_to(q, (len(LEGS), 4))
    heights = []
    for k, (name, pose) in enumerate(zip(LEGS, poses, strict=True)):
        hip = robot.hips[name]
        height = standing(robot.leg, pose) - hip.pos[2]
        own = None if turns is None else turns[k]
        x, y, z = in_trunk(hip, kinematics.chain_points(robot.leg, pose).F, own).tolist()
        if own is not None and hip.motors:
            height = robot.leg.foot_radius - z
        if ground is not None and not ground.level:
            height += ground.lift(x, y, robot.leg.foot_radius)
        heights.append(height)
    return max(heights)


def _downhill(gravity: Array, slope: float) -> Array:
    """Return gravity along the axes of a floor that rises towards +x [m/s^2], (3,).

    (g_x cos a + g_z sin a,   g_y,   g_z cos a - g_x sin a)

    Args:
        gravity: The same of a level floor.
        slope: a [rad]; with 0 gravity stays what it is, to the last bit.
    """
    if slope == 0.0:
        return gravity
    x, y, z = gravity
    cosine = np.cos(slope)
    sine = np.sin(slope)
    return np.array([x * cosine + z * sine, y, z * cosine - x * sine])


def _weigh(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give the trunk its size and its inertia."""
    trunk = robot.trunk
    body = spec.body("trunk")
    body.explicitinertial = True
    body.mass = robot.trunk_mass
    body.ipos = trunk.center
    body.inertia = trunk.inertia_of(robot.trunk_mass)
    box = spec.geom("trunk")
    box.pos = trunk.center
    box.size = 0.5 * np.array(trunk.size)


def _carry(spec: mujoco.MjSpec, robot: Robot, payload: Payload) -> None:
    """Fix a payload to the trunk, if there is any; it collides with nothing."""
    if payload.mass == 0.0:
        return
    body = spec.body("trunk").add_body(name="payload", pos=payload.at)
    body.explicitinertial = True
    body.mass = payload.mass
    body.ipos = (0.0, 0.0, 0.0)
    # A point has none, which MuJoCo does not take: that of a ball of a micrometre.
    body.inertia = np.full(3, max(1e-12 * payload.mass, SMALLEST_INERTIA))
    ball = mujoco.mjtGeom.mjGEOM_SPHERE
    size = (0.25 * min(robot.trunk.size), 0.0, 0.0)
    body.add_geom(
        name="payload", type=ball, size=size, material="trunk", contype=0, conaffinity=0, mass=0.0
    )


def _push(spec: mujoco.MjSpec, pushes: Sequence[Push]) -> None:
    """Give every push a place on the trunk, and motors along the axes of the world."""
    if pushes:
        spec.worldbody.add_site(name="world")

    for k, push in enumerate(pushes):
        site = spec.body("trunk").add_site(name=f"push_{k}", pos=push.at)
        for axis, gear in zip("xyz", np.eye(3), strict=True):
            motor = spec.add_actuator(
                name=f"{site.name}_{axis}",
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                target=site.name,
                refsite="world",
                gear=[*gear, 0.0, 0.0, 0.0],
            )
            motor.set_to_motor()


def _turn(spec: mujoco.MjSpec, hip: Hip, name: str) -> None:
    """Give a leg the motors of its hip, one on the other, and what turns with each."""
    carrier = spec.body("trunk")
    place = hip.axis
    for motor in hip.motors:
        body = carrier.add_body(name=f"{name}_{motor.does}", pos=place)
        carrier = body
        place = hip.offset(motor)
        body.explicitinertial = True
        body.mass = motor.mass
        body.ipos = place
        body.inertia = np.full(3, motor.inertia)

        joint = body.add_joint(
            name=f"{name}_{motor.letter}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=motor.axis
        )
        joint.armature = motor.armature
        joint.damping[0] = motor.kd
        # Of a hinge it is the same as its joint; motors without limits are not among those that
        # keep theirs (`simulation.limits.clipping`).
        drive = spec.add_actuator(
            name=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINTINPARENT, target=joint.name
        )
        drive.set_to_position(kp=motor.kp)


def _attach(spec: mujoco.MjSpec, leg: mujoco.MjSpec, robot: Robot, name: str, scene: Scene) -> None:
    """Fix a leg to the trunk, and measure the floor's force on its foot."""
    hip = robot.hips[name]
    if not hip.motors:
        frame = spec.body("trunk").add_frame(pos=hip.pos)
    else:
        last = hip.motors[-1]
        frame = spec.body(f"{name}_{last.does}").add_frame(pos=hip.offset(last))
    if hip.mirrored:
        frame.quat = BACKWARD
    if isinstance(scene, Floor):
        leg.geom("foot").friction[0] = scene.friction
    frame.attach_body(leg.body("hip"), f"{name}_", "")

    # As in the leg's own scenes: found, then the force over the step that led to the state.
    bare = isinstance(scene, Air) or scene.ground.level
    of = mujoco.mjtObj.mjOBJ_GEOM if bare else mujoco.mjtObj.mjOBJ_BODY
    spec.add_sensor(
        name=f"{name}_ground",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=of,
        objname="floor" if bare else "world",
        reftype=mujoco.mjtObj.mjOBJ_GEOM,
        refname=f"{name}_foot",
        intprm=NET_FORCE if bare else NET_WRENCH,
    )


def _place(spec: mujoco.MjSpec, robot: Robot, scene: Scene, q: Array) -> None:
    """Put the trunk where the lowest foot stands, or out of the reach of every foot."""
    lowest = min(hip.pos[2] for hip in robot.hips.values())
    height = HIP_HEIGHT * robot.leg.size - lowest
    if isinstance(scene, Floor):
        height = standing_height(robot, q, scene.ground)
    spec.body("trunk").pos = (0.0, 0.0, height)


def _rest(
    spec: mujoco.MjSpec, robot: Robot, scene: Scene, q: Array, drive: Drive, pushes: int
) -> None:
    """Replace the legs' keyframes by one of the robot."""
    for key in list(spec.keys):
        spec.delete(key)

    free = isinstance(scene, Floor)
    trunk = [*spec.body("trunk").pos, 1.0, 0.0, 0.0, 0.0] if free else []
    ctrl = q[[0, 2]] if drive == "position" else np.zeros(2)
    # The motors of hips are at 0, and so are their commands.
    leg = np.concatenate([np.zeros(robot.joints - len(q)), q])
    before = np.zeros(3 * pushes + len(LEGS) * (robot.joints - len(q)))
    spec.add_key(
        name="stand" if free else "home",
        qpos=np.concatenate([trunk, np.tile(leg, len(LEGS))]),
        ctrl=np.concatenate([before, np.tile(ctrl, len(LEGS))]),
    )
