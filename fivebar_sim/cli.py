"""The program `fivebar`: parses and calls; exit status 0 fine, 1 failed, 2 bad input."""

from __future__ import annotations

import importlib
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from fivebar_sim import __version__, memory
from fivebar_sim.commands.status import FAILED, INTERRUPTED, UNREAD, WRONG, say
from fivebar_sim.errors import DivergedError, FiveBarError

COMMANDS = ("run", "check", "replay", "report", "render", "view", "workspace")
"""Each in the module of its name in `fivebar_sim.commands`."""

HELP = {"-h", "--help"}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    args = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # any name, in any terminal's encoding
    try:
        with _terminable():
            status = _dispatch(args)
        if sys.stdout:
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    except DivergedError as error:
        say(error)
        return FAILED
    except FiveBarError as error:
        say(error)
        return WRONG
    except BrokenPipeError:  # who reads has gone, as in `fivebar check | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNREAD
    except OSError as error:
        say(error)
        return WRONG
    except MemoryError as error:
        say(f"not enough memory: {error}")
        return WRONG


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end the program as Ctrl-C does, tidied up, with its own exit status."""
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return

    def end(number: int, frame: object) -> None:
        raise SystemExit(128 + number)

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _dispatch(args: list[str]) -> int:
    """Call what the arguments say; a signal that ends an import ends the program as any other."""
    try:
        return _call(args)
    except ImportError as error:
        cause: BaseException | None = error
        while cause and not isinstance(cause, (KeyboardInterrupt, SystemExit)):
            cause = cause.__cause__  # modules in C++ raise their own error where they are stopped
        raise cause or error from None


def _call(args: list[str]) -> int:
    """Parse the arguments and call their command; all else is imported here, within `main`."""
    if args == ["--version"]:
        print(f"fivebar-sim {__version__}")  # noqa: T201
        return 0
    if not HELP & set(args):
        memory.check()
    import tyro

    return tyro.extras.subcommand_cli_from_dict(
        {name: _command(name) for name in COMMANDS},
        prog="fivebar",
        description="Simulate closed-chain five-bar legs; measure tracking and load sharing.",
        args=args,
        config=(tyro.conf.FlagCreatePairsOff,),
    )


def _command(name: str) -> Callable[..., int]:
    """Return the function of a command."""
    return getattr(importlib.import_module(f"fivebar_sim.commands.{name}"), name)
