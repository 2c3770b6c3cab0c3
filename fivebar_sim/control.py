"""What a controller is, and how the one that a scenario names is found."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Any, Protocol, runtime_checkable

import msgspec

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.geometry import FiveBar
from fivebar_sim.motion import Motion
from fivebar_sim.servo import Integrator, Servo

GROUP = "fivebar_sim.controllers"


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
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=GROUP):
        if entry.name in found and found[entry.name].value != entry.value:
            raise ConfigError(
                f"two controllers are called {entry.name!r}: {found[entry.name].value} and "
                f"{entry.value}; uninstall one"
            )
        found[entry.name] = entry
    return found


def find(name: str) -> type[Any]:
    """Return the controller class of a name.

    Raises:
        ConfigError: Unknown name, a controller that cannot be imported, or that is none.
    """
    controllers = known()
    if name not in controllers:
        raise ConfigError(unknown("controller", name, controllers))
    value = controllers[name].value
    try:
        kind = controllers[name].load()
    except Exception as error:  # what an import runs may raise anything
        raise ConfigError(
            f"cannot load controller {name!r} from {value}: {type(error).__name__}: {error}"
        ) from error
    struct = isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    if not struct or not callable(getattr(kind, "setpoints", None)):
        raise ConfigError(
            f"controller {name!r}: {value} must be a msgspec Struct with a method setpoints, "
            f"got {kind!r}"
        )
    return kind
