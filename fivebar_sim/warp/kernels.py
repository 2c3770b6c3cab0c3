"""Warp's kernels: commands in, states out, and torque limits that hold at the end of a step.

The limits are those of `simulation.clipping`, which explains modes; here a leg has a thread.
"""
# Warp reads annotations as types of its own, and its operators are not Python's.
# pyright: reportInvalidTypeForm=false, reportMissingImports=false, reportArgumentType=false
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportAssignmentType=false, reportGeneralTypeIssues=false
# ruff: noqa: UP018, RUF046 - a number that changes in a loop is told so by its type's call

import warp as wp

wp.set_module_options({"enable_backward": False})

MOST_MODES = wp.constant(9)
"""Modes of two motors with three each."""

NEVER = wp.constant(1e30)
"""More than any torque misses its mode by [N m]."""

SMALL = wp.constant(1e-3)
"""Part of a limit by which a step's torques may miss it in single precision, at an impact."""


@wp.kernel
def next_step(step: wp.array[int]):
    """Go on to the next step of a table of commands."""
    step[0] = step[0] + 1


@wp.kernel
def send(table: wp.array3d[float], step: wp.array[int], ctrl: wp.array2d[float]):
    """Send each leg (n, nu) its commands of the step, of a table (steps, n, nu)."""
    leg, i = wp.tid()
    ctrl[leg, i] = table[step[0], leg, i]


@wp.kernel
def keep(
    step: wp.array[int],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    constraint: wp.array2d[float],
    sensors: wp.array2d[float],
    iterations: wp.array[int],
    columns: wp.array[int],
    nq: int,
    nv: int,
    rows: wp.array3d[float],
):
    """Keep what is recorded of the step, in a table (steps, n, nq + 2 nv + 1 + sensors)."""
    leg = wp.tid()
    k = step[0]
    for i in range(nq):
        rows[k, leg, i] = qpos[leg, i]
    for i in range(nv):
        rows[k, leg, nq + i] = qvel[leg, i]
        rows[k, leg, nq + nv + i] = constraint[leg, i]
    rows[k, leg, nq + 2 * nv] = float(iterations[leg])
    for i in range(columns.shape[0]):
        rows[k, leg, nq + 2 * nv + 1 + i] = sensors[leg, columns[i]]


@wp.func
def side(asked: float, limit: float):
    """Return on which side a torque is beyond a limit, 0 within it and for NaN."""
    found = int(0)
    if asked > limit:
        found = 1
    if asked < -limit:
        found = -1
    return found


@wp.func
def row(a: int, e: int):
    """Return the number of a pair of modes, 0 to 8."""
    return 3 * ((a + 3) % 3) + (e + 3) % 3


@wp.func
def mode_of(number: int):
    """Return the mode of a digit: 0, 1, or -1 for 2."""
    found = number
    if number == 2:
        found = -1
    return found


@wp.func
def untried(tried: int, number: int):
    """Return a pair of modes, or the first one that was not tried where it was already."""
    # It would be tried for ever.
    if (tried >> number) & 1 == 0:
        return number
    found = int(0)
    while (tried >> found) & 1 == 1:
        found = found + 1
    return found


@wp.func
def ended(mode: int, asked: float, limit: float, slack: float):
    """Return the mode that a step's end calls for; on the limit, to rounding, it stays."""
    bound = limit
    if mode == 0:
        bound = limit + slack
    return side(asked + slack * float(mode), bound)


@wp.func
def missed(mode: int, asked: float, limit: float):
    """Return how far a torque is from what its mode calls for."""
    beyond = wp.abs(asked) - limit
    if mode != 0:
        beyond = limit - asked * float(mode)
    return wp.max(beyond, 0.0)


@wp.kernel
def begin(
    ctrl: wp.array2d[float],
    before_q: wp.array2d[float],
    before_v: wp.array2d[float],
    kp: wp.array2d[float],
    kd: wp.array2d[float],
    limit: wp.array2d[float],
    modes: wp.array2d[int],
    tried: wp.array[int],
    wrong: wp.array[int],
    least: wp.array[float],
):
    """Find the modes that MuJoCo chooses for a step by its start; arguments as in `judge`."""
    leg = wp.tid()
    nq = before_q.shape[1]
    nv = before_v.shape[1]
    nu = ctrl.shape[1]
    for motor in range(2):
        off = ctrl[leg, nu - 2 + motor] - before_q[leg, nq - 4 + 2 * motor]
        asked = kp[leg, motor] * off - kd[leg, motor] * before_v[leg, nv - 4 + 2 * motor]
        modes[leg, motor] = side(asked, limit[leg, motor])
    tried[leg] = 0
    least[leg] = NEVER
    # Until it is judged.
    wrong[leg] = 1


@wp.func
def choose(
    leg: int,
    misses: float,
    modes: wp.array2d[int],
    wanted: wp.array2d[int],
    tried: wp.array[int],
    least: wp.array[float],
    best: wp.array[int],
):
    """Choose the modes to try next: those wanted, any untried ones, at last the best of all."""
    present = row(modes[leg, 0], modes[leg, 1])
    if misses < least[leg]:
        least[leg] = misses
        best[leg] = present
    so_far = tried[leg] | (1 << present)
    tried[leg] = so_far

    number = best[leg]
    if so_far != (1 << MOST_MODES) - 1:
        number = untried(so_far, row(wanted[leg, 0], wanted[leg, 1]))
    wanted[leg, 0] = mode_of(number // 3)
    wanted[leg, 1] = mode_of(number % 3)


@wp.kernel
def judge(
    late: int,
    table: wp.array3d[float],
    step: wp.array[int],
    before_q: wp.array2d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    kp: wp.array2d[float],
    kd: wp.array2d[float],
    limit: wp.array2d[float],
    slack: wp.array2d[float],
    modes: wp.array2d[int],
    wanted: wp.array2d[int],
    tried: wp.array[int],
    wrong: wp.array[int],
    least: wp.array[float],
    best: wp.array[int],
    iterations: wp.array[int],
    unsolved: int,
    left: wp.array[int],
):
    """Find the legs whose motors ended the step in other modes than it was taken in.

    Those are counted in `left`, with the modes to try next in `wanted`. Where none agree, as
    rounding has it at an impact, the step is taken once more in those that missed by the least;
    one that they miss by more than `SMALL` of a limit is marked by its number of iterations.

    Args:
        late: Whether the spring acts at the end of a step, not at its start.
        table: Commands, (steps, n, nu); the motors' are the last two.
        step: The step, (1,).
        before_q: qpos before it, (n, nq); A and E are the fourth and the second from the end.
        qpos: qpos after it.
        qvel: qvel after it, (n, nv).
        kp: Gains on the angle [N m/rad], (n, 2).
        kd: Gains on the rate [N m s/rad], (n, 2).
        limit: Largest torques [N m], (n, 2).
        slack: How far off the limit still counts as on it [N m], (n, 2).
        modes: The modes of the step, (n, 2).
        wanted: The modes to try next, (n, 2).
        tried: A bit for each pair of modes that was tried, (n,).
        wrong: Whether a leg's step was to be taken (again), and now whether it still is, (n,).
        least: By how much its best modes so far miss their torques [N m], (n,).
        best: The number of these modes, (n,).
        iterations: Of the solver, (n,).
        unsolved: Iterations that mark a leg without modes that agree.
        left: The number of legs whose step is wrong, (1,).
    """
    leg = wp.tid()
    if wrong[leg] == 0:
        return

    nq = qpos.shape[1]
    nv = qvel.shape[1]
    differs = int(0)
    misses = float(0.0)
    part = float(0.0)
    for motor in range(2):
        spring = before_q[leg, nq - 4 + 2 * motor]
        if late == 1:
            spring = qpos[leg, nq - 4 + 2 * motor]
        u = table[step[0], leg, table.shape[2] - 2 + motor]
        v = qvel[leg, nv - 4 + 2 * motor]
        asked = kp[leg, motor] * (u - spring) - kd[leg, motor] * v
        mode = modes[leg, motor]
        wanted[leg, motor] = ended(mode, asked, limit[leg, motor], slack[leg, motor])
        if wanted[leg, motor] != mode:
            differs = 1
            by = missed(mode, asked, limit[leg, motor])
            misses = wp.max(misses, by)
            part = wp.max(part, by / limit[leg, motor])

    # The best of the modes was taken once more, and stays.
    if differs == 0 or tried[leg] == (1 << MOST_MODES) - 1:
        wrong[leg] = 0
        if differs == 1 and part > SMALL:
            iterations[leg] = unsolved
        return

    choose(leg, misses, modes, wanted, tried, least, best)
    wrong[leg] = 1
    wp.atomic_add(left, 0, 1)


@wp.kernel
def force(
    table: wp.array3d[float],
    step: wp.array[int],
    before_q: wp.array2d[float],
    before_v: wp.array2d[float],
    kp: wp.array2d[float],
    kd: wp.array2d[float],
    limit: wp.array2d[float],
    wanted: wp.array2d[int],
    wrong: wp.array[int],
    modes: wp.array2d[int],
    ctrl: wp.array2d[float],
    applied: wp.array2d[float],
):
    """Give the motors of wrong legs commands and joint torques for a step in the wanted modes.

    In mode 0 a step begins without torque; what its command then lacks comes as a joint torque,
    which MuJoCo does not clip. See `clipping.Clipping.forced`; arguments as in `judge`.
    """
    leg = wp.tid()
    if wrong[leg] == 0:
        return
    nq = before_q.shape[1]
    nv = before_v.shape[1]
    nu = ctrl.shape[1]
    for motor in range(2):
        mode = wanted[leg, motor]
        modes[leg, motor] = mode
        q = before_q[leg, nq - 4 + 2 * motor]
        v = before_v[leg, nv - 4 + 2 * motor]
        push = 2.0 * float(mode) * limit[leg, motor]
        acting = q + (push + kd[leg, motor] * v) / kp[leg, motor]
        lacks = float(0.0)
        if mode == 0:
            lacks = kp[leg, motor] * (table[step[0], leg, nu - 2 + motor] - acting)

        ctrl[leg, nu - 2 + motor] = acting
        applied[leg, nv - 4 + 2 * motor] = lacks
