"""The program `fivebar`: parses and calls; exit status 0 fine, 1 failed, 2 bad input."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import tyro

from fivebar_sim import __version__
from fivebar_sim.commands.check import check
from fivebar_sim.commands.common import FAILED, INTERRUPTED, UNREAD, WRONG, say
from fivebar_sim.commands.render import render
from fivebar_sim.commands.replay import replay
from fivebar_sim.commands.report import report
from fivebar_sim.commands.run import run
from fivebar_sim.commands.view import view
from fivebar_sim.commands.workspace import workspace
from fivebar_sim.errors import DivergedError, FiveBarError

COMMANDS = {
    "run": run,
    "check": check,
    "replay": replay,
    "report": report,
    "render": render,
    "view": view,
    "workspace": workspace,
}


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
    """Parse the arguments and call their command."""
    if args == ["--version"]:
        print(f"fivebar-sim {__version__}")  # noqa: T201
        return 0
    return tyro.extras.subcommand_cli_from_dict(
        COMMANDS,
        prog="fivebar",
        description="Simulate closed-chain five-bar legs; measure tracking and load sharing.",
        args=args,
        config=(tyro.conf.FlagCreatePairsOff,),
    )
