"""The errors raised for bad input: one-line messages, with the facts as attributes.

Every class also inherits from a builtin error, so that callers may catch either.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class FiveBarError(Exception):
    """Base of every error that fivebar-sim raises on purpose."""


class ArgumentError(FiveBarError, ValueError):
    """An argument of the wrong shape, type or name."""


class GeometryError(FiveBarError, ValueError):
    """An impossible leg: a length, mass or mode outside its legal range."""


class PoseError(FiveBarError, ValueError):
    """One or more poses of a batch that do not exist, or have no finite answer.

    Attributes:
        index: Index of the first bad pose in the batch; () for a single pose.
    """

    def __init__(self, message: str, index: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.index = index


class UnreachableError(PoseError):
    """Foot targets out of reach."""


class LoopOpenError(PoseError):
    """Motor angles at which the links do not meet at C."""


class SingularError(PoseError):
    """Poses at which the requested rate or Jacobian is infinite."""


class ConfigError(FiveBarError, ValueError):
    """A scenario, leg or path file with an illegal value; the message names file and key."""


class UnknownError(ConfigError):
    """A key or a name that nothing has; the message lists those that there are, with a guess."""


class WorkersError(FiveBarError, RuntimeError):
    """Workers that are not there, or are gone; what they have done so far is kept."""


class OptionError(ArgumentError, ConfigError):
    """An option of an environment whose table or file has an illegal value."""


class DivergedError(FiveBarError, RuntimeError):
    """A simulation that broke down.

    Attributes:
        time: Simulated time of the first bad step [s].
    """

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message)
        self.time = time


class ExtraError(FiveBarError, ImportError):
    """A package that is not installed, because only an extra of fivebar-sim asks for it."""


class RunDirectoryError(FiveBarError, OSError):
    """A run directory that cannot be written, replaced or read."""


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Return the message for a name that is not among the known ones, with a guess.

    Args:
        what: Kind of thing, in the singular ("preset").
        name: The unknown name.
        known: The legal names.
    """
    legal = sorted(known)
    # Letters that differ in case only are the nearest of all: leg.l2 for leg.L2.
    lower = {each.lower(): each for each in reversed(legal)}
    close = get_close_matches(name.lower(), lower, n=1)
    hint = f" (did you mean {lower[close[0]]!r}?)" if close else ""
    return f"unknown {what} {name!r}; known: {', '.join(legal)}{hint}"
