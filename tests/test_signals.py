"""Ctrl-C and SIGTERM: they end the program whenever they come, and leave nothing."""

from __future__ import annotations

import os
import random
import select
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from shell import LIGHT, Shell, started

from fivebar_sim.cli import program, signals
from fivebar_sim.errors import ConfigError
from fivebar_sim.runs import stored

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends no signals to one process")

TOLD = """
import signal, sys
from fivebar_sim.cli import program as cli
from fivebar_sim.simulation import steps as simulate
advance = simulate.Legs.advance
def told(*args):
    {then}
    simulate.Legs.advance = advance
    return advance(*args)
simulate.Legs.advance = told
sys.exit(cli.main())
"""
"""The program, that does something when it begins to simulate."""
LISTENS = """
import sys
from fivebar_sim.cli import program as cli
call = cli._call
def told(args):
    print("listens", flush=True)
    return call(args)
cli._call = told
status = cli.main()
print("over", flush=True)
sys.exit(status)
"""
"""The program, that says when signals are heard, and when no more."""
ENDS = [(signal.SIGINT, 130, "fivebar: interrupted\n"), (signal.SIGTERM, 143, "")]
# It takes a second to simulate, and half of one to plan, as the tests wait for.
LONG = ["run", "short.toml", "--quiet", "--set", "duration=60", "--out", "mine"]


@pytest.fixture(autouse=True)
def usual() -> Iterator[None]:
    """Have Python's own handlers, however the tests were started."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("sent", "status", "said"), ENDS)
def test_signal_ends_the_program_and_leaves_nothing(
    shell: Shell, sent: signal.Signals, status: int, said: str
) -> None:
    before = shell.names()
    code = TOLD.format(then="print('begun', flush=True)")
    with started([sys.executable, "-c", code, *LONG], text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(sent)
        assert process.communicate()[1] == said
    assert process.returncode == status
    assert shell.names() == before


def test_ignored_interrupt_stays_ignored_and_the_other_signal_does_not(shell: Shell) -> None:
    for sent, status in ((signal.SIGINT, 0), (signal.SIGTERM, 143)):
        code = TOLD.format(then=f"signal.raise_signal({int(sent)})")
        run = ["run", "short.toml", "--quiet", "--out", sent.name]
        command = [sys.executable, "-c", LIGHT + code, *run]
        with started(command, signal.SIG_IGN) as process:
            assert process.communicate() == (b"", b"")
        assert process.returncode == status
        assert Path(sent.name).exists() == (status == 0)


EARLY = """
import os, sys
from fivebar_sim.cli import main
def told(event, args):
    if event == "import" and args[0] == "fivebar_sim.cli.program":
        os.kill(os.getpid(), {sent})
sys.addaudithook(told)
sys.exit(main())
"""
"""The program, that gets a signal before anything slow is imported."""
LATE = """
import atexit, os, sys, time
from fivebar_sim.cli import main
def told():
    os.kill(os.getpid(), {sent})
    time.sleep(9.0)
atexit.register(told)
sys.exit(main())
"""
"""The program, that gets a signal when it has ended and the interpreter tidies up."""


@pytest.mark.parametrize(("sent", "status", "said"), ENDS)
def test_signal_while_the_program_is_imported_waits_until_it_is_heard(
    shell: Shell, sent: signal.Signals, status: int, said: str
) -> None:
    command = [sys.executable, "-c", EARLY.format(sent=int(sent)), "run", "short.toml"]
    with started(command, text=True) as process:
        assert process.communicate() == ("", said)
    assert process.returncode == status


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_signal_at_the_very_end_leaves_no_traceback(sent: signal.Signals) -> None:
    command = [sys.executable, "-c", LATE.format(sent=int(sent)), "--version"]
    with started(command, text=True) as process:
        assert process.communicate()[1] == ""
    assert process.returncode == -sent


def test_half_made_recording_is_no_matter_for_stderr() -> None:
    """Rerun warns of data that nobody takes: what a signal ends has such."""
    code = """
from fivebar_sim.recording import rrd as recording
with recording.session():
    stream = recording.started("dropped")
    del stream
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def dropped_by_the_interpreter(send: Callable[[], None]) -> None:
    class Goes:
        def __del__(self) -> None:
            send()

    Goes()


def dropped_by_code(send: Callable[[], None]) -> None:
    with suppress(BaseException):
        send()


def made_an_import_error(send: Callable[[], None]) -> None:
    try:
        send()
    except BaseException as first:
        raise ImportError("initialization failed") from first


def made_bad_input(send: Callable[[], None]) -> None:
    try:
        send()
    except BaseException:
        raise ConfigError("it cannot be read") from None


@pytest.mark.parametrize(("sent", "status", "said"), ENDS)
@pytest.mark.parametrize(
    "lose", [dropped_by_the_interpreter, dropped_by_code, made_an_import_error, made_bad_input]
)
def test_signal_whose_exception_is_lost_ends_the_program_all_the_same(
    shell: Shell,
    monkeypatch: pytest.MonkeyPatch,
    lose: Callable[[Callable[[], None]], None],
    sent: signal.Signals,
    status: int,
    said: str,
) -> None:
    def call(args: list[str]) -> int:
        lose(lambda: signal.raise_signal(sent))
        return 0

    monkeypatch.setattr(program, "_call", call)
    shell.capture.readouterr()
    assert _status() == status
    assert shell.capture.readouterr() == ("", said)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler


def test_lost_signal_ends_a_long_run_early(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def call(args: list[str]) -> int:
        dropped_by_code(lambda: signal.raise_signal(signal.SIGTERM))
        for _ in range(10_000):  # in pieces, since what raises again wakes nobody up
            time.sleep(0.01)
        raise AssertionError("it was never raised again")

    monkeypatch.setattr(program, "_call", call)
    assert _status() == 143


def test_tidying_up_is_not_interrupted(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    done = []

    def call(args: list[str]) -> int:
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGINT)  # an impatient one
            for _ in range(30):
                time.sleep(0.1 * signals.PATIENCE)
            done.append("tidy")
        return 0

    monkeypatch.setattr(program, "_call", call)
    assert _status() == 143
    assert done == ["tidy"]


def _status() -> object:
    """Return how the program ends."""
    try:
        return program.main(["run"])
    except SystemExit as end:
        return end.code


@pytest.mark.long
@pytest.mark.parametrize(("sent", "status", "said"), ENDS)
def test_signal_at_any_moment_ends_the_program(
    shell: Shell, sent: signal.Signals, status: int, said: str
) -> None:
    """Status and output at 75 moments of a run, from when the program listens to its very end."""
    run = ["run", "short.toml", "--quiet", "--out"]
    command = [sys.executable, "-c", LISTENS, *run]
    rng = random.Random(1)
    begun = time.monotonic()
    came = Counter[tuple[int, bytes, bool]]()
    subprocess.run([*command, "first"], check=True, stdout=subprocess.DEVNULL)
    takes = time.monotonic() - begun
    for number in range(75):
        place = Path(f"out{number}")
        with started([*command, place.name]) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == b"listens\n"
            time.sleep(rng.uniform(0.0, takes))
            late = bool(select.select([process.stdout], [], [], 0.0)[0])
            process.send_signal(sent)
            err = process.communicate()[1]
        assert process.returncode or late  # or it was lost
        if place.exists():
            stored.read(place)
        came[process.returncode, err, place.exists()] += 1
    assert not list(shell.folder.glob(".*"))
    # a whole run is there if it had ended: nothing to end, or nothing but the interpreter
    assert set(came) <= {(status, said.encode(), False), (0, b"", True), (-sent, b"", True)}
    assert came[status, said.encode(), False] > 30
