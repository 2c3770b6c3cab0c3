"""How stable feedback is that holds its commands, and how stable the steps of a run make it look.

While a command is held the leg moves on, so that a spring kp pushes too late: over a period T it
takes kp T / 2 from the damping. A step of h moves the leg with the rate at its end, which is too
early: it adds kp h / 2. With h = T both cancel, and feedback that no real motor would bear, such as
a spring without any damper, looks stable. Here both are computed, in poses of the run:

    M dv/dt = u - k dq - d v,   u = K dq + D v of the last command      dq, v off the pose
    growth = ln(largest |eigenvalue| of the map from one command to the next) / T        [1/s]

once with the run's own steps and once with much finer ones.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.control import Feedback, Observation, Reference
from fivebar_sim.control.delay import in_steps
from fivebar_sim.control.interface import answer_of, is_numbers
from fivebar_sim.errors import FiveBarError
from fivebar_sim.motion import Motion
from fivebar_sim.scenario import Scenario

POSES = 64
"""Poses of a run that are looked at."""

FINER = 32
"""Parts of a step that stand for the real motion: what they damp is a thirty-second of a step's."""

OLDEST = 8
"""Most periods that a command may be late: beyond, the map would be too large to be worth it."""

ANGLE = 1e-6
RATE = 1e-3
"""Changes of what a controller is shown, for its slopes [rad, rad/s]."""


class Hold(NamedTuple):
    """How a command is held, in timesteps.

    Attributes:
        timestep: h [s].
        steps: From one command to the next, of the slower of controller and bus.
        late: From the state that a command answers to its effect, rounded.
    """

    timestep: float
    steps: int
    late: int

    @classmethod
    def of(cls, scenario: Scenario) -> Hold:
        """Return how a scenario's commands are held."""
        h = scenario.sim.timestep
        delays = (scenario.sensors.delay, scenario.servo.delay)
        late = sum(sum(in_steps(delay, h, scenario.steps)) for delay in delays)
        return cls(h, scenario.command, round(late))


class Plant(NamedTuple):
    """The leg in n poses, and what of the motors acts between commands.

    Attributes:
        M: Mass matrices [kg m^2], (n, 2, 2).
        stiffness: Of the servos in position drive [N m/rad].
        damping: Of the motors' joints [N m s/rad].
    """

    M: Array
    stiffness: float
    damping: float

    def flow(self, steps: int, h: float) -> tuple[Array, Array]:
        """Return what some steps make of a state and of a torque held, (n, 4, 4) and (n, 4, 2)."""
        eye = np.eye(2)
        # As MuJoCo takes a step: spring and damper act with the angle and the rate of its end.
        soft = np.linalg.inv(self.M + (h * self.damping + h * h * self.stiffness) * eye)
        step = np.zeros((len(self.M), 6, 6))
        step[:, 2:4, 0:2] = -h * self.stiffness * soft
        step[:, 2:4, 2:4] = soft @ self.M
        step[:, 2:4, 4:6] = h * soft
        step[:, 0:2] = h * step[:, 2:4]
        step[:, 0:2, 0:2] += eye
        step[:, 4:6, 4:6] = eye
        all_steps = np.linalg.matrix_power(step, steps)
        return all_steps[:, :4, :4], all_steps[:, :4, 4:]


class Stability(NamedTuple):
    """How fast errors grow, in n poses of a run.

    Attributes:
        time: Of each pose [s], (n,).
        real: Growth [1/s]; below 0 errors die out, (n,).
        shown: The same as the run's timestep makes it, (n,).
    """

    time: Array
    real: Array
    shown: Array

    def hidden(self, time: Array) -> Array:
        """Return the decades by which errors would have grown by some times, unseen, (N,)."""
        # What the run shows itself is not hidden: a leg may fall, or drift, and be right.
        rates = (self.real - np.maximum(self.shown, 0.0)) / np.log(10.0)
        so_far = 0.0
        grown = []
        for part in rates * np.diff(self.time, prepend=0.0):
            # Errors that have died out start anew from what there always is.
            so_far = max(0.0, so_far + float(part))
            grown.append(so_far)
        last = np.searchsorted(self.time, time, side="right") - 1
        return np.where(last < 0, 0.0, np.array(grown)[last])


def stability(
    scenario: Scenario, wanted: Motion, theta: Array, theta_dot: Array, stands: Bools
) -> Stability | None:
    """Return how stable a run's feedback is; None without feedback, or where it cannot be told.

    Args:
        scenario: The scenario that was run.
        wanted: Its planned motion.
        theta: (theta_A, theta_E) after each step [rad], (N, 2).
        theta_dot: Their rates [rad/s], (N, 2).
        stands: Whether the foot was on the ground, (N,): a leg that stands feels another mass, and
            counts as neither stable nor unstable.
    """
    controller = scenario.controller
    hold = Hold.of(scenario)
    if not isinstance(controller, Feedback) or hold.late > OLDEST * hold.steps:
        return None
    asked = np.arange(hold.steps, scenario.steps, hold.steps)
    if not len(asked):
        return None
    k = asked[np.unique(np.linspace(0, len(asked) - 1, POSES).astype(int))]
    try:
        M = dynamics.mass_matrix(scenario.leg, theta[k - 1], payload=wanted.payload)
        slopes = _slopes(scenario, controller, wanted, k, theta[k - 1], theta_dot[k - 1])
    except FiveBarError:
        return None

    servo = scenario.servo
    angles = controller.drive == "position"
    F = slopes * (servo.kp if angles else 1.0)
    if not angles:
        # The driver makes up for the back-EMF of the rate that it measures, until the next command.
        F[:, :, 2:] += servo.back_emf * np.eye(2)
    plant = Plant(M, servo.kp if angles else 0.0, servo.damping if angles else servo.back_emf)
    free = ~stands[k - 1]
    real, shown = (np.where(free, growth(plant, F, hold, parts), 0.0) for parts in (FINER, 1))
    return Stability(wanted.time[k], real, shown)


class _NoTime:
    """The time of poses that are shown together, which have none in common: any use fails."""

    def __bool__(self) -> bool:
        raise TypeError("there is no one time")

    __eq__ = __bool__  # pyright: ignore[reportAssignmentType]
    __hash__ = None  # pyright: ignore[reportAssignmentType]


def _slopes(
    scenario: Scenario,
    controller: Feedback,
    wanted: Motion,
    k: NDArray[np.int64],
    theta: Array,
    theta_dot: Array,
) -> Array:
    """Return how commands change with the angles and rates that they are shown, (n, 2, 4).

    Args:
        scenario: The scenario that was run.
        controller: Its controller.
        wanted: Its planned motion.
        k: Steps, (n,).
        theta: (theta_A, theta_E) at them [rad], (n, 2).
        theta_dot: Their rates [rad/s], (n, 2).

    Raises:
        FiveBarError: The controller has no answer close by.
    """
    change = np.repeat([ANGLE, RATE], 2)
    beside = np.concatenate([np.diag(change), -np.diag(change)])
    shown = np.concatenate([theta, theta_dot], axis=1)[:, None] + beside

    def asked(rows: slice, time: Any) -> Array:
        """Return the answers in some poses, (m, 8, 2)."""
        states = shown[rows].reshape(-1, 4)
        seen = Observation(time, states[:, :2], states[:, 2:])
        answer = _answer(scenario, controller, seen, _reference(wanted, np.repeat(k[rows], 8)))
        # Asked beside its own states it may answer what a run would refuse.
        if not is_numbers(answer, (len(states), 2)) or not np.isfinite(answer).all():
            raise FiveBarError("no answer close by")
        return answer.reshape(-1, 8, 2)

    try:
        answers = asked(slice(None), _NoTime())
    except FiveBarError:
        # One that looks at the time is asked in one pose after the other.
        times = (k * scenario.sim.timestep).tolist()
        answers = np.concatenate([asked(slice(i, i + 1), t) for i, t in enumerate(times)])
    rises = (answers[:, :4] - answers[:, 4:]) / (2.0 * change[:, None])
    return np.swapaxes(rises, 1, 2)


def accelerated(scenario: Scenario, wanted: Motion, k: int) -> Array:
    """Return what of a feedback's command at step k comes of the reference's accelerations, (2,).

    In N m, with the leg in the wanted motion; 0 without feedback, or where it has no answer.
    """
    controller = scenario.controller
    if not isinstance(controller, Feedback):
        return np.zeros(2)
    full = _reference(wanted, np.array([k]))
    still = np.zeros((1, 2))
    seen = Observation(k * scenario.sim.timestep, full.theta, full.theta_dot)
    less = full._replace(foot_ddot=still, theta_ddot=still)

    try:
        change = _answer(scenario, controller, seen, full)[0]
        change = change - _answer(scenario, controller, seen, less)[0]
    except FiveBarError:
        return np.zeros(2)
    return np.abs(change) * (scenario.servo.kp if controller.drive == "position" else 1.0)


def _answer(
    scenario: Scenario, controller: Feedback, seen: Observation, wanted: Reference
) -> NDArray[Any]:
    """Return what a controller answers, of whatever kind."""
    return answer_of(
        scenario.controller_name,
        lambda: controller.command(scenario.leg, scenario.servo, seen, wanted),
    )


def _reference(wanted: Motion, k: NDArray[np.int64]) -> Reference:
    """Return the references at some steps, for as many legs."""
    rows = [wanted.foot, wanted.foot_dot, wanted.foot_ddot]
    rows += [q[:, ::2] for q in (wanted.q, wanted.q_dot, wanted.q_ddot)]
    fields = [values[k] for values in (*rows, wanted.force)]
    return Reference(*fields, payload=wanted.payload)


def growth(plant: Plant, F: Array, hold: Hold, parts: int) -> Array:
    """Return the growth of errors [1/s], (n,), in steps that are cut into parts.

    Args:
        plant: The leg.
        F: Slopes of the held torque by angles and rates, (n, 2, 4).
        hold: How a command is held.
        parts: Into how many a step is cut.
    """
    h = hold.timestep / parts
    # From one state that is answered to the next: first the older command acts, then the newer.
    periods, late = divmod(hold.late, hold.steps)
    older_x, older_u = plant.flow(late * parts, h)
    newer_x, newer_u = plant.flow((hold.steps - late) * parts, h)

    # Beside the state the map has the commands that are still to act, the newest first.
    map_ = np.zeros((len(F), 6 + 2 * periods, 6 + 2 * periods))
    map_[:, :4, :4] = newer_x @ older_x
    map_[:, :4, -2:] = newer_x @ older_u
    if periods:
        map_[:, :4, -4:-2] += newer_u
    else:
        map_[:, :4, :4] += newer_u @ F
    map_[:, 4:6, :4] = F
    map_[:, 6:, 4:-2] = np.eye(2 * periods)
    largest = np.abs(np.linalg.eigvals(map_)).max(axis=1)
    return np.log(np.maximum(largest, 1e-12)) / (hold.steps * hold.timestep)
