"""The search itself: blocks are asked for, evaluated or found kept, and told to the method."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import Evaluated, evaluate
from fivebar_sim.design.evaluation.measures import limits
from fivebar_sim.design.search import front as fronts
from fivebar_sim.design.search.front import Front
from fivebar_sim.design.search.methods import Asking, method
from fivebar_sim.design.search.store import Store
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ConfigError, RunDirectoryError


@dataclass(slots=True)
class Progress:
    """How far a search is.

    Attributes:
        total: Designs that it will ask for at most.
        designs: Designs seen.
        fresh: Those of them that were evaluated now, not found kept.
        feasible: Those that keep to every constraint.
        seconds: Time spent on evaluating the fresh ones [s].
        excluded: Designs by the first constraint that they break.
        front: The front so far; None before the first block.
        blocks: Blocks seen.
    """

    total: int
    designs: int = 0
    fresh: int = 0
    feasible: int = 0
    seconds: float = 0.0
    excluded: Counter[str] = field(default_factory=Counter)
    front: Front | None = None
    blocks: int = 0

    @property
    def rate(self) -> float:
        """Fresh designs a minute."""
        return 60.0 * self.fresh / self.seconds if self.seconds > 0.0 else 0.0


Watcher = Callable[[Progress], None]


def search(task: Task, folder: Path, *, threads: int = 1, watch: Watcher | None = None) -> Progress:
    """Search a task's designs, or go on with a search that was ended; write all of them.

    Args:
        task: The task.
        folder: The directory to write.
        threads: Threads to use; the result is the same with any number.
        watch: Called after every block.

    Returns:
        What came out: the front, and how many designs each constraint excludes.

    Raises:
        ConfigError: A method that the task cannot have, or no design keeps to all constraints.
        RunDirectoryError: Something else is in the directory, or a file of it is damaged.
    """
    asking, total = method(task)
    store = Store(task, folder)
    progress = Progress(total)
    if store.finished:
        progress.front = store.read_front()
        return progress

    try:
        _go(task, asking, store, progress, threads, watch)
    except KeyboardInterrupt:
        # What was found is worth keeping; the blocks stay, so that the search can go on.
        if progress.front is not None:
            store.close(progress.blocks, progress.front, finished=False)
        raise

    assert progress.front is not None
    found = len(progress.front.rows) > 0
    # Without a front the blocks stay: the next time says as well what excluded the designs.
    store.close(progress.blocks, progress.front, finished=found)
    if not found:
        raise ConfigError(f"{task.where}: {excluded_text(progress)}")
    return progress


def _go(
    task: Task,
    asking: Asking,
    store: Store,
    progress: Progress,
    threads: int,
    watch: Watcher | None,
) -> None:
    """Answer all that the method asks for."""
    values = next(asking, None)
    while values is not None:
        block = _answer(task, store, progress, values, threads)
        _count(task, progress, block)
        if watch is not None:
            watch(progress)
        try:
            values = asking.send(block)
        except StopIteration:
            return


def _answer(task: Task, store: Store, progress: Progress, values: Array, threads: int) -> Evaluated:
    """Return what becomes of a block: as it was kept, or evaluated now and kept."""
    known = store.read(progress.blocks)
    if known is not None:
        if known.values.tobytes() != np.ascontiguousarray(values).tobytes():
            raise RunDirectoryError(
                f"{store.path(progress.blocks)} has other designs than this search asks for: "
                "another version of pymoo, cma or NumPy wrote it"
            )
        return known

    start = time.perf_counter()
    block = evaluate(task, values, threads=threads, spare=task.search.spare)
    progress.seconds += time.perf_counter() - start
    progress.fresh += len(block)
    store.write(progress.blocks, block)
    return block


def _count(task: Task, progress: Progress, block: Evaluated) -> None:
    """Add a block to what is known."""
    if progress.front is None:
        progress.front = fronts.empty(task, block)
    progress.front = progress.front.joined(task, progress.designs, block)
    progress.designs += len(block)
    progress.blocks += 1
    progress.feasible += int(block.feasible.sum())

    names = [each.name for each in limits(task)] + ["objectives"]
    lost = block.violations[~block.feasible] != 0.0
    # Those that keep to all constraints have an objective that is not defined.
    lost = np.column_stack([lost, np.ones(len(lost), dtype=bool)])
    first = np.argmax(lost, axis=1)
    for k, count in zip(*np.unique(first, return_counts=True), strict=True):
        progress.excluded[names[k]] += int(count)


def excluded_text(progress: Progress) -> str:
    """Return in words which constraint excludes how many designs."""
    parts = [f"{name} excludes {count}" for name, count in progress.excluded.most_common()]
    return f"no feasible design among {progress.designs}: {', '.join(parts)}"
