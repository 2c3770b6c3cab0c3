"""What the kernels of episodes know: a group of legs that shares a task, and where each of them is.

Structs of Warp: numbers and arrays (n, ...) on the device. A leg has a thread.
"""
# pyright: reportInvalidTypeForm=false, reportMissingImports=false
# pyright: reportAttributeAccessIssue=false

import warp as wp


@wp.struct
class Group:
    """What never changes.

    Attributes:
        kind: 0 track, 1 stand, 2 hop, 3 gait.
        action: 0 position, 1 motion, 2 torque.
        every, periods: Timesteps in a control period; periods in an episode.
        grounded: Whether the hip moves.
        late: Whether the spring acts at the end of a step.
        clips: Whether the servos have a limit.
        s_A, s_E, assembly: The branch.
        tilt, bend: [rad].
        foot_radius, size: Of the nominal leg [m].
        limit: Largest torque [N m].
        back_emf: [N m s/rad].
        speed: The belt's [m/s].
        command_step, seen_step: Resolutions of commands and of sensors [rad].
        seen_part: The part of a timestep in which the sensors' delay ends.
        low, high, slack: Bounds of an action, and how far rounding may leave them, (size,).
        lengths: L1..L6 and the size [m], (n, 7).
        servo: kp, kd, what a rate setpoint leads by, and the unclipped damping, (n, 4).
        lag, part: Delay of commands in whole timesteps, and the part of one beyond, (n,).
        hold: Timesteps between two commands on the bus, (n,).
        weights: Of the reward terms, (3,); a task with two has a zero.
        targets: The observation's known parts, (periods + 1, size).
        starts: Poses at rest, (n or 1, m, nq).
    """

    kind: int
    action: int
    every: int
    periods: int
    grounded: int
    late: int
    clips: int
    s_A: float
    s_E: float
    assembly: float
    tilt: float
    bend: float
    foot_radius: float
    size: float
    limit: float
    back_emf: float
    speed: float
    command_step: float
    seen_step: float
    seen_part: float
    low: wp.array[float]
    high: wp.array[float]
    slack: wp.array[float]
    lengths: wp.array2d[float]
    servo: wp.array2d[float]
    lag: wp.array[int]
    part: wp.array[float]
    hold: wp.array[int]
    weights: wp.array[float]
    targets: wp.array2d[float]
    starts: wp.array3d[float]


@wp.struct
class Now:
    """Where each leg is.

    Attributes:
        count: Control periods since its start, (n,).
        fresh, over, broken: Whether it has just started, is over, broke down, (n,).
        q, v: The state that is shown, (n, nq).
        rest: Commands until the first one arrives, (n, 2).
        sent: The last commands, by period modulo the length, (n, periods, 2).
        begun: Rates of the motors at the period's start [rad/s], (n, 2).
        before: Motor angles before a step [rad], (n, 2).
        effort: Sum of the squared torques [N^2 m^2], and of what they would be in the state of a
            period before, (n, 2).
        seen_q, seen_v: What the sensors will show, by timestep modulo the length, (n, steps, 2).
        tick: Where the next timestep goes there, (1,).
        random: Generators, see `draws`, (n, 6).
    """

    count: wp.array[int]
    fresh: wp.array[int]
    over: wp.array[int]
    broken: wp.array[int]
    q: wp.array2d[float]
    v: wp.array2d[float]
    rest: wp.array2d[float]
    sent: wp.array3d[float]
    begun: wp.array2d[float]
    before: wp.array2d[float]
    effort: wp.array2d[float]
    seen_q: wp.array3d[float]
    seen_v: wp.array3d[float]
    tick: wp.array[int]
    random: wp.array2d[wp.uint64]


@wp.struct
class Shown:
    """What agents get, as in `tasks.episodes.Outcome`.

    Attributes:
        observation, last: The observations, and those at the end of episodes, (n, size).
        reward: (n,).
        terms: (3, n).
        terminated, truncated: (n,).
        reason: (n,).
        ended: Whether an episode ended in this step, (n,).
    """

    observation: wp.array2d[float]
    last: wp.array2d[float]
    reward: wp.array[float]
    terms: wp.array2d[float]
    terminated: wp.array[bool]
    truncated: wp.array[bool]
    reason: wp.array[int]
    ended: wp.array[bool]
