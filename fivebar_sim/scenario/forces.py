"""Foot forces: the force F(t) of the world on the foot, in the hip frame.

A profile is a frozen table of numbers with a `kind`; `profile.at(time, path)` is the force.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any, Self, get_args

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import paths
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import FootPath, Gait
from fivebar_sim.paths.base import Pair, check_pair, times
from fivebar_sim.paths.track import TimedPairs, read_bytes, read_mapped, read_track

__all__ = ["KINDS", "Constant", "Csv", "FootForce", "ForceSpec", "Stance"]

STRONGEST = 1e6
"""Upper end of forces [N]."""

HEADERS = {("time_s", "x_N", "z_N"): 1.0}
"""The legal header of a CSV, with its unit in newtons."""

WHAT = "foot force"


class FootForce(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """A force on the foot over time; each kind overrides `at`, and `end` if it stops."""

    @property
    def end(self) -> float:
        """Last time at which the force is defined [s]; inf if it goes on for ever."""
        return math.inf

    def at(self, time: ArrayLike, path: FootPath) -> Array:
        """Return the force of the world on the foot.

        Args:
            time: [s], shape (...).
            path: The foot's path, for kinds that depend on it.

        Returns:
            (Fx, Fz) [N] in the hip frame, shape (..., 2).

        Raises:
            ArgumentError: Unless every time is in [0, end], or the path lacks what the kind needs.
        """
        raise NotImplementedError

    def resolve(self, folder: Path) -> Self:
        """Return the force with its files read and checked; names are relative to folder.

        Raises:
            ConfigError: A file that cannot be read, or that holds an illegal value.
        """
        del folder  # only the kinds that read a file need it
        return self


class Constant(FootForce, frozen=True, tag="constant"):
    """The same force at all times.

    Attributes:
        value: (Fx, Fz) [N].
    """

    value: Pair

    def __post_init__(self) -> None:
        check_pair(self, "value", "N", high=STRONGEST)

    def at(self, time: ArrayLike, path: FootPath) -> Array:
        """Return F = value; see `FootForce.at`."""
        del path
        return np.full((*times(time, self.end).shape, 2), self.value)


class Stance(FootForce, frozen=True, tag="stance"):
    """A half sine over each planned stance of a gait path, and nothing in its swing.

    Attributes:
        peak: (Fx, Fz) in the middle of the stance [N].
    """

    peak: Pair

    def __post_init__(self) -> None:
        check_pair(self, "peak", "N", high=STRONGEST)

    def at(self, time: ArrayLike, path: FootPath) -> Array:
        """Return the force; see `FootForce.at`.

            F = peak sin(pi c / duty) for c < duty,   F = 0 from there on

        with c = path.cycle(time), the planned touch-down at c = 0, which keeps to the path's ramp.

        Raises:
            ArgumentError: A path other than a gait: it has no stance.
        """
        if not isinstance(path, Gait):
            raise ArgumentError(
                'a force of kind "stance" needs a path of kind "gait", got '
                f'"{path.__struct_config__.tag}"'
            )
        # The path's own clock, so that the force keeps to the stance also within the ramp.
        cycle = path.cycle(time)
        sine = np.where(cycle < path.duty, np.sin(np.pi * cycle / path.duty), 0.0)
        return sine[..., None] * np.array(self.peak)


# dict=True: cached_property stores its value in the object's __dict__, which a Struct lacks.
class Csv(FootForce, frozen=True, tag="csv", dict=True):
    """Straight lines between the rows of a CSV file, whose first time becomes t = 0.

    The header is `time_s,x_N,z_N`, columns in any order; lines that start with # are comments. The
    file is read when first needed, once per object; `resolve` reads it at once.

    Attributes:
        file: Name of the CSV, relative to the scenario's folder (unresolved: the current one).
        columns: Which column of a log of any kind is `time`, `x` and `z`, as in a table [log]; left
            out: the header says so.
    """

    file: str
    columns: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        # No system takes a null byte in a name: Python raises a bare ValueError for one.
        if not self.file or "\0" in self.file:
            raise ArgumentError(f"file must be the name of a CSV file, got {self.file!r}")

    @property
    def end(self) -> float:
        """The sampled span [s]."""
        return self._track.span

    def at(self, time: ArrayLike, path: FootPath) -> Array:
        """Return the line between the two rows around each time; see `FootForce.at`.

        Raises:
            ArgumentError: Unless every time is in [0, end].
            ConfigError: As `resolve`, if the file was not read yet.
        """
        del path
        t = times(time, self.end)
        track = self._track
        return np.stack([np.interp(t, track.time, F) for F in track.pair.T], axis=-1)

    def resolve(self, folder: Path) -> Self:
        """Return the force bound to the file in folder, read and checked.

        Raises:
            ConfigError: The file cannot be read, or a line of it is illegal; gives its number.
        """
        bound = msgspec.structs.replace(self, file=str((folder / self.file).absolute()))
        bound.check_file()
        return bound

    def check_file(self) -> None:
        """Read the file now, so that a bad one is refused before the run and not during it.

        Raises:
            ConfigError: What `resolve` raises.
        """
        _ = self._track

    @cached_property
    def content(self) -> bytes:
        """All of the file, as it was when it was first needed; later changes do not count."""
        return read_bytes(Path(self.file), WHAT)

    @cached_property
    def _track(self) -> TimedPairs:
        if self.columns is None:
            return read_track(self.content, HEADERS, WHAT, Path(self.file))
        from fivebar_sim.logs import channels

        return read_mapped(self.content, self.columns, channels.FORCE, self.file)


ForceSpec = Constant | Csv | Stance
KINDS: dict[str, type[FootForce]] = {
    str(kind.__struct_config__.tag): kind for kind in get_args(ForceSpec)
}

READ = (paths.Csv, paths.Angles, Csv)
"""Kinds of paths and forces that read a file, which goes with a resolved scenario."""
