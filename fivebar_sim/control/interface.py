"""What a controller is, and how the one that a scenario names is found."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.errors import ConfigError, FiveBarError, UnknownError, unknown
from fivebar_sim.files.installed import installed, load
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.motion import Motion

GROUP = "fivebar_sim.controllers"


class Observation(NamedTuple):
    """What the sensors of some legs say at a control step; arrays are (..., 2), in the order A, E.

    Attributes:
        time: Of the control step [s].
        theta: [rad].
        theta_dot: [rad/s].
    """

    time: float
    theta: Array
    theta_dot: Array


class Reference(NamedTuple):
    """What those legs shall do at the time of a control step; arrays are (..., 2).

    Attributes:
        foot: [m], with its rates foot_dot and foot_ddot.
        theta: (theta_A, theta_E) [rad], with their rates theta_dot and theta_ddot.
        force: What the world is expected to do to the foot [N].
        payload: Point mass that the foot carries [kg].
    """

    foot: Array
    foot_dot: Array
    foot_ddot: Array
    theta: Array
    theta_dot: Array
    theta_ddot: Array
    force: Array
    payload: float


@runtime_checkable
class Feedback(Protocol):
    """A controller that is asked once a control period, with what the sensors say.

    A small frozen object of gains, without memory: a scenario's table [controller] is read into
    it, so it is a msgspec Struct.

    Attributes:
        drive: Whether its commands are angles or torques.
        period: Time between two commands, a whole number of timesteps [s].
    """

    drive: ClassVar[Drive]

    @property
    def period(self) -> float:
        """Time between two commands [s]."""
        ...

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the commands (A, E) that hold until the next one [rad or N m], (..., 2)."""
        ...


@runtime_checkable
class Setpoints(Protocol):
    """A controller that plans every setpoint before the run: a small frozen object of gains.

    A scenario's table [controller] is read into it, so it is a msgspec Struct.
    """

    def setpoints(
        self, leg: FiveBar, servo: Servo, motion: Motion, integrator: Integrator
    ) -> Array:
        """Return the setpoints (theta_A, theta_E) that act in each of the N steps [rad], (N, 2)."""
        ...


def known() -> dict[str, EntryPoint]:
    """Return the installed controllers by name.

    Raises:
        ConfigError: If two packages bring a controller of one name.
    """
    return installed(GROUP, "controller")


def find(name: str) -> type[Any]:
    """Return the controller class of a name.

    Raises:
        ConfigError: Unknown name, a controller that cannot be imported, or that is none.
    """
    controllers = known()
    if name not in controllers:
        raise UnknownError(unknown("controller", name, controllers))

    value = controllers[name].value
    kind = load(controllers[name], "controller")

    struct = isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    if not struct or not any(callable(getattr(kind, m, None)) for m in ("setpoints", "command")):
        raise ConfigError(
            f"controller {name!r}: {value} must be a msgspec Struct with a method setpoints or "
            f"command, got {kind!r}"
        )

    return kind


def answer_of(name: str, ask: Callable[..., Array], *question: object) -> NDArray[Any]:
    """Return what a controller answers, as an array of whatever it is.

    Args:
        name: The controller's, for the message.
        ask: Its method.
        question: What it is given.

    Raises:
        ConfigError: It fails with anything but an error of this package, which passes.
    """
    try:
        return np.asarray(ask(*question))
    except FiveBarError:
        raise
    except Exception as error:  # a user's code may raise anything
        raise ConfigError(f"controller {name!r} failed: {type(error).__name__}: {error}") from error


def is_numbers(answer: NDArray[Any], shape: tuple[int, ...]) -> bool:
    """Return whether a controller's answer is real numbers, bools not among them, of a shape."""
    return answer.dtype.kind in "fiu" and answer.shape == shape


def name_of(controller: object) -> str:
    """Return the name of a controller's entry point, or of its class if it has none."""
    kind = type(controller)
    value = f"{kind.__module__}:{kind.__qualname__}"
    named = (name for name, entry in known().items() if entry.value == value)
    return next(named, kind.__name__)
