"""The foot path of a CSV file: through its points a smooth spline in time, lines, or steps.

The header is `time_s,x_mm,z_mm` or `time_s,x_m,z_m`, columns in any order; positions are in the
hip frame. Lines that start with # are comments. Times are in seconds and need not be regular.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self, get_args

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.paths.base import TIME_ROUNDING, FootPath, Sample, check_number
from fivebar_sim.paths.spline import Spline
from fivebar_sim.paths.track import TimedPairs, read_bytes, read_mapped, read_track

HEADERS = {("time_s", "x_mm", "z_mm"): 1e-3, ("time_s", "x_m", "z_m"): 1.0}
"""The legal headers, each with its unit in metres."""

WHAT = "foot path"

Interpolation = Literal["cubic", "linear", "hold"]


class _Curve(NamedTuple):
    spline: Spline
    span: float
    period: float | None


# dict=True: cached_property stores its value in the object's __dict__, which a Struct lacks.
class Csv(FootPath, frozen=True, tag="csv", dict=True):
    """A path in time through the points of a CSV file, by default smooth up to the acceleration.

    The file's first time becomes t = 0. The file is read when first needed, once per object;
    `resolve` reads it at once.

    The period of a periodic path is the sampled span if its last point repeats the first. Otherwise
    it returns to its first point after one more sampling interval, the median one, or at `period`.

    Attributes:
        file: Name of the CSV, relative to the scenario's folder (unresolved: the current one).
        periodic: Whether the path repeats, smoothly across the seam; else it ends with its file.
        given: The key `period` of a table: overrides the rule above [s].
        interpolation: Between the points: "cubic", a spline, which overshoots at corners; "linear",
            straight lines at constant speed, which jumps from line to line; "hold", the last
            point until the next one comes, as from a controller that sends them one by one.
        columns: Which column of a log of any kind is `time`, `x` and `z`, as in a table [log]; left
            out: the header says so.
    """

    file: str
    periodic: bool = False
    given: float | None = msgspec.field(default=None, name="period")
    interpolation: Interpolation = "cubic"
    columns: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        # No system takes a null byte in a name: Python raises a bare ValueError for one.
        if not self.file or "\0" in self.file:
            raise ArgumentError(f"file must be the name of a CSV file, got {self.file!r}")
        kinds = get_args(Interpolation)
        if self.interpolation not in kinds:
            raise ArgumentError(unknown("interpolation", str(self.interpolation), kinds))
        if self.given is not None:
            check_number("period", self.given, "s", low=0.0, strict=True)
            if not self.periodic:
                raise ArgumentError(f"period needs periodic = true, got {self.given!r} s without")

    @property
    def period(self) -> float | None:
        """Time after which the path repeats [s], or None if it is not periodic."""
        return self._curve.period

    @property
    def span(self) -> float:
        """The sampled span [s], or inf if the path is periodic."""
        return self._curve.span if self._curve.period is None else math.inf

    @property
    def jumps(self) -> bool:
        """Whether the target jumps from point to point."""
        return self.interpolation == "hold"

    @property
    def knots(self) -> Array:
        """Times of the points, of the first one once more where a period ends [s], (n,)."""
        knots = self._curve.spline.knots
        return knots[np.isfinite(knots)]

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the path and its own derivatives; see `FootPath.nominal`.

        The spline's boundary is periodic, or else "not-a-knot". Lines and steps have the rates that
        hold until the next point: the jumps there have none.

        Raises:
            ArgumentError: Unless every time is in [0, span].
            ConfigError: As `resolve`, if the file was not read yet.
        """
        spline, _, period = self._curve
        t = self._times(time)
        # Beyond its knots the last piece would go on.
        t = t if period is None else np.mod(t, period)
        return Sample(*spline.evaluate(t))

    def resolve(self, folder: Path) -> Self:
        """Return the path bound to the file in folder, read and checked.

        Raises:
            ConfigError: The file cannot be read, a line of it is illegal (the message gives its
                number), the period does not fit the points, or the path ends within the ramp.
        """
        bound = msgspec.structs.replace(self, file=str((folder / self.file).absolute()))
        bound.check_file()
        return bound

    def check_file(self) -> None:
        """Read the file now, so that a bad one is refused before the run and not during it.

        Raises:
            ConfigError: What `resolve` raises.
        """
        _ = self._curve

    @cached_property
    def content(self) -> bytes:
        """All of the file, as it was when it was first needed; later changes do not count."""
        return read_bytes(Path(self.file), WHAT)

    def _read(self) -> TimedPairs:
        """Return the file's points."""
        if self.columns is None:
            return read_track(self.content, HEADERS, WHAT, Path(self.file))
        from fivebar_sim.logs import channels

        return read_mapped(self.content, self.columns, channels.PATH, self.file)

    @cached_property
    def _curve(self) -> _Curve:
        track = self._read()
        if not self.periodic:
            if not self.ramp <= track.span:
                raise ConfigError(
                    f"{self.file}: ramp must be in [0, {track.span:g}] s, the time that the path "
                    f"lasts, got {self.ramp:g} s"
                )
            return _Curve(self._through(*track), track.span, None)

        time, foot = _close_loop(track, self.given, self.file)
        return _Curve(self._through(time, foot), track.span, float(time[-1]))

    def _through(self, time: Array, foot: Array) -> Spline:
        """Return what lies between the points."""
        if self.interpolation == "linear":
            return Spline.straight(time, foot)
        if self.interpolation == "hold":
            return Spline.steps(time, foot)
        return Spline.through(time, foot, periodic=self.periodic)


def _close_loop(track: TimedPairs, period: float | None, where: str) -> TimedPairs:
    """Return a track whose last point is its first, one period later."""
    time, foot = track
    span = track.span
    # True counts as 1: a last point that repeats the first is not one more.
    distinct = len(time) - track.closed
    if distinct < 3:
        raise ConfigError(
            f"{where}: a periodic path needs at least 3 distinct points, got {distinct}"
        )

    if period is None:
        period = span if track.closed else span + float(np.median(np.diff(time)))

    same = math.isclose(period, span, rel_tol=TIME_ROUNDING)
    if same and track.closed:
        # The periodic spline wants both ends equal to the last bit.
        return TimedPairs(time, np.concatenate([foot[:-1], foot[:1]]))

    if same or not period > span:
        relation = ">=" if track.closed else ">"
        raise ConfigError(
            f"{where}: period must be {relation} {span:.9g} s, the sampled span, got {period:.9g} s"
        )
    return TimedPairs(np.append(time, period), np.concatenate([foot, foot[:1]]))
