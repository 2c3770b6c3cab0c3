"""`fivebar sweep`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim.cli.common import NO_WORDS, Maybe, Settings, Words, screen
from fivebar_sim.cli.progress import Progress
from fivebar_sim.cli.terminal import FAILED, say
from fivebar_sim.errors import ConfigError

if TYPE_CHECKING:
    from fivebar_sim.sweep.study import Study
    from fivebar_sim.workers.here import Workers

Vary = UseAppendAction[Annotated[Words, arg(metavar="KEY=LOW:HIGH:N")]]
Plot = UseAppendAction[Annotated[Words, arg(metavar="METRIC")]]
WORTH = 50_000
"""Physics steps that are worth a process: two seconds of simulation, planning and measuring."""

Over = UseAppendAction[Annotated[Words, arg(metavar="KEY")]]


def sweep(
    scenario: Positional[Annotated[str, arg(metavar="SCENARIO")]],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    vary: Vary = NO_WORDS,
    settings: Settings = NO_WORDS,
    sample: Maybe[int] = None,
    seed: int = 0,
    plot: Plot = NO_WORDS,
    over: Over = NO_WORDS,
    processes: int = 0,
    ray: Annotated[Maybe[str], arg(metavar="HOST:PORT")] = None,
    quiet: bool = False,
) -> int:
    """Simulate a scenario for all values of some of its keys.

    DIR/runs.parquet gets a row a run: the varied keys, every metric in SI units, the verdict, and
    the limits and guards that do not hold; a point that cannot be run has its error there. Broken
    off, the same command goes on where it was. Exit status 1 if no point could be run.

    Args:
        scenario: Name of a shipped scenario, or path of a TOML file.
        out: The sweep's directory.
        vary: What is varied: N values from LOW to HIGH, or KEY=VALUE,VALUE,...; all combinations of
            several. Two keys that are always alike: leg.L2,leg.L3=0.05:0.08:31.
        settings: Change one key of every run, e.g. duration=1; may be repeated.
        sample: Run that many points of a Sobol sample instead of all combinations; KEY=LOW:HIGH
            then takes any number between.
        seed: Another seed gives another sample.
        plot: Draw a metric, e.g. tracking.rms, into DIR/METRIC.png and .svg; may be repeated.
        over: The key that --plot draws over, or the two; by default the first two of --vary.
        processes: How many processes simulate; 0 is one for every processor.
        ray: Simulate on the Ray cluster at this address (extra `ray`).
        quiet: Print nothing but errors.
    """
    from rich.text import Text

    from fivebar_sim.cli import memory
    from fivebar_sim.sweep import picture, study, summary
    from fivebar_sim.sweep import run as running
    from fivebar_sim.sweep.points import points

    found = points(vary, sample, seed)
    picture.check(found, plot, over)
    checked = study.study(scenario, found, settings)
    memory.check(running.longest(checked))
    workers = _workers(checked, processes, ray)
    with _kept(out), Progress("runs", quiet=quiet) as progress:
        swept = running.run(checked, out, workers, progress.tell)

    told = summary.summary(swept.runs)
    console = screen(quiet=quiet)
    rate = f"; {progress.rate:.3g} runs a second" if swept.new else ""
    console.print(Text(f"{swept.size} runs in {swept.runs}: {told}{rate}"), soft_wrap=True)
    for metric in plot if told.verdicts else ():
        files = picture.draw(swept.runs, found, metric, out, over)
        console.print(Text(f"{metric}: drawn in {files[0]}"), soft_wrap=True)
    return 0 if told.verdicts else FAILED


def _workers(checked: Study, processes: int, ray: str | None) -> Workers:
    """Return who simulates.

    Raises:
        ConfigError: Both processes and a cluster.
        WorkersError: Nobody answers at the cluster's address.
    """
    from fivebar_sim.sweep import run as running
    from fivebar_sim.workers.here import Here
    from fivebar_sim.workers.processes import Processes, processors

    if ray is not None:
        from fivebar_sim.workers.cluster import RayCluster

        if processes:
            raise ConfigError("--processes are this machine's: leave it out beside --ray")
        return RayCluster(ray)
    if processes:
        return Processes(processes)

    # Each needs about a second to start: a short sweep is done before.
    steps = checked.points.count * running.longest(checked)
    count = min(processors(), steps // WORTH)
    return Processes(count) if count > 1 else Here()


@contextmanager
def _kept(out: Path) -> Iterator[None]:
    """Say where a sweep goes on that is broken off within."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"what is done is kept in {out}; the same command goes on from there")
        raise
