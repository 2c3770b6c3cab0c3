"""The program `fivebar`: parses and calls; exit status 0 fine, 1 failed, 2 bad input."""

from __future__ import annotations

import functools
import importlib
import io
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

from fivebar_sim.cli import memory, plain, signals
from fivebar_sim.cli.status import FAILED, INTERRUPTED, UNREAD, WRONG, say
from fivebar_sim.errors import DivergedError, FiveBarError

COMMANDS = ("run", "check", "replay", "report", "render", "view", "workspace")
"""Each in the module of its name in `fivebar_sim.cli`."""

HELP = {"-h", "--help"}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    args = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # any name, in any terminal's encoding
    with plain.output():
        return _main(args)


def _main(args: list[str]) -> int:
    """Call the command; say in one line what is wrong."""
    try:
        with signals.heard():
            status = _call(args)
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


def _call(args: list[str]) -> int:
    """Parse the arguments and call their command; all else is imported here, within `main`."""
    if args == ["--version"]:
        print(f"fivebar-sim {version('fivebar-sim')}")  # noqa: T201
        return 0

    if not HELP & set(args):
        memory.check()

    import tyro

    plain.style(allowed=all(arg.isprintable() for arg in args))  # the parser quotes them
    return tyro.extras.subcommand_cli_from_dict(
        {name: _command(name) for name in COMMANDS},
        prog="fivebar",
        description="Simulate closed-chain five-bar legs; measure tracking and load sharing.",
        args=args,
        config=(tyro.conf.FlagCreatePairsOff,),
    )


def _command(name: str) -> Callable[..., int]:
    """Return the function of a command; what it prints is plain."""
    function = getattr(importlib.import_module(f"fivebar_sim.cli.{name}"), name)

    @functools.wraps(function)
    def command(*args: Any, **options: Any) -> int:
        plain.style(allowed=False)
        return function(*args, **options)

    return command
