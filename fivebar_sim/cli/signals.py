"""How signals end the program: Ctrl-C and SIGTERM, heard even where an exception is swallowed.

A handler can only raise, and what it raises is lost where the interpreter or a module in C++ drops
exceptions: in `__del__`, in callbacks, while some modules are imported. So it is raised again until
it gets through, and never into what tidies up after it.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 0.2
"""How long what was raised may take to get through before it is raised again [s]."""

_sent: list[int] = []
"""The signal that came, if one did: the first one counts."""


@contextmanager
def heard() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt within, and SIGTERM SystemExit, and neither get lost.

    A signal that the program was started with ignored, as Ctrl-C is behind `&` in a script, stays
    ignored; one that has a handler of somebody else's keeps it. Outside of the main thread, where
    Python lets nobody handle signals, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    _sent.clear()
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    before = {n: usual[n] for n in usual if signal.getsignal(n) == usual[n]}

    unraisable = sys.unraisablehook
    ended = threading.Event()
    lock = threading.Lock()
    # started before any signal comes: a handler may interrupt the starting of another thread
    threading.Thread(target=_insist, args=(ended, lock), daemon=True).start()

    for number in before:
        signal.signal(number, _end)

    sys.unraisablehook = _quiet
    try:
        yield
    finally:
        try:
            with lock:  # from here on nothing is raised again
                ended.set()
        finally:
            sys.unraisablehook = unraisable
            for number, handler in before.items():
                signal.signal(number, handler)
            if _sent:  # whatever came of it: nothing, or what an import made of it
                raise _ending(_sent[0]) from None


def answered() -> None:
    """Say that the signal did what it should, so that it is no reason to end otherwise."""
    _sent.clear()


def _end(number: int, frame: object) -> None:
    """Raise what the first signal raises, unless it is on its way already."""
    if not _sent:
        _sent.append(number)
    if not _unwinding(sys.exc_info()[1]):
        raise _ending(_sent[0])


def _ending(number: int) -> BaseException:
    """Return what a signal raises."""
    return KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number)


def _unwinding(error: BaseException | None) -> bool:
    """Return whether what a signal raised is on its way, through what tidies up."""
    while error is not None and not isinstance(error, (KeyboardInterrupt, SystemExit)):
        error = error.__context__
    return error is not None


def _quiet(lost: sys.UnraisableHookArgs) -> None:
    """Tell of an exception that nobody can catch, if it is none of ours."""
    if not (_sent and _unwinding(lost.exc_value)):
        sys.__unraisablehook__(lost)


def _insist(ended: threading.Event, lock: threading.Lock) -> None:
    """Let the handler run again and again, until the program is out of `heard`."""
    while not ended.wait(PATIENCE):
        with lock:
            if _sent and not ended.is_set():
                _thread.interrupt_main(signal.Signals(_sent[0]))
