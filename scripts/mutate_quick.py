"""./.venv/bin/python scripts/mutate_quick.py: kills some of the mutants in scripts/mutants.txt.

That table holds mutants of the core rooms that scripts/mutate.py saw die, each with a test that
fails for it. Some are drawn and put into a copy, one after another; the test must fail there, and
pass without. Lines that are not in the code any more are left out.

    --count N     of each room, default 2
    --seed S      of the draw, default 0
    --all         the whole table
    --renew DIR   fills the table up to 8 a room, from what `scripts/mutate.py --work DIR` found

Exit status: 0 if every mutant drawn died, else 1.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import hypothesis
import mujoco  # noqa: F401  what the tests import, once for all forks
import mutate
import numpy as np  # noqa: F401
import pytest

TABLE = Path(__file__).with_name("mutants.txt")
EACH = 8
"""Mutants of a room in a renewed table."""
LEAST = 4
"""Mutants of a room whose lines must still be in the code, or the table is out of date."""
SECONDS = 120
"""A mutant that runs longer is dead."""
NONE = "none"

# as tests/conftest.py draws; but that a mutant dies is enough, no smallest example is looked for
hypothesis.settings.register_profile(
    "unshrunk",
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
    phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate],
)


class Mutant(NamedTuple):
    """A line of a file, what becomes of it, and the test that sees it."""

    file: str
    old: str
    new: str
    test: str

    def fits(self) -> bool:
        """Return whether the line is in the code, once."""
        path = mutate.ROOT / self.file
        return path.is_file() and path.read_text("utf-8").splitlines().count(self.old) == 1

    def block(self) -> str:
        """Return the mutant as the table has it."""
        return f"{self.file} {self.test}\n-{self.old}\n+{self.new}\n"


def table() -> list[Mutant]:
    """Return the mutants whose lines are still in the code."""
    rows = []
    for block in TABLE.read_text(encoding="utf-8").split("\n\n"):
        head, old, new = block.strip("\n").splitlines()
        file, test = head.split(" ", 1)
        rows.append(Mutant(file, old[1:], new[1:], test))
    return [row for row in rows if row.fits()]


def room_of(file: str) -> str:
    """Return the room that a file of the table is in, also one that mutmut leaves out there."""
    path = Path(file)
    return next(
        (name for name, room in mutate.ROOMS.items() if any(path.match(f) for f in room.files)),
        path.parts[1],
    )


class _Failed:
    """A plugin that tells the first test that failed."""

    first = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the name of a failing test, without its parameters."""
        if report.failed and not self.first:
            self.first = report.nodeid.split("[")[0]


def failing(folder: Path, tests: list[str]) -> str:
    """Return the first of the tests that fails in a copy, NONE if all pass, run in a fork."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        came = "broken off"
        try:
            came = asked(folder, tests)
        finally:
            os.write(writer, came.encode())
            os._exit(0)  # what the parent opened is the parent's to close

    os.close(writer)
    with os.fdopen(reader) as pipe:
        came = pipe.read()

    os.waitpid(child, 0)
    return came or "took too long"


def asked(folder: Path, tests: list[str]) -> str:
    """Return the first of the tests that fails in a copy, NONE if all pass; silently."""
    signal.alarm(SECONDS)
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    failed = _Failed()
    skipped = [f"--deselect={test}" for test in mutate.SLOW]
    options = ["-x", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    profile = "--hypothesis-profile=unshrunk"
    code = pytest.main([*options, profile, *skipped, *tests], plugins=[failed])
    return failed.first or (NONE if code == 0 else f"pytest's exit status {code}")


@contextmanager
def copied() -> Iterator[Path]:
    """Give a copy of the tree, for as long as it is needed."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary).resolve()
        for name in mutate.COPIED:
            # With its bytecode, which holds while a file keeps its time: else all is compiled.
            ignored = shutil.ignore_patterns("*.rrd")
            shutil.copytree(mutate.ROOT / name, folder / name, ignore=ignored)
        shutil.copy(mutate.ROOT / "pyproject.toml", folder)
        yield folder


def killer(folder: Path, mutant: Mutant, tests: list[str]) -> str:
    """Return the first of the tests that fails for a mutant, NONE if it lives."""
    path = folder / mutant.file
    source = path.read_text(encoding="utf-8")
    path.write_text(source.replace(f"{mutant.old}\n", f"{mutant.new}\n"), encoding="utf-8")
    compiled = Path(importlib.util.cache_from_source(str(path)))
    try:
        compiled.unlink(missing_ok=True)
        return failing(folder, tests)
    finally:
        path.write_text(source, encoding="utf-8")
        compiled.unlink(missing_ok=True)


def drawn(rows: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return so many mutants of each room."""
    chosen: list[Mutant] = []
    for name in mutate.ROOMS:
        room = [row for row in rows if room_of(row.file) == name]
        if len(room) < LEAST:
            sys.exit(f"{TABLE.name}: only {len(room)} mutants of {name} fit the code; --renew it")
        chosen += random.Random(seed).sample(room, count)
    return chosen


def kill(chosen: list[Mutant]) -> int:
    """Kill the mutants, say which lived, and return the exit status."""
    with copied() as folder:
        tests = sorted({row.test for row in chosen})
        if (broken := failing(folder, tests)) != NONE:
            print(f"without any mutant fails: {broken}")
            return 1
        lived = [row for row in chosen if killer(folder, row, [row.test]) != row.test]
    for row in lived:
        print(f"lives, or breaks the test off:\n{row.block()}")
    print(f"{len(chosen) - len(lived)} of {len(chosen)} mutants killed")
    return 1 if lived else 0


def candidates(work: Path, name: str) -> Iterator[tuple[Mutant, list[str]]]:
    """Yield mutants of a room that died and the quickest tests that reach them.

    In random order, and without the easy ones.
    """
    folder = work / name
    stats = json.loads((folder / "mutants" / "mutmut-stats.json").read_text(encoding="utf-8"))
    seconds = stats["duration_by_test"]
    reached = stats["tests_by_mangled_function_name"]
    dead = [each for each, code in mutate.verdicts(folder).items() if code in (1, 3)]
    random.Random(0).shuffle(dead)

    for each in dead:
        lines = mutate.change(folder, each).splitlines()
        if [line[0] for line in lines] == ["-", "+"]:
            old, new = (line[1:] for line in lines)
            file = "/".join(each.split(".x")[0].split(".")) + ".py"
            row = Mutant(file, old, new, "")
            if row.fits() and not easy(old, new):
                tests = sorted(reached[each.rpartition("__mutmut_")[0]], key=seconds.__getitem__)
                yield row, list(dict.fromkeys(test.split("[")[0] for test in tests))[:8]


def easy(old: str, new: str) -> bool:
    """Return whether a change loses an argument or a value, which any call of it sees."""
    return new.count("None") > old.count("None") or new.count(",") != old.count(",") or ", )" in new


def renew(work: Path) -> int:
    """Keep the table's mutants that still fit the code, and add to them."""
    rows = table()
    with copied() as folder:
        for name in mutate.ROOMS:
            lacking = EACH - sum(room_of(row.file) == name for row in rows)
            for row, tests in candidates(work, name):
                if lacking <= 0:
                    break
                test = killer(folder, row, tests)
                if test.startswith("tests/"):
                    rows.append(row._replace(test=test))
                    lacking -= 1

    text = "\n".join(sorted(row.block() for row in rows))
    TABLE.write_text(text, encoding="utf-8")
    return 0


def main() -> int:
    """Kill some mutants, or renew the table of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--renew", type=Path)
    options = parser.parse_args()
    if options.renew is not None:
        return renew(options.renew.resolve())

    rows = table()
    return kill(rows if options.all else drawn(rows, options.count, options.seed))


if __name__ == "__main__":
    sys.exit(main())
