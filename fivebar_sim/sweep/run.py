"""Runs a sweep: blocks of runs are handed to workers, and their rows written as they come."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from fivebar_sim.errors import ConfigError, FiveBarError
from fivebar_sim.scenario import Scenario
from fivebar_sim.sweep import rows, study
from fivebar_sim.sweep.points import points
from fivebar_sim.sweep.store import Store
from fivebar_sim.sweep.study import Study
from fivebar_sim.workers.here import Here, Task, Workers

STEPS = 64_000
"""Most physics steps of a block's runs: about a second, and 40 MB."""

MOST = 256
"""Most runs of a block."""

FEWEST = 32
"""Blocks of a sweep of so many runs, so that several workers have something to do."""

Watch = Callable[[int, int], None]
"""Is told how many runs are done, and how many there are."""


class Swept(NamedTuple):
    """A sweep that is done.

    Attributes:
        runs: The table: one row a run, see `rows.schema`.
        size: Number of its rows.
        new: How many of them were simulated now, not before.
    """

    runs: Path
    size: int
    new: int


def sweep(
    scenario: Scenario | str | Path,
    vary: Sequence[str],
    out: str | Path,
    *,
    settings: Sequence[str] = (),
    sample: int | None = None,
    seed: int = 0,
    workers: Workers | None = None,
    watch: Watch | None = None,
) -> Swept:
    """Simulate a scenario for all values of some of its keys; return where the table of it is.

    A sweep that was broken off goes on with the runs that are missing; the table is the same. A
    point that cannot be run, as where the leg does not reach its path, has its error in the table.

    Args:
        scenario: The scenario, a shipped one's name, or the path of a TOML file.
        vary: What is varied: "leg.L2=0.05:0.08:31", "servo=xl330,hobby-9g".
        out: The sweep's directory.
        settings: Changes of every run, "KEY=VALUE".
        sample: Number of points of a Sobol sample; None is the grid of all combinations.
        seed: Shifts the sample.
        workers: Who simulates: this process (None), `Processes()`, or a `RayCluster`.
        watch: Is told how far it is.

    Raises:
        ConfigError: A key, a value or the directory is wrong.
        WorkersError: The workers are gone; the rows so far are kept.
    """
    found = points(vary, sample, seed)
    if isinstance(scenario, Scenario):
        if settings:
            raise ConfigError("settings change a scenario's file: this is a Scenario already")
        return run(study.of(scenario, found), Path(out), workers or Here(), watch)
    return run(study.study(scenario, found, settings), Path(out), workers or Here(), watch)


def run(swept: Study, out: Path, workers: Workers, watch: Watch | None = None) -> Swept:
    """Run a checked sweep; see `sweep`."""
    count = swept.points.count
    size = block_size(swept)
    store = Store(out, study.fingerprint(swept), math.ceil(count / size), rows.schema(swept.points))
    if store.whole:
        store.check_runs(count)
        store.tidy()
        return Swept(store.runs, count, 0)

    blocks = [range(begin, min(begin + size, count)) for begin in range(0, count, size)]
    with store.open():
        numbers = {k: blocks[k] for k in store.missing()}
        new = sum(map(len, numbers.values()))
        done = count - new
        watch = watch or (lambda _done, _count: None)
        watch(done, count)
        for k, found in workers.results(rows.simulate, _tasks(swept, numbers)):
            store.add(k, rows.table(swept.points, numbers[k], found))
            done += len(numbers[k])
            watch(done, count)
        store.finish(map(len, blocks))
    return Swept(store.runs, count, new)


def block_size(swept: Study) -> int:
    """Return the number of runs in a block: the same however many workers there are."""
    fair = math.ceil(swept.points.count / FEWEST)
    return max(1, min(MOST, STEPS // longest(swept), fair))


def longest(swept: Study) -> int:
    """Return the physics steps of the longest run that is tried."""
    steps = 1
    for _, values in swept.trials():
        try:
            steps = max(steps, swept.scenario(values).steps)
        except FiveBarError:
            continue
    return steps


def _tasks(swept: Study, blocks: Mapping[int, range]) -> Iterator[Task]:
    """Yield each block's scenarios, or their errors.

    Scenarios, not files: a worker on another machine has no such files.
    """
    for k, numbers in blocks.items():
        yield k, [_scenario(swept, number) for number in numbers]


def _scenario(swept: Study, number: int) -> Scenario | str:
    try:
        return swept.scenario(swept.points.at(number))
    except FiveBarError as error:
        return str(error)
