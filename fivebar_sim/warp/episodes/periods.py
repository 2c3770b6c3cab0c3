"""Warp's kernels of a control period: actions in, commands to the motors, what agents get out."""
# Warp reads annotations as types of its own, and its operators are not Python's.
# pyright: reportInvalidTypeForm=false, reportMissingImports=false, reportArgumentType=false
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportAssignmentType=false, reportGeneralTypeIssues=false

import warp as wp

from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.warp.episodes.draws import draw_start
from fivebar_sim.warp.episodes.looks import look
from fivebar_sim.warp.episodes.structs import Group, Now, Shown

wp.set_module_options({"enable_backward": False})

FASTEST = wp.constant(float(SPEED_LIMIT))


@wp.func
def within(group: Group, action: wp.array2d[float], leg: int, i: int, refused: wp.array[int]):
    """Return a number of an action, in its bounds; the first that is not is remembered."""
    given = action[leg, i]
    inside = wp.clamp(given, group.low[i], group.high[i])
    # Written so that NaN is outside too.
    if not (wp.abs(given - inside) <= group.slack[i]):
        wp.atomic_cas(refused, 0, -1, leg * action.shape[1] + i)
        inside = 0.5 * (group.low[i] + group.high[i])
    return inside


@wp.kernel
def act(
    group: Group,
    now: Now,
    action: wp.array2d[float],
    qvel: wp.array2d[float],
    refused: wp.array[int],
):
    """Send each leg's command on its way, and begin a control period."""
    leg = wp.tid()
    period = wp.min(now.count[leg], group.periods - 1)
    for motor in range(2):
        command = within(group, action, leg, motor, refused)
        if group.action == 1:
            rate = within(group, action, leg, 2 + motor, refused)
            command = command + group.servo[leg, 2] * rate
        now.sent[leg, period % now.sent.shape[1], motor] = command
        now.begun[leg, motor] = qvel[leg, qvel.shape[1] - 4 + 2 * motor]
        now.effort[leg, motor] = 0.0
    now.broken[leg] = 0


@wp.func
def acting(group: Group, now: Now, leg: int, motor: int, since: int):
    """Return the command that acts so many timesteps after the first one arrived."""
    found = now.rest[leg, motor]
    if since >= 0:
        period = (since // group.hold[leg] * group.hold[leg]) // group.every
        found = now.sent[leg, period % now.sent.shape[1], motor]
    if group.action != 2 and group.command_step > 0.0:
        found = wp.rint(found / group.command_step) * group.command_step
    return found


@wp.kernel
def send(group: Group, now: Now, j: int, table: wp.array3d[float], ctrl: wp.array2d[float]):
    """Send the motors what acts in step j of the period; see `control.bus.Bus`."""
    leg, motor = wp.tid()
    k = wp.min(now.count[leg], group.periods - 1) * group.every + j
    since = k - group.lag[leg]
    command = acting(group, now, leg, motor, since)
    if group.part[leg] > 0.0:
        older = acting(group, now, leg, motor, since - 1)
        command = command + group.part[leg] * (older - command)
    if group.action == 2:
        command = command + group.back_emf * now.begun[leg, motor]
    table[0, leg, motor] = command
    ctrl[leg, motor] = command


@wp.func
def applied(group: Group, leg: int, command: float, q: float, q_next: float, v_next: float):
    """Return the torque that a motor applied over a step; see `control.servo.applied_torque`."""
    asked = command
    if group.action != 2:
        spring = q
        if group.late == 1:
            spring = q_next
        asked = group.servo[leg, 0] * (command - spring)
        if group.clips == 1:
            asked = asked - group.servo[leg, 1] * v_next
    if group.clips == 1:
        asked = wp.clamp(asked, -group.limit, group.limit)
    return asked - group.servo[leg, 3] * v_next


@wp.kernel
def follow(
    group: Group,
    now: Now,
    j: int,
    table: wp.array3d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    overflow: wp.array[int],
    ignored: int,
):
    """Take note of step j of the period: torques, what sensors will show, whether it is sound."""
    leg = wp.tid()
    nq = qpos.shape[1]
    for i in range(nq):
        # Written so that NaN is unsound too.
        if not (wp.abs(qvel[leg, i]) < FASTEST and wp.isfinite(qpos[leg, i])):
            now.broken[leg] = 1
    if (overflow[leg] & ~ignored) != 0:
        now.broken[leg] = 1

    slot = (now.tick[0] + j) % now.seen_q.shape[1]
    for motor in range(2):
        i = nq - 4 + 2 * motor
        u = table[0, leg, motor]
        q = qpos[leg, i]
        v = qvel[leg, i]
        torque = applied(group, leg, u, now.before[leg, motor], q, v)
        now.effort[leg, 0] = now.effort[leg, 0] + torque * torque
        # In case that the leg breaks down, which shows the state of a period before.
        old = applied(group, leg, u, now.q[leg, i], now.q[leg, i], now.v[leg, i])
        now.effort[leg, 1] = now.effort[leg, 1] + old * old
        now.before[leg, motor] = q
        now.seen_q[leg, slot, motor] = q
        now.seen_v[leg, slot, motor] = v


@wp.func
def start(group: Group, now: Now, leg: int):
    """Begin an episode of a leg, at rest in one of its poses."""
    which = draw_start(now.random, leg, group.starts.shape[1])
    row = leg % group.starts.shape[0]
    for i in range(now.q.shape[1]):
        now.q[leg, i] = group.starts[row, which, i]
        now.v[leg, i] = 0.0

    for motor in range(2):
        q = now.q[leg, now.q.shape[1] - 4 + 2 * motor]
        now.before[leg, motor] = q
        now.rest[leg, motor] = wp.where(group.action == 2, 0.0, q)
        for step in range(now.seen_q.shape[1]):
            now.seen_q[leg, step, motor] = q
            now.seen_v[leg, step, motor] = 0.0
    now.count[leg] = 0
    now.fresh[leg] = 1
    now.broken[leg] = 0


@wp.func
def put(
    now: Now, leg: int, qpos: wp.array2d[float], qvel: wp.array2d[float], warm: wp.array2d[float]
):
    """Put a leg's physics into the state that is shown, at rest."""
    for i in range(qpos.shape[1]):
        qpos[leg, i] = now.q[leg, i]
        qvel[leg, i] = 0.0
        warm[leg, i] = 0.0


@wp.func
def keep(now: Now, leg: int, every: int, qpos: wp.array2d[float], qvel: wp.array2d[float]):
    """Show a leg's state; of one that broke down that of the period before."""
    nq = qpos.shape[1]
    if now.broken[leg] == 0:
        for i in range(nq):
            now.q[leg, i] = qpos[leg, i]
            now.v[leg, i] = qvel[leg, i]
        return

    steps = now.seen_q.shape[1]
    for back in range(wp.min(every, steps)):
        slot = (now.tick[0] + every - 1 - back) % steps
        for motor in range(2):
            now.seen_q[leg, slot, motor] = now.q[leg, nq - 4 + 2 * motor]
            now.seen_v[leg, slot, motor] = now.v[leg, nq - 4 + 2 * motor]


@wp.kernel
def finish(
    group: Group,
    now: Now,
    shown: Shown,
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warm: wp.array2d[float],
):
    """End a control period: what agents get, and new episodes."""
    leg = wp.tid()
    oldest = now.tick[0] + group.every
    keep(now, leg, group.every, qpos, qvel)
    now.count[leg] = now.count[leg] + 1
    now.fresh[leg] = 0
    effort = now.effort[leg, now.broken[leg]] / float(group.every)
    # The action of a leg that was over is thrown away: Gymnasium's next-step autoreset.
    if now.over[leg] == 1:
        start(group, now, leg)
        put(now, leg, qpos, qvel, warm)
        effort = 0.0

    look(group, now, shown, leg, oldest, effort)
    shown.ended[leg] = now.over[leg] == 1


@wp.kernel
def begin_anew(
    group: Group,
    now: Now,
    shown: Shown,
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warm: wp.array2d[float],
):
    """Begin the next episode of legs that are over, whose last observation is kept."""
    leg = wp.tid()
    if now.over[leg] == 0:
        return
    for i in range(shown.observation.shape[1]):
        shown.last[leg, i] = shown.observation[leg, i]
    reward = shown.reward[leg]
    terms = wp.vec3(shown.terms[0, leg], shown.terms[1, leg], shown.terms[2, leg])
    terminated = shown.terminated[leg]
    truncated = shown.truncated[leg]
    reason = shown.reason[leg]
    start(group, now, leg)
    put(now, leg, qpos, qvel, warm)

    look(group, now, shown, leg, 0, 0.0)
    # What belongs to the end of the last one.
    shown.reward[leg] = reward
    for i in range(3):
        shown.terms[i, leg] = terms[i]
    shown.terminated[leg] = terminated
    shown.truncated[leg] = truncated
    shown.reason[leg] = reason


@wp.kernel
def begin_all(
    group: Group,
    now: Now,
    shown: Shown,
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warm: wp.array2d[float],
):
    """Begin an episode of every leg."""
    leg = wp.tid()
    start(group, now, leg)
    put(now, leg, qpos, qvel, warm)
    look(group, now, shown, leg, 0, 0.0)
    shown.ended[leg] = False


@wp.kernel
def turn(now: Now, every: int):
    """Go on by a control period in what the sensors will show."""
    now.tick[0] = (now.tick[0] + every) % now.seen_q.shape[1]
