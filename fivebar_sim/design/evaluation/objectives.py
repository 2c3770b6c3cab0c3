"""What makes a design good: the objectives, from arrays (designs, samples) to one number each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.evaluation import reach_area
from fivebar_sim.design.evaluation.legs import Legs
from fivebar_sim.design.evaluation.motors import Motors
from fivebar_sim.design.evaluation.poses import Poses, Rates, side, slopes
from fivebar_sim.dynamics.chain import Pose
from fivebar_sim.dynamics.plane import Vector
from fivebar_sim.errors import ConfigError, unknown


class Driven(NamedTuple):
    """A foot motion of n designs with all that its motors do, arrays (n, N).

    Attributes:
        weight: Share of the time.
        seconds: How long it lasts [s], (1, 1) or (n, 1).
        poses: The poses.
        pose: Directions of the links and how the loop couples them.
        rates: How the links turn.
        torque: (tau_A, tau_E) [N m].
        payload: At the foot [kg].
    """

    weight: float
    seconds: Array
    poses: Poses
    pose: Pose
    rates: Rates
    torque: Vector
    payload: Array

    @property
    def speed(self) -> Vector:
        """(theta_dot_A, theta_dot_E) [rad/s]."""
        return self.rates.w[0], self.rates.w[3]


class Found(NamedTuple):
    """All that is known of n designs that keep to the geometric constraints.

    Attributes:
        legs: The legs.
        motors: Their motors.
        driven: The foot motions.
        worst: Largest condition number over all samples of motions and regions, (n,).
    """

    legs: Legs
    motors: Motors
    driven: list[Driven]
    worst: Array


class Objective(NamedTuple):
    """An objective.

    Attributes:
        name: Its name in words.
        unit: SI unit; "" for a pure number.
        sense: +1 where less is better, -1 where more is.
        needs: What a task must have for it: "motion", "limit", "winding".
        measure: Its value for each of n designs, (n,).
        text: What it is.
    """

    name: str
    unit: str
    sense: int
    needs: tuple[str, ...]
    measure: Callable[[Found], Array]
    text: str


def read(names: Any, where: str) -> tuple[str, ...]:
    """Return the names of a task's objectives.

    Raises:
        ConfigError: None, an unknown one, or one twice.
    """
    if not isinstance(names, list) or not names:
        raise ConfigError(f"{where}: objectives must be an array of names, got {names!r}")
    for name in names:
        if name not in CATALOGUE:
            raise ConfigError(f"{where}: objectives: {unknown('objective', str(name), CATALOGUE)}")
        if names.count(name) > 1:
            raise ConfigError(f"{where}: objectives has {name!r} twice")
    return tuple(names)


MISSING = {
    "motion": "a [motion.NAME]: a region says nothing of torques",
    "limit": "servo.limit: the torque at stall",
    "winding": "servo.kt and servo.resistance",
}


def check(names: Iterable[str], moves: bool, servos: Sequence[Servo], where: str) -> None:
    """Raise unless a task has what objectives need.

    Args:
        names: Objectives that are sought or bounded.
        moves: Whether the task has a foot motion.
        servos: The servos to choose from.
        where: The file, for messages.

    Raises:
        ConfigError: Names the objective and what is missing.
    """
    has = {
        "motion": moves,
        "limit": all(servo.limit is not None for servo in servos),
        "winding": all(servo.winding is not None for servo in servos),
    }

    for name in names:
        if name not in CATALOGUE:
            raise ConfigError(f"{where}: constraints: {unknown('objective', name, CATALOGUE)}")
        for need in CATALOGUE[name].needs:
            if not has[need]:
                raise ConfigError(
                    f"{where}: the objective {name!r} needs {MISSING[need]}; this task has none"
                )


def _mean(found: Found, measure: Callable[[Driven], Array]) -> Array:
    """Return the mean over the time of all motions, by their weights, (n,)."""
    total = sum(each.weight for each in found.driven)
    parts = [each.weight / total * measure(each).mean(axis=1) for each in found.driven]
    return np.add.reduce(parts)


def _most(found: Found, measure: Callable[[Driven], Array]) -> Array:
    """Return the largest value over all samples of all motions, (n,)."""
    return np.maximum.reduce([measure(each).max(axis=1) for each in found.driven])


def _torque_peak(found: Found) -> Array:
    return _most(found, lambda m: np.maximum(np.abs(m.torque[0]), np.abs(m.torque[1])))


def _torque_rms(found: Found) -> Array:
    of = [_mean(found, lambda m, k=k: m.torque[k] ** 2) for k in (0, 1)]
    return np.sqrt(np.maximum(*of))


def _heat(found: Found) -> Array:
    squares = _mean(found, lambda m: m.torque[0] ** 2 + m.torque[1] ** 2)
    return squares * (found.motors.resistance / found.motors.kt**2)[:, 0]


def _energy(found: Found) -> Array:
    def work(m: Driven) -> Array:
        A, E = (np.maximum(m.torque[k] * m.speed[k], 0.0) for k in (0, 1))
        return (A + E) * m.seconds

    return _mean(found, work)


def _balance(found: Found) -> Array:
    A, E = (_mean(found, lambda m, k=k: np.abs(m.torque[k])) for k in (0, 1))
    total = A + E
    # A leg that needs no torque at all shares it evenly.
    return np.abs(A - E) / np.where(total > 0.0, total, 1.0)


def _antagonism(found: Found) -> Array:
    """Copper heat as a multiple of that of the serial leg; see `dynamics.antagonism`."""
    own = _mean(found, lambda m: m.torque[0] ** 2 + m.torque[1] ** 2)
    return own / _mean(found, lambda m: _serial_squares(found.legs, m))


def _serial_squares(legs: Legs, m: Driven) -> Array:
    """Return the sum of the squared torques of the serial leg with links like L1 and BF."""
    J = slopes(legs, m.poses, m.pose)
    det = J.determinant
    (A_x, A_z), (E_x, E_z) = J
    tau_A, tau_E = m.torque
    f_x = (tau_A * E_z - tau_E * A_z) / det
    f_z = (A_x * tau_E - E_x * tau_A) / det
    # Its hip is at O, so that its links stand otherwise than side A's.
    rho = np.hypot(*legs.foot_offset)
    x, z = m.poses.F
    serial = side(x, z, legs.L1, rho, legs.mode[0])
    hip = x * f_z - z * f_x
    knee = rho * (serial.far[0] * f_z - serial.far[1] * f_x)
    # Where it does not reach there is nothing to compare with.
    return np.where(serial.slack >= 0.0, hip**2 + knee**2, np.nan)


def _mass(found: Found) -> Array:
    return np.add.reduce([link.mass for link in found.legs.links])[:, 0]


def _reflected(found: Found) -> Array:
    """Largest inertia that the world feels at the foot, in its worst direction."""

    def felt(m: Driven) -> Array:
        J = slopes(found.legs, m.poses, m.pose)
        M_AA, M_AE, M_EE = found.legs.chain(0.0).mass(m.pose)
        (A_x, A_z), (E_x, E_z) = J
        det2 = J.determinant**2
        # Trace and determinant of J^-T M J^-1, whose larger eigenvalue is asked for.
        trace = (
            M_AA * (E_x**2 + E_z**2)
            - 2.0 * M_AE * (A_x * E_x + A_z * E_z)
            + M_EE * (A_x**2 + A_z**2)
        ) / det2
        determinant = (M_AA * M_EE - M_AE**2) / det2
        return 0.5 * (trace + np.sqrt(np.maximum(trace**2 - 4.0 * determinant, 0.0)))

    return _most(found, felt)


def _force(found: Found) -> Array:
    """Least force that the foot can give in every direction, both motors at their limit at most."""

    def longest(m: Driven) -> Array:
        J = slopes(found.legs, m.poses, m.pose)
        lengths = (x * x + z * z for x, z in J)
        return np.sqrt(np.maximum(*lengths))

    return found.motors.limit[:, 0] / _most(found, longest)


CATALOGUE: dict[str, Objective] = {
    "torque_peak": Objective(
        "peak torque",
        "N m",
        1,
        ("motion",),
        _torque_peak,
        "largest torque of either motor in any motion",
    ),
    "torque_rms": Objective(
        "RMS torque",
        "N m",
        1,
        ("motion",),
        _torque_rms,
        "RMS torque of the motor that has more of it",
    ),
    "heat": Objective("heat", "W", 1, ("motion", "winding"), _heat, "copper heat of both motors"),
    "energy": Objective(
        "energy a step", "J", 1, ("motion",), _energy, "positive work of both motors in a step"
    ),
    "balance": Objective(
        "imbalance of A and E",
        "",
        1,
        ("motion",),
        _balance,
        "|2 share_A - 1| of the torque impulse: 0 is evenly shared",
    ),
    "antagonism": Objective(
        "heat over a serial leg's",
        "",
        1,
        ("motion",),
        _antagonism,
        "copper heat as a multiple of the serial leg's",
    ),
    "mass": Objective("mass", "kg", 1, (), _mass, "mass of the links and the foot"),
    "size": Objective(
        "longer side", "m", 1, (), lambda f: f.legs.size[:, 0], "length of the longer side"
    ),
    "longest": Objective(
        "longest link",
        "m",
        1,
        (),
        lambda f: f.legs.longest[:, 0],
        "longest link, L2 up to the foot",
    ),
    "reflected_inertia": Objective(
        "reflected inertia",
        "kg",
        1,
        ("motion",),
        _reflected,
        "largest inertia that is felt at the foot",
    ),
    "force": Objective(
        "foot force",
        "N",
        -1,
        ("motion", "limit"),
        _force,
        "force at the foot that no direction falls short of",
    ),
    "workspace_area": Objective(
        "workspace area",
        "m^2",
        -1,
        (),
        lambda f: reach_area.area(f.legs),
        "area that the foot reaches",
    ),
    "condition": Objective(
        "condition number",
        "",
        1,
        (),
        lambda f: f.worst,
        "worst condition number of the foot's Jacobian",
    ),
}
"""Every objective by its name."""
