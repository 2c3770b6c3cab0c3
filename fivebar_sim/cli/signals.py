"""Ctrl-C and SIGTERM end the program even where an exception gets swallowed.

A signal handler can only raise, and its exception is lost where the interpreter or a C++ module
drops exceptions: in `__del__`, in callbacks, while some modules are imported. So it is raised again
until it gets through, but never into the clean-up that it caused.
"""

from __future__ import annotations

import _thread
import atexit
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 0.2
"""Time that an exception gets to pass through before it is raised again [s]."""

USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""The handlers that a Python program starts with, and that `listen` exchanges."""

_held: set[signal.Signals] = set()
"""The signals that `held` makes wait."""

_sent: list[int] = []
"""The first signal that came, if any."""


@contextmanager
def held() -> Iterator[None]:
    """Within, Ctrl-C and SIGTERM wait for `listen`, which lets them through.

    At the end of the process they end it as they would end any other: no traceback tells of one
    that comes while the interpreter tidies up.
    """
    # Windows has no such masks; another thread's would be of no use.
    if not _is_ours() or not hasattr(signal, "pthread_sigmask"):
        yield
        return

    before = signal.pthread_sigmask(signal.SIG_BLOCK, USUAL)
    _held.update(set(USUAL) - before)
    try:
        yield
    finally:
        _held.clear()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        # What is registered last is called first; once is enough, however often main is called.
        atexit.unregister(_let_go)
        atexit.register(_let_go)


def _let_go() -> None:
    """Leave Ctrl-C to the system, unless it is ignored."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def _is_ours() -> bool:
    """Return whether this is the main thread: no other one may have signal handlers."""
    return threading.current_thread() is threading.main_thread()


@contextmanager
def listen() -> Iterator[None]:
    """Within, Ctrl-C raises KeyboardInterrupt and SIGTERM SystemExit, and neither gets lost.

    A signal that was already ignored when the program started, as Ctrl-C is behind `&` in a script,
    stays ignored; one with a handler of its own keeps it. Outside the main thread, where Python
    allows no signal handlers, nothing changes.
    """
    if not _is_ours():
        yield
        return

    _sent.clear()
    before = {n: USUAL[n] for n in USUAL if signal.getsignal(n) == USUAL[n]}

    unraisable = sys.unraisablehook
    ended = threading.Event()
    lock = threading.Lock()
    # Started before any signal comes: a handler may interrupt the start of a thread.
    threading.Thread(target=_insist, args=(ended, lock), daemon=True).start()

    for number in before:
        signal.signal(number, _end)

    sys.unraisablehook = _quiet
    try:
        if _held:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _held)
        yield
    finally:
        try:
            # From here on nothing is raised again.
            with lock:
                ended.set()
        finally:
            sys.unraisablehook = unraisable
            for number, handler in before.items():
                signal.signal(number, handler)
            # The exception may have been swallowed, or an import may have turned it into another.
            if _sent:
                raise _ending(_sent[0]) from None


def acknowledge() -> None:
    """Forget the signal: the program has done what it asked for."""
    _sent.clear()


def _end(number: int, frame: object) -> None:
    """Raise the exception of the first signal, unless it is already on its way."""
    if not _sent:
        _sent.append(number)
    # A second exception would interrupt the clean-up that the first one runs through.
    if not _unwinding(sys.exc_info()[1]):
        raise _ending(_sent[0])


def _ending(number: int) -> BaseException:
    """Return the exception of a signal."""
    # 128 + number is what a shell reports for a program that a signal ended.
    return KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number)


def _unwinding(error: BaseException | None) -> bool:
    """Return whether an exception of a signal is on its way through clean-up code."""
    # An error in the clean-up itself has the signal's exception as its context.
    while error is not None and not isinstance(error, (KeyboardInterrupt, SystemExit)):
        error = error.__context__
    return error is not None


def _quiet(lost: sys.UnraisableHookArgs) -> None:
    """Report an exception that nobody can catch, unless it is a signal's."""
    if not (_sent and _unwinding(lost.exc_value)):
        sys.__unraisablehook__(lost)


def _insist(ended: threading.Event, lock: threading.Lock) -> None:
    """Run the handler again and again until the program has left `listen`."""
    while not ended.wait(PATIENCE):
        with lock:
            # Only the main thread may raise; this makes Python call the handler there.
            if _sent and not ended.is_set():
                _thread.interrupt_main(signal.Signals(_sent[0]))
