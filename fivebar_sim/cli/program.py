"""The program `fivebar`: parses arguments and calls a command.

Exit status: 0 fine, 1 failed, 2 bad input; `terminal` has all of them.
"""

from __future__ import annotations

import atexit
import functools
import gc
import importlib
import io
import keyword
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from fivebar_sim.cli import arrow, memory, signals, terminal
from fivebar_sim.cli.terminal import FAILED, INTERRUPTED, UNREAD, WRONG, say
from fivebar_sim.errors import ConfigError, DivergedError, FiveBarError, unknown

COMMANDS = {
    "list": "List scenarios, legs, servos, robots, paths and controllers.",
    "new": "Write a scenario to start from, with comments and units.",
    "run": "Simulate scenarios, check their limits, write run directories.",
    "check": "Check scenarios against limits, guards and recorded baselines.",
    "converge": "Show which metrics a scenario's timestep already gets right.",
    "sweep": "Simulate a scenario for all values of some of its keys.",
    "identify": "Find the numbers of a real leg and its servos from logs.",
    "design": "Search which leg should be built for a task, and certify the best.",
    "replay": "Open the recordings of runs in the Rerun viewer, on this machine.",
    "report": "Explain a run, or compare several, on one self-contained HTML page.",
    "render": "Draw a run: leg, target path, the foot's trail, the ground's force.",
    "view": "Open MuJoCo's viewer: a scenario's run, or a leg moved by sliders.",
    "workspace": "Draw what a leg's foot can reach, and how deep inside it is.",
    "log": "Show what a log holds: columns, rate, gaps, ranges, and guesses.",
    "compare": "Lay a real leg's log over the simulated leg, sent its commands.",
    "certify": "Check any program that computes a leg against known answers.",
    "export": "Write a leg as MJCF, URDF or C, a gait as a table, a run as MCAP.",
    "import": "Understand the five-bar leg of an MJCF or URDF, as a preset.",
    "page": "Write a leg to play with on one HTML page, in any browser.",
}
"""The commands, each with the first line of its help.

A command is a function in the module of its name in `fivebar_sim.cli`; its docstring begins with
the same line. What is a word of Python's has an underscore behind it there.
"""

HELP = {"-h", "--help"}

COMPLETION = "--completion"
"""The option that prints a script with which a shell completes commands and their options."""

SHELLS = ("bash", "fish", "zsh")

FEWEST = 40
"""Columns of a terminal in which help can be read."""

SAFE = "PYTHONSAFEPATH"
"""The variable with which Python imports nothing from the folder that it is started in."""

SELDOM = 300_000
"""New objects after which the garbage collector looks for what nobody needs any more.

More than all imports make: what they make stays, and to go through it would be in vain.
"""

_before: dict[str, str | None] = {}
"""What `_environment` changed, and what it was before."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    args = list(sys.argv[1:] if argv is None else argv)
    # A name may have letters that the terminal's encoding lacks: they must not end the program.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    with terminal.output(), _environment(_needed()), _seldom_collected():
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
    _before.update({name: os.environ.get(name) for name in changes})
    os.environ.update(changes)
    try:
        yield
    finally:
        theirs = user_environment()
        _before.clear()
        for name in changes:
            os.environ.pop(name, None)
            if name in theirs:
                os.environ[name] = theirs[name]


@contextmanager
def _seldom_collected() -> Iterator[None]:
    """Have the garbage collector look less often within."""
    before = gc.get_threshold()
    # 0 is the user's wish that it never looks.
    if before[0]:
        gc.set_threshold(max(before[0], SELDOM), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
        # At the end of the process too, which has no need of the memory any more.
        atexit.unregister(gc.freeze)
        atexit.register(gc.freeze)


def user_environment() -> dict[str, str]:
    """Return the environment as the user has it, for a program of the user's own."""
    kept = {name: value for name, value in os.environ.items() if name not in _before}
    return kept | {name: value for name, value in _before.items() if value is not None}


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

    name = args[0] if args else ""
    if name in HELP:
        # Without the parser, which takes longer to import than everything else here.
        print(_overview())  # noqa: T201
        return 0
    if name == COMPLETION:
        return _print_completion(args[1:])
    if name not in COMMANDS:
        raise ConfigError(_no_command(name))

    # Help needs no memory to speak of.
    if not HELP & set(args):
        memory.check()
    # Imported late, so that errors and signals during the import are reported like all others.
    import tyro

    # The parser colours its messages and quotes the arguments in them.
    terminal.style(allowed=all(arg.isprintable() for arg in args))
    # Without the parsers of all other commands, which take three times as long.
    command = _command(name)
    return tyro.cli(command, prog=f"fivebar {name}", args=args[1:], **_parsing())


def _overview() -> str:
    """Return the help of the program itself: a line for each command."""
    widest = max(len(name) for name in COMMANDS)
    lines = [f"  {name:{widest}}  {summary}" for name, summary in COMMANDS.items()]

    return "\n".join(
        [
            "usage: fivebar COMMAND [ARGUMENTS]",
            "",
            "Simulate closed-chain five-bar legs; measure tracking and load sharing.",
            "",
            *lines,
            "",
            "fivebar COMMAND --help explains a command; fivebar --version names the version;",
            f"fivebar {COMPLETION} {'|'.join(SHELLS)} prints what makes a shell complete them.",
        ]
    )


def _no_command(name: str) -> str:
    """Return the message for a first argument that is not a command."""
    what = unknown("command", name, COMMANDS) if name else f"no command; known: {_known()}"
    return f"{what}; see fivebar --help"


def _known() -> str:
    return ", ".join(sorted(COMMANDS))


def _print_completion(shells: list[str]) -> int:
    """Print the script that makes a shell complete commands and options."""
    if len(shells) != 1 or shells[0] not in SHELLS:
        raise ConfigError(f"{COMPLETION} takes {', '.join(SHELLS)}, got {' '.join(shells)!r}")
    import tyro

    # The parser prints it and then ends the program.
    tyro.extras.subcommand_cli_from_dict(
        {name: _command(name) for name in COMMANDS},
        prog="fivebar",
        args=["--tyro-print-completion", *shells],
        **_parsing(),
    )
    return 0


def _parsing() -> dict[str, Any]:
    """Return how arguments are parsed."""
    import tyro

    from fivebar_sim.cli.common import TYPES

    return {"config": (tyro.conf.FlagCreatePairsOff,), "registry": TYPES}


def function_of(name: str) -> Callable[..., int]:
    """Return the function of a command."""
    word = f"{name}_" if keyword.iskeyword(name) else name
    return getattr(importlib.import_module(f"fivebar_sim.cli.{word}"), word)


def _command(name: str) -> Callable[..., int]:
    """Return the function of a command, wrapped so that it prints plain text."""
    function = function_of(name)

    @functools.wraps(function)
    def command(*args: Any, **options: Any) -> int:
        terminal.style(allowed=False)
        if name in arrow.USED_BY:
            arrow.leave_pandas_out()
        return function(*args, **options)

    return command
