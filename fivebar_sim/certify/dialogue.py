"""Ask a program many questions over its standard input and output, and never wait in vain.

All questions are written, the input is closed, and everything that comes is read, both at once: a
program may answer line by line or keep its answers until the end. One that is silent, that dies,
that prints without end or that goes on after its input has ended is stopped, with all that it
started in its process group.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO, NamedTuple

from fivebar_sim.errors import ConfigError

LONGEST_ANSWER = 400
"""Letters of an answer on average; a program that prints more is stopped."""

CHUNK = 65536
"""Bytes read or written at once."""

LAST_WORDS = 2000
"""Bytes of stderr that are kept, the last ones."""

GRACE = 0.5
"""Time that a stopped program gets to end by itself [s]."""


class Said(NamedTuple):
    """What a program printed, and how it ended.

    Attributes:
        lines: Its answers.
        ending: What is wrong with how it ended; "" if nothing.
        words: The last line that it wrote to stderr.
    """

    lines: list[str]
    ending: str
    words: str


class _Pipes:
    """The three pipes of a program: what is still to be written, and what was read."""

    def __init__(self, process: subprocess.Popen[bytes], questions: bytes) -> None:
        assert process.stdin
        assert process.stdout
        assert process.stderr
        self.to_write = memoryview(questions)
        self.out = bytearray()
        self.err = bytearray()

        self.most = LONGEST_ANSWER * (questions.count(b"\n") + 1)
        self.selector = selectors.DefaultSelector()
        for pipe, event in (
            (process.stdin, selectors.EVENT_WRITE),
            (process.stdout, selectors.EVENT_READ),
            (process.stderr, selectors.EVENT_READ),
        ):
            os.set_blocking(pipe.fileno(), False)
            self.selector.register(pipe, event)
        self.stdin = process.stdin
        self.stderr = process.stderr

    def serve(self, wait: float) -> None:
        """Move what can be moved now, waiting up to so long [s] for the first of it."""
        for key, _ in self.selector.select(wait):
            if key.fileobj is self.stdin:
                self._write(self.stdin)
            else:
                self._read(key)

    def _write(self, pipe: IO[bytes]) -> None:
        try:
            self.to_write = self.to_write[os.write(pipe.fileno(), self.to_write[:CHUNK]) :]
        except BlockingIOError:
            return
        # It reads no more: its answers will be too few.
        except OSError:
            self.to_write = self.to_write[:0]
        if not self.to_write:
            self.selector.unregister(pipe)
            with contextlib.suppress(OSError):
                pipe.close()

    def _read(self, key: selectors.SelectorKey) -> None:
        part = os.read(key.fd, CHUNK)
        if not part:
            self.selector.unregister(key.fileobj)
        elif key.fileobj is self.stderr:
            self.err += part
            del self.err[:-LAST_WORDS]
        else:
            self.out += part

    @property
    def open(self) -> bool:
        """Whether the program may still write."""
        return any(key.events == selectors.EVENT_READ for key in self.selector.get_map().values())


def ask(
    command: Sequence[str],
    questions: Sequence[str],
    timeout: float,
    environment: Mapping[str, str] | None = None,
) -> Said:
    """Return what a program answers to questions, one a line.

    Args:
        command: The program and its arguments; found as a shell finds it.
        questions: The lines that it is sent.
        timeout: Longest time that all of it may take [s].
        environment: Its environment variables; None: those of this process.

    Raises:
        ConfigError: The program cannot be started.
    """
    data = "".join(f"{line}\n" for line in questions).encode()
    with _noted() as came:
        process = _start(command, environment)
        pipes = _Pipes(process, data)

    try:
        for number in came:
            signal.raise_signal(number)
        ending = _talk(process, pipes, timeout)
    finally:
        _stop(process)
        pipes.selector.close()
        for pipe in (process.stdin, process.stdout, process.stderr):
            # Closing flushes, and nobody reads any more.
            assert pipe
            with contextlib.suppress(OSError):
                pipe.close()

    words = pipes.err.decode(errors="replace").strip().splitlines()
    lines = pipes.out.decode(errors="replace").splitlines()
    return Said(lines, ending, words[-1] if words else "")


@contextmanager
def _noted() -> Iterator[list[int]]:
    """Within, Ctrl-C and SIGTERM are only noted, and yielded.

    One that came while a program starts would leave it running, since nobody had it yet.
    """
    came: list[int] = []
    before = {}
    # No other thread may have signal handlers, and none is interrupted.
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    heard = [number for number, handler in before.items() if handler not in (None, signal.SIG_IGN)]

    for number in heard:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield came
    finally:
        for number in heard:
            signal.signal(number, before[number])


def _start(
    command: Sequence[str], environment: Mapping[str, str] | None
) -> subprocess.Popen[bytes]:
    """Start a program; ConfigError if that cannot be done."""
    try:
        # A group of its own, so that it can be stopped with all that it starts.
        return subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env=environment,
        )
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ConfigError(f"cannot start {command[0]}: {why}") from None


def _talk(process: subprocess.Popen[bytes], pipes: _Pipes, timeout: float) -> str:
    """Serve the pipes until the program has ended; return what is wrong with its end."""
    end = time.monotonic() + timeout
    while pipes.open and process.poll() is None:
        if len(pipes.out) > pipes.most:
            return f"it printed more than {pipes.most} letters, and was stopped"
        left = end - time.monotonic()
        if left <= 0.0:
            return f"it had not ended after {timeout:g} s, and was stopped"
        pipes.serve(min(left, 0.05))

    # It has ended, or closed its output; a child may still hold the pipe, so nothing is waited for.
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(min(max(end - time.monotonic(), 0.0), GRACE))
    while pipes.open and len(pipes.out) <= pipes.most:
        before = len(pipes.out), len(pipes.err)
        pipes.serve(0.0)
        if before == (len(pipes.out), len(pipes.err)):
            break

    status = process.poll()
    if status is None:
        return "it closed its output but did not end, and was stopped"
    if status < 0:
        return f"it was ended by signal {_signal(-status)}"
    return f"it ended with status {status}" if status else ""


def _signal(number: int) -> str:
    """Return the name of a signal."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return str(number)


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a program and its process group: asked first, then killed."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(GRACE)
    # The group lives as long as any process of it.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
