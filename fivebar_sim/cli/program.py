"""The program `fivebar`: parses arguments and calls a command.

Exit status: 0 fine, 1 failed, 2 bad input; `terminal` has all of them.
"""

from __future__ import annotations

import functools
import importlib
import io
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from fivebar_sim.cli import memory, signals, terminal
from fivebar_sim.cli.terminal import FAILED, INTERRUPTED, UNREAD, WRONG, say
from fivebar_sim.errors import DivergedError, FiveBarError

COMMANDS = ("run", "check", "converge", "replay", "report", "render", "view", "workspace")
"""The commands; each is a function in the module of its name in `fivebar_sim.cli`."""

HELP = {"-h", "--help"}

FEWEST = 40
"""Columns of a terminal in which help can be read."""

SAFE = "PYTHONSAFEPATH"
"""The variable with which Python imports nothing from the folder that it is started in."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    args = list(sys.argv[1:] if argv is None else argv)
    # A name may have letters that the terminal's encoding lacks: they must not end the program.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    with terminal.output(), _environment(_needed()):
        return _main(args)


def _needed() -> dict[str, str]:
    """Return the environment variables that the program needs otherwise than they are."""
    # No Python that is started within imports from the user's folder. Libraries start some: glfw
    # one that imports ctypes, and a ctypes.py there would be run.
    needed = {SAFE: "1"}
    # The parser would lay out its help for ever in less than eight columns, and rich nothing in 0.
    if shutil.get_terminal_size().columns < FEWEST:
        needed["COLUMNS"] = "80"
    return needed


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    """Have other environment variables within."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def _main(args: list[str]) -> int:
    """Call the command; report an error in one line."""
    try:
        with signals.listen():
            status = _call(args)
        # Flushed here, where a closed pipe is still caught, not when Python exits.
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
    # The reader has gone, as in `fivebar check | head`. What is still buffered goes to /dev/null:
    # otherwise Python fails once more when it flushes at its end.
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNREAD
    except OSError as error:
        say(error)
        return WRONG
    except MemoryError as error:
        say(f"not enough memory: {error}")
        return WRONG


def _call(args: list[str]) -> int:
    """Parse the arguments and call the command."""
    if args == ["--version"]:
        # Slow to import, and only this needs it.
        from importlib.metadata import version

        print(f"fivebar-sim {version('fivebar-sim')}")  # noqa: T201
        return 0

    # Help needs no memory to speak of.
    if not HELP & set(args):
        memory.check()

    # Imported late, so that errors and signals during the import are reported like all others.
    import tyro

    # The parser colours its messages and quotes the arguments in them.
    terminal.style(allowed=all(arg.isprintable() for arg in args))
    config = (tyro.conf.FlagCreatePairsOff,)
    name = args[0] if args else ""
    # Without the parsers of all other commands, which take three times as long.
    if name in COMMANDS:
        return tyro.cli(_command(name), prog=f"fivebar {name}", args=args[1:], config=config)

    return tyro.extras.subcommand_cli_from_dict(
        {name: _command(name) for name in COMMANDS},
        prog="fivebar",
        description="Simulate closed-chain five-bar legs; measure tracking and load sharing.",
        args=args,
        config=config,
    )


def _command(name: str) -> Callable[..., int]:
    """Return the function of a command, wrapped so that it prints plain text."""
    function = getattr(importlib.import_module(f"fivebar_sim.cli.{name}"), name)

    @functools.wraps(function)
    def command(*args: Any, **options: Any) -> int:
        terminal.style(allowed=False)
        return function(*args, **options)

    return command
