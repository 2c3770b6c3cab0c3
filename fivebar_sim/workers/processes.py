"""Several processes of this machine, which do tasks side by side."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from fivebar_sim.errors import ArgumentError, WorkersError
from fivebar_sim.workers.here import Answer, Task

AHEAD = 2
"""Tasks a process that are handed out at one time, so that none waits for its next one."""


class Processes:
    """Processes of this machine.

    As with all of Python's processes, a script that starts some does so below
    `if __name__ == "__main__":`.

    Args:
        count: How many; 0 is one for every processor that this process may use.

    Raises:
        ArgumentError: Fewer than 0.
    """

    def __init__(self, count: int = 0) -> None:
        if count < 0:
            raise ArgumentError(f"processes must be in [0, inf), got {count}")
        self.count = count or processors()

    def results(self, function: Callable[[Any], Any], tasks: Iterable[Task]) -> Iterator[Answer]:
        """Yield the result of every task; see `Workers`.

        Raises:
            WorkersError: A process ended, as one that the system kills for want of memory.
        """
        # Not forked: a fork of a process with threads may wait for ever.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(self.count, mp_context=context, initializer=_end_with_parent)
        try:
            yield from self._drained(pool, function, iter(tasks))
        except BrokenProcessPool:
            raise WorkersError(
                f"one of {self.count} processes was ended from outside, perhaps for want of "
                "memory; fewer processes need less of it"
            ) from None
        finally:
            _end(pool)

    def _drained(
        self, pool: ProcessPoolExecutor, function: Callable[[Any], Any], tasks: Iterator[Task]
    ) -> Iterator[Answer]:
        """Yield the results of tasks, of which only a few are handed out at one time."""
        pending: dict[Future[Any], int] = {}
        while True:
            while len(pending) < AHEAD * self.count:
                task = next(tasks, None)
                if task is None:
                    break
                with _deaf():
                    pending[pool.submit(function, task[1])] = task[0]

            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                yield pending.pop(future), future.result()


def processors() -> int:
    """Return the number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    # Only Linux tells which ones a process may use.
    except AttributeError:
        return os.cpu_count() or 1


@contextmanager
def _deaf() -> Iterator[None]:
    """Start processes within that hear no Ctrl-C: it ends the program, which then ends them."""
    # Windows has no such masks.
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """End this process when the one that started it ends, however that does."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once, whatever they do."""
    # Python has a public way from 3.14 on; a task may last for minutes, and nobody waits for it.
    working = list((pool._processes or {}).values())
    for process in working:
        process.terminate()
    pool.shutdown(wait=True, cancel_futures=True)
