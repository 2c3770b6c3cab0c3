"""The recording of runs, whether of legs or of robots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import rrd
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario.run import Run
from fivebar_sim.walking.shown import recording as robots

if TYPE_CHECKING:
    import rerun as rr


def write(
    path: Path, runs: Sequence[Run], labels: Sequence[str] = (), identities: Sequence[str] = ()
) -> None:
    """Write the recording of one or more runs; see `rrd.write`.

    Raises:
        ConfigError: Some of the runs are of robots, and some are of legs.
        OSError: The file cannot be written.
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    if all_of_robots(runs):
        robots.write(path, runs, labels, identities)
    else:
        rrd.write(path, runs, labels, identities)


def send(stream: rr.RecordingStream, runs: Sequence[Run], labels: Sequence[str] = ()) -> None:
    """Send the recording of one or more runs to a stream; see `write`.

    Raises:
        ConfigError: Some of the runs are of robots, and some are of legs.
    """
    names = list(labels) or [run.scenario.name for run in runs]
    kind = robots if all_of_robots(runs) else rrd
    kind.send(stream, runs, names)


def all_of_robots(runs: Sequence[Run]) -> bool:
    """Return whether runs are of robots, not of legs.

    Raises:
        ConfigError: There are some of both.
    """
    of_robots = [isinstance(run.scenario, RobotScenario) for run in runs]
    if any(of_robots) and not all(of_robots):
        robot = runs[of_robots.index(True)].scenario.name
        leg = runs[of_robots.index(False)].scenario.name
        raise ConfigError(
            f"runs that are shown together must all be of robots or all of legs, got {robot} and "
            f"{leg}"
        )
    return all(of_robots)
