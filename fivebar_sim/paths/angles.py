"""The foot path of a table of motor angles, such as a log's: through forward kinematics."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import msgspec
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.foot_motion import foot_motion
from fivebar_sim.kinematics.logged import check_closes
from fivebar_sim.paths.base import FootPath, Sample
from fivebar_sim.paths.spline import Spline
from fivebar_sim.paths.track import read_bytes

if TYPE_CHECKING:
    from fivebar_sim.logs import Log

WHAT = "table of angles"

NEEDED = ("theta_A", "theta_E")


# dict=True: what belongs to a leg and to the file's content is kept beside the fields.
class Angles(FootPath, frozen=True, tag="angles", dict=True):
    """The foot at the motor angles of a file, by the leg's forward kinematics.

    At the rows the foot is exactly theirs. Between them the angles are a cubic spline in time, so
    that the foot is smooth up to its acceleration, or as they were given: on straight lines, or
    held until the next row. The file's first time becomes t = 0.

    Attributes:
        file: CSV of any kind, JSON lines, Parquet or MCAP, relative to the scenario's folder.
        columns: Which column is what, as in a table [log]: time, theta_A, theta_E, and rate, start,
            end, jumps; left out: columns of these names, in SI units.
        interpolation: Between the rows: "cubic", "linear" or "hold".
    """

    file: str
    columns: dict[str, Any] | None = None
    interpolation: Literal["cubic", "linear", "hold"] = "cubic"

    @classmethod
    def of_log(cls, log: Log) -> Self:
        """Return the path of a log that was read, without a ramp."""
        path = cls(file=log.where, ramp=0.0)
        vars(path)["log"] = log
        return path

    def __post_init__(self) -> None:
        super().__post_init__()
        # No system takes a null byte in a name: Python raises a bare ValueError for one.
        if not self.file or "\0" in self.file:
            raise ArgumentError(f"file must be the name of a log, got {self.file!r}")

    @property
    def content(self) -> bytes:
        """All of the file, as it was when it was first needed; later changes do not count."""
        kept = vars(self)
        if "content" not in kept:
            kept["content"] = read_bytes(Path(self.file), WHAT)
        return kept["content"]

    @property
    def log(self) -> Log:
        """The angles, as `logs.read` reads them, without the rows in which one is missing."""
        # The reader is as large as all paths, few of which are read by it.
        from fivebar_sim import logs
        from fivebar_sim.logs import channels

        kept = vars(self)
        if "log" not in kept:
            table = dict.fromkeys(("time", *NEEDED))
            given = {name: name for name in table} if self.columns is None else self.columns
            told = logs.read_map(given, f"{self.file}: path.columns")
            kept["log"] = logs.read(self.content, told, channels.LEG, NEEDED, self.file)
        return kept["log"]

    @property
    def span(self) -> float:
        """The sampled span [s]."""
        time, _ = self.log.complete(*NEEDED)
        return float(time[-1] - time[0])

    @property
    def jumps(self) -> bool:
        """Whether the target jumps from row to row."""
        return self.interpolation == "hold"

    @property
    def spline(self) -> Spline:
        """The angles over time [rad]."""
        kept = vars(self)
        if "spline" not in kept:
            time, theta = self.log.complete(*NEEDED)
            kept["spline"] = _pieces(time - time[0], theta, self.interpolation)
        return kept["spline"]

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the foot at the angles, with its own derivatives; see `FootPath.nominal`.

        Raises:
            ArgumentError: Unless every time is in [0, span], or before a leg is known.
        """
        leg = vars(self).get("leg")
        if leg is None:
            raise ArgumentError("a path of angles needs its leg: call of_leg(leg) first")
        return Sample(*foot_motion(leg, *self.spline.evaluate(self._times(time))))

    def resolve(self, folder: Path) -> Self:
        """Return the path bound to the file in folder, read and checked.

        Raises:
            ConfigError: The file cannot be read, or the path ends within its ramp.
        """
        bound = msgspec.structs.replace(self, file=str((folder / self.file).absolute()))
        if not bound.ramp <= bound.span:
            raise ConfigError(
                f"{bound.file}: ramp must be in [0, {bound.span:g}] s, the time that the angles "
                f"last, got {bound.ramp:g} s"
            )
        return bound

    def of_leg(self, leg: FiveBar) -> Self:
        """Return the path of a leg.

        Raises:
            LoopOpenError: The leg cannot have such angles; says when, and guesses why.
        """
        if vars(self).get("leg") == leg:
            return self
        time, theta = self.log.complete(*NEEDED)
        check_closes(leg, time, theta, self.file)
        # What was read is the same for all legs.
        bound = msgspec.structs.replace(self)
        vars(bound).update(vars(self), leg=leg)
        return bound


def _pieces(time: Array, theta: Array, interpolation: str) -> Spline:
    """Return angles between rows: a spline, straight lines, or each row until the next."""
    if interpolation == "cubic":
        return Spline.through(time, theta)
    return Spline.straight(time, theta) if interpolation == "linear" else Spline.steps(time, theta)
