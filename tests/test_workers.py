"""Workers: every task once, in whatever order, and an error where a worker is lost."""

from __future__ import annotations

import operator
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fivebar_sim.errors import ArgumentError, WorkersError
from fivebar_sim.workers.here import Here, Task, Workers
from fivebar_sim.workers.processes import AHEAD, Processes


def counted(most: int, drawn: list[int]) -> Iterator[Task]:
    """Yield tasks, and note which were drawn."""
    for k in range(most):
        drawn.append(k)
        yield k, k + 0.5


@pytest.mark.parametrize("workers", [Here(), Processes(2)])
def test_every_task_is_done_once_and_drawn_late(workers: Workers) -> None:
    drawn: list[int] = []
    results = workers.results(operator.neg, counted(12, drawn))
    first = next(results)
    assert len(drawn) <= 2 * AHEAD + 1
    found = [first, *results]
    assert sorted(found) == [(k, -(k + 0.5)) for k in range(12)]
    assert list(workers.results(operator.neg, [])) == []


def test_error_of_a_task_is_the_callers() -> None:
    for workers in (Here(), Processes(1)):
        with pytest.raises(TypeError, match="bad operand"):
            list(workers.results(operator.neg, [(0, "text")]))


def test_ended_process_is_an_error_of_one_line() -> None:
    """What the system does for want of memory: a process is gone in the midst of a task."""
    with pytest.raises(WorkersError, match="one of 1 processes was ended from outside"):
        list(Processes(1).results(os._exit, [(0, 9)]))
    with pytest.raises(ArgumentError, match=r"processes must be in \[0, inf\), got -1"):
        Processes(-1)
    assert Processes().count >= 1


LEADER = """
import time
from fivebar_sim.workers.processes import Processes
if __name__ == "__main__":
    import os, threading
    from multiprocessing import active_children
    def report():
        while not active_children():
            time.sleep(0.02)
        time.sleep(0.3)
        print(active_children()[0].pid, flush=True)
    threading.Thread(target=report, daemon=True).start()
    list(Processes(1).results(time.sleep, [(0, 60)]))
"""


def works(process: int) -> bool:
    """Return whether a process is there, and not only its exit status."""
    stat = Path(f"/proc/{process}/stat")
    return stat.exists() and stat.read_text("utf-8").rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(sys.platform != "linux", reason="looks in /proc for the process")
def test_processes_end_with_a_killed_parent(tmp_path: Path) -> None:
    leader = tmp_path / "leader.py"
    leader.write_text(LEADER, encoding="utf-8")
    run = subprocess.Popen([sys.executable, str(leader)], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    child = int(run.stdout.readline())
    run.kill()
    run.communicate()
    for _ in range(400):
        if not works(child):
            return
        time.sleep(0.05)
    pytest.fail(f"process {child} works on without its parent")
