"""What a leg's state means to its task: `tasks.motion` and the tasks' terms, as Warp functions."""
# Warp reads annotations as types of its own, and its operators are not Python's.
# pyright: reportInvalidTypeForm=false, reportMissingImports=false, reportArgumentType=false
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportAssignmentType=false, reportGeneralTypeIssues=false
# ruff: noqa: UP018, RUF046 - a number that changes in a loop is told so by its type's call

import warp as wp

from fivebar_sim.kinematics.stops import C_STOP, MOTOR_RANGE
from fivebar_sim.tasks.motion import TIME, TOUCH, WIDEST_GAP
from fivebar_sim.warp.episodes.structs import Group, Now, Shown

wp.set_module_options({"enable_backward": False})

GAP = wp.constant(float(WIDEST_GAP))
TOUCHES = wp.constant(float(TOUCH))
STOP = wp.constant(float(C_STOP))
RANGE = wp.constant(float(MOTOR_RANGE))
TURN = wp.constant(6.283185307179586)
OUT_OF_TIME = wp.constant(int(TIME))


@wp.struct
class Pose:
    """A leg's state; attributes as in `tasks.motion.Motion`."""

    foot: wp.vec2
    foot_dot: wp.vec2
    hip: float
    hip_dot: float
    height: float
    contact: float
    reason: int


@wp.func
def along(angle: float):
    """Return (cos, sin) of an angle."""
    return wp.vec2(wp.cos(angle), wp.sin(angle))


@wp.func
def crossed(a: wp.vec2, b: wp.vec2):
    """Return a_x b_z - a_z b_x."""
    return a[0] * b[1] - a[1] * b[0]


@wp.func
def turned(v: wp.vec2):
    """Return a vector turned by +90 deg."""
    return wp.vec2(-v[1], v[0])


@wp.func
def reason_of(group: Group, now: Now, leg: int, foot: wp.vec2, E: wp.vec2):
    """Return why a leg has failed, 0 if it has not; see `tasks.motion._reason`."""
    hinge = now.q.shape[1] - 4
    a = now.q[leg, hinge]
    e = now.q[leg, hinge + 2]
    psi_2 = a + now.q[leg, hinge + 1]
    psi_3 = e + now.q[leg, hinge + 3]
    B = -E + group.lengths[leg, 0] * along(a)
    D = E + group.lengths[leg, 3] * along(e)
    left = B + group.lengths[leg, 1] * along(psi_2)
    right = D + group.lengths[leg, 2] * along(psi_3)

    reason = int(0)
    far = wp.max(wp.abs(a), wp.abs(e)) > RANGE
    if far or wp.abs(wp.sin(psi_2 - psi_3)) < wp.sin(STOP):
        reason = 4
    s_A = wp.sign(crossed(foot + E, B + E))
    s_E = wp.sign(crossed(right - E, D - E))
    if s_A != group.s_A or s_E != group.s_E:
        reason = 3
    if wp.sign(crossed(D - B, left - B)) != group.assembly:
        reason = 3
    # The cause last, so that it wins: with an open loop the branch means nothing.
    if wp.length(right - left) > GAP * group.lengths[leg, 6]:
        reason = 2
    if now.broken[leg] == 1:
        reason = 1
    return reason


@wp.func
def pose_of(group: Group, now: Now, leg: int):
    """Return what a leg's state is; see `tasks.motion.motion` and `kinematics.chain_points`."""
    hinge = now.q.shape[1] - 4
    a = now.q[leg, hinge]
    psi_2 = a + now.q[leg, hinge + 1]
    a_dot = now.v[leg, hinge]
    psi_2_dot = a_dot + now.v[leg, hinge + 1]

    E = 0.5 * group.lengths[leg, 4] * along(group.tilt)
    A = -E
    B = A + group.lengths[leg, 0] * along(a)
    left = B + group.lengths[leg, 1] * along(psi_2)
    F = left + group.lengths[leg, 5] * along(psi_2 + group.bend)

    pose = Pose()
    pose.foot = F
    pose.foot_dot = turned(B - A) * a_dot + turned(F - B) * psi_2_dot
    if group.grounded == 1:
        pose.hip = now.q[leg, 0]
        pose.hip_dot = now.v[leg, 0]
        pose.height = pose.hip + F[1] - group.foot_radius
        if pose.height <= TOUCHES:
            pose.contact = 1.0

    pose.reason = reason_of(group, now, leg, pose.foot, E)
    return pose


@wp.func
def closeness(squared: float, scale: float):
    """Return exp(-|error|^2 / scale^2)."""
    return wp.exp(-squared / (scale * scale))


@wp.func
def terms_of(group: Group, pose: Pose, row: int, effort: float):
    """Return the three reward terms of a task in its order; see `Task.terms`."""
    first = group.targets[row, 0]
    if group.kind == 1:
        height = closeness((pose.hip - first) * (pose.hip - first), 0.05 * group.size)
        return wp.vec3(height, pose.hip_dot * pose.hip_dot, effort)
    if group.kind == 2:
        return wp.vec3(wp.clamp(pose.height / first, 0.0, 1.0), effort, 0.0)

    off = pose.foot - wp.vec2(first, group.targets[row, 1])
    if group.kind == 0:
        return wp.vec3(closeness(wp.dot(off, off), 0.05 * group.size), effort, 0.0)
    slip = pose.foot_dot[0] + group.speed
    tracking = closeness(wp.dot(off, off), 0.1 * group.size)
    return wp.vec3(tracking, slip * slip * pose.contact, effort)


@wp.func
def sense(group: Group, now: Now, shown: Shown, leg: int, oldest: int):
    """Write what the sensors of A and E show."""
    steps = now.seen_q.shape[1]
    for motor in range(2):
        q = now.seen_q[leg, oldest % steps, motor]
        v = now.seen_v[leg, oldest % steps, motor]

        if group.seen_part > 0.0:
            newer_q = now.seen_q[leg, (oldest + 1) % steps, motor]
            newer_v = now.seen_v[leg, (oldest + 1) % steps, motor]
            q = newer_q + group.seen_part * (q - newer_q)
            v = newer_v + group.seen_part * (v - newer_v)
        if group.seen_step > 0.0:
            q = wp.rint(q / group.seen_step) * group.seen_step
        shown.observation[leg, motor] = q
        shown.observation[leg, 2 + motor] = v


@wp.func
def look(group: Group, now: Now, shown: Shown, leg: int, oldest: int, effort: float):
    """Write what a leg's agent gets; it has no reward and no end if it has just started."""
    pose = pose_of(group, now, leg)
    row = wp.min(now.count[leg], group.periods)
    sense(group, now, shown, leg, oldest)
    for i in range(2):
        shown.observation[leg, 4 + i] = pose.foot[i]
        shown.observation[leg, 6 + i] = pose.foot_dot[i]
    at = int(8)
    if group.grounded == 1:
        shown.observation[leg, 8] = pose.hip
        shown.observation[leg, 9] = pose.hip_dot
        shown.observation[leg, 10] = pose.contact
        at = 11
    for i in range(group.targets.shape[1]):
        shown.observation[leg, at + i] = group.targets[row, i]

    ran = 1.0 - float(now.fresh[leg])
    terms = ran * terms_of(group, pose, row, effort)
    reward = float(0.0)
    for i in range(3):
        shown.terms[i, leg] = terms[i]
        reward = reward + group.weights[i] * terms[i]
    shown.reward[leg] = reward

    reason = pose.reason * (1 - now.fresh[leg])
    shown.terminated[leg] = reason > 0
    shown.truncated[leg] = reason == 0 and now.count[leg] >= group.periods
    if shown.truncated[leg]:
        reason = OUT_OF_TIME
    shown.reason[leg] = reason
    now.over[leg] = wp.where(reason > 0, 1, 0)
