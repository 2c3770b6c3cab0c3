"""Commands that are struck at any moment, by Ctrl-C, SIGTERM or SIGKILL: no half result is left."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from shell import Shell, started

from fivebar_sim.runs import stored

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends no signals to one process")

BEGINS = """
import sys
from fivebar_sim.cli import main
print("begun", flush=True)
sys.exit(main())
"""
"""The program, that says when its own function begins; before that it is the interpreter's."""

SAID = {
    signal.SIGINT: {(130, "fivebar: interrupted\n"), (-signal.SIGINT, "")},
    signal.SIGTERM: {(143, ""), (-signal.SIGTERM, "")},
    signal.SIGKILL: {(-signal.SIGKILL, "")},
}
"""Status and stderr of what was struck; by the signal itself before it is heard, or at the end."""


class Struck(NamedTuple):
    """A command to be struck.

    Attributes:
        command: Its words; {} is a number of its own.
        status: How it ends if nothing strikes it.
        check: Fails unless what is left is whole; gets the number of the strike.
    """

    command: str
    status: int
    check: Callable[[int], object]


def _new(number: int) -> None:
    if Path(f"new{number}").exists():
        stored.read(Path(f"new{number}"))


def _kept(number: int) -> None:
    run = stored.read(Path("kept"))
    # 0.6 s are those of the one that was not struck.
    assert run.scenario.duration in {0.5, *(float(f"0.{600 + n}") for n in range(number + 1))}
    assert Path("kept/notes.txt").read_text("utf-8") == "precious"


def _failed(number: int) -> None:
    if Path("failed/short").exists():
        assert stored.read(Path("failed/short")).measured.verdict == "fail"


def _page(number: int) -> None:
    page = Path(f"page{number}.html")
    assert not page.exists() or page.read_bytes().endswith(b"</html>\n")


def _picture(number: int) -> None:
    picture = Path(f"picture{number}.png")
    assert not picture.exists() or picture.read_bytes().endswith(b"IEND\xaeB`\x82")


COMMANDS = {
    "run": Struck("run short.toml --quiet --out new{}", 0, _new),
    "run over": Struck("run short.toml --quiet --out kept --set duration=0.{}", 0, _kept),
    "check": Struck(
        "check short.toml --quiet --keep failed --set limits.tracking.rms=1e-9", 1, _failed
    ),
    "report": Struck("report sound --quiet --out page{}.html", 0, _page),
    "render": Struck("render sound --width 160 --height 120 --out picture{}.png", 0, _picture),
}


def begin(shell: Shell, place: str) -> None:
    """Write the run that is there before."""
    words = ["run", "short.toml", "--quiet", "--set", "duration=0.5", "--out", place]
    assert shell(*words).status == 0
    Path(place, "notes.txt").write_text("precious", "utf-8")


def ended(struck: Struck, number: int, sent: signal.Signals, after: float) -> tuple[int, str]:
    """Start a command, strike it some seconds after it has begun; return status and stderr."""
    words = struck.command.format(600 + number if "duration" in struck.command else number)
    with started([sys.executable, "-c", BEGINS, *words.split()], text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(after)
        process.send_signal(sent)
        err = process.communicate()[1]
    return process.returncode, err


def strike(struck: Struck, number: int, sent: signal.Signals, after: float) -> bool:
    """Strike a command, and check what is left; return whether that ended it."""
    before = set(Path().rglob(".*"))
    left = ended(struck, number, sent, after)
    assert left in {*SAID[sent], (struck.status, "")}, (struck, sent, after, left)
    struck.check(number)
    # What SIGKILL leaves, nobody could clear away.
    if sent != signal.SIGKILL:
        assert set(Path().rglob(".*")) <= before, (struck, sent, after)
    return left != (struck.status, "")


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_struck_leaves_the_old_one_or_the_new_one(
    shell: Shell, sent: signal.Signals
) -> None:
    begin(shell, "kept")
    strike(COMMANDS["run over"], 1, sent, after=random.Random(int(sent)).uniform(0.0, 1.0))


STRUCK_AT_ONCE = """
import sys
from fivebar_sim.cli import main

class Striking:
    def find_spec(self, name, *others):
        if name == "fivebar_sim.cli.signals":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Striking())
sys.exit(main())
"""
"""The program, struck by Ctrl-C before anything of it is imported that could listen."""


def test_ctrl_c_before_anybody_listens_leaves_no_traceback() -> None:
    with started([sys.executable, "-c", STRUCK_AT_ONCE, "--version"], text=True) as process:
        assert process.communicate()[1] == ""
    assert process.returncode == -signal.SIGINT


@pytest.mark.long
@pytest.mark.parametrize("name", COMMANDS)
def test_commands_struck_a_hundred_times_leave_nothing_half(shell: Shell, name: str) -> None:
    for place in ("kept", "sound"):
        begin(shell, place)
    struck = COMMANDS[name]
    started_at = time.monotonic()
    assert ended(struck, 0, signal.SIGCONT, 0.0) == (struck.status, "")
    takes = time.monotonic() - started_at

    rng = random.Random(1)
    came = Counter[signal.Signals]()
    for number in range(1, 101):
        sent = list(SAID)[number % 3]
        came[sent] += strike(struck, number, sent, rng.uniform(0.0, takes))
    assert min(came[sent] for sent in SAID) > 10
