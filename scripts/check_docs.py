"""./.venv/bin/python scripts/check_docs.py [--long] [PAGE ...]: runs what the documentation shows.

Each page, README.md and docs/, has a folder of its own with a copy of the checkout. There its `sh`
and `console` blocks run in a shell, in order, and its `python` blocks as one program; a block with
title="FILE" becomes that file first. A block of nothing but plain `fivebar ...` needs no shell:
outside of README.md its lines call the main function, which saves what a new program takes to
import. What a command prints must hold the lines that a page shows of it, in order; ... in a line
is whatever is left out. Numbers of three digits and more may be off by one in the last digit shown,
others must round to it; below 1e-8 they are rounding errors, and may be ten times as large. A
comment before a block, a table or a paragraph says more:

    <!-- printed by: COMMAND -->          the block or table is what COMMAND prints ("python": the
                                          page's program); a COMMAND with {1}, the first cell, runs
                                          for every row, and heads are labels in what it prints
    <!-- printed by: COMMAND => A; B -->  the paragraph has A and B, and COMMAND prints them, as
                                          LABEL: A in the line of that label
    <!-- printed by, long: ... -->        as above, but only with --long
    <!-- long: WHY -->                    the block runs only with --long
    <!-- status: N -->                    the block ends with exit status N
    <!-- not checked: WHY -->             the block is not run, the table not compared

A text block or a table with decimals must have one.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from shown import (
    Item,
    WrongError,
    alike,
    cells,
    compare_lines,
    compare_values,
    items,
    labelled,
    tokens,
)

ROOT = Path(__file__).resolve().parent.parent
COPIED = (
    *("docs", "examples", "models", "scenarios", "conformance", "designs", "scripts", "tests"),
    "pyproject.toml",
)
CODE = re.compile(r"`[^`]+`")
DECIMAL = re.compile(r"\d\.\d")
CELL = re.compile(r"\{(\d)\}")
RULE = re.compile(r"^\|[-| ]+\|$", re.M)

SHELL = set("$|&;<>()`*?~")
"""What only a shell understands: a line without these is a list of words."""

PROGRAM = [["fivebar"], [".venv/bin/fivebar"]]
"""How pages call it."""

PLAIN = {"COLUMNS": "80", "NO_COLOR": "1"}
"""What commands are told of the terminal, which is none."""


class Printed(NamedTuple):
    """What came of a command."""

    status: int
    text: str


def compare_row(labels: list[str], row: list[str], came: Printed) -> None:
    """Raise unless the cells of a row are what was printed after the labels of their columns."""
    ended = next((cell for cell in row if cell.startswith("status ")), "")
    if came.status != (int(ended.split()[1].rstrip(":")) if ended else 0):
        raise WrongError(f"ends with status {came.status}:\n{came.text}")

    wrong: list[str] = []
    for label, cell in zip(labels[1:], row[1:], strict=True):
        if cell and cell == ended:
            compare_values(cell.partition(": ")[2], cell, came.text)
        elif label and cell:
            shown = tokens(cell)
            rest = labelled(came.text, label)
            if not alike(shown, rest[: len(shown)]):
                wrong.append(f"{label} {cell}, printed is {' '.join(rest)}")

    if wrong:
        raise WrongError("shows " + "; ".join(wrong))


def joined(script: str) -> list[str]:
    """Return the commands of a script, one each; a backslash at the end of a line goes on."""
    lines = script.replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def fivebar_args(line: str) -> list[str] | None:
    """Return the arguments of a line that only calls `fivebar`; None of any other."""
    try:
        words = shlex.split(line, comments=True)
    except ValueError:  # a quote that ends in another line
        return None

    return None if SHELL & set(line) or words[:1] not in PROGRAM else words[1:]


class Page:
    """A page's folder, and what was run in it."""

    def __init__(self, text: str, folder: Path, *, long: bool, quick: bool = True) -> None:
        self.folder = folder
        self.long = long
        self.quick = quick
        self.items = list(items(text))
        self.outputs: dict[str, Printed] = {}
        self.ran = self.compared = self.left = 0

    def lay(self) -> None:
        """Copy the checkout and write the titled blocks; make the Python blocks one program."""
        for name in COPIED:
            if (ROOT / name).is_dir():
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(ROOT / name, self.folder / name, ignore=ignored)
            else:
                shutil.copy(ROOT / name, self.folder / name)

        (self.folder / ".venv").mkdir()
        for path in Path(sys.prefix).iterdir():
            (self.folder / ".venv" / path.name).symlink_to(path)

        program: list[str] = []
        for item in self.items:
            if item.title:
                (self.folder / item.title).parent.mkdir(exist_ok=True)
                (self.folder / item.title).write_text(item.text + "\n", encoding="utf-8")
            elif item.kind == "python" and not self.left_out(item):
                program += [""] * (item.line - len(program))  # the page's own line numbers
                program += item.text.splitlines()

        if program:
            (self.folder / "page.py").write_text("\n".join(program) + "\n", encoding="utf-8")

    def left_out(self, item: Item) -> bool:
        """Return whether an item is not for this time."""
        return item.note == "not checked" or ("long" in item.note and not self.long)

    def shell(self, script: str) -> Printed:
        """Run a script in the page's folder."""
        path = f"{self.folder}/.venv/bin{os.pathsep}{os.environ['PATH']}"
        self.ran += 1
        done = subprocess.run(
            ["bash", "-eu", "-c", script],
            cwd=self.folder,
            env={**os.environ, **PLAIN, "PATH": path},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )

        return Printed(done.returncode, done.stdout)

    def command(self, line: str) -> Printed:
        """Run one command."""
        args = fivebar_args(line)
        if line == "python":
            return self.shell("python page.py")
        return self.shell(line) if args is None else self.fivebar(args)

    def block(self, script: str) -> Printed:
        """Run the lines of a block, until one fails."""
        lines = [fivebar_args(line) for line in joined(script)]
        if None in lines or not self.quick:
            return self.shell(script)

        said = ""
        status = 0
        for args in lines:
            came = self.fivebar(args or [])
            said += came.text
            status = came.status
            if status:
                break

        return Printed(status, said)

    def fivebar(self, args: list[str]) -> Printed:
        """Call the main function of `fivebar`."""
        from fivebar_sim import cli

        self.ran += 1
        said = io.StringIO()
        with (
            contextlib.chdir(self.folder),
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            status = cli.main(args)

        return Printed(status, said.getvalue())

    def succeeded(self, line: str) -> str:
        """Return what a command prints that ends with status 0; each runs once for a page."""
        came = self.outputs[line] = self.outputs.get(line) or self.command(line)
        if came.status:
            raise WrongError(f"'{line}' ends with status {came.status}:\n{came.text}")
        return came.text

    def rows(self, item: Item) -> None:
        """Compare a table with what its command prints for every row."""
        head, _, *rows = (cells(row) for row in item.text.splitlines())
        labels = [re.sub(r" \[.*\]$", "", label) for label in head]  # the heads without units
        wrong: list[str] = []
        for row in rows:
            command = CELL.sub(lambda n, row=row: row[int(n[1]) - 1], item.said)
            came = self.command(command.replace("`", ""))
            try:
                compare_row(labels, row, came)
            except WrongError as error:
                wrong.append(f"{row[0]}: {error}")

        if wrong:
            raise WrongError("\n  ".join(wrong))

    def run(self, item: Item) -> None:
        """Run a block in a shell."""
        wanted = int(item.said) if item.note == "status" else 0
        script = item.text
        shown = ""
        if item.kind == "console":
            script = "\n".join(re.findall(r"^\$ (.*)", item.text, re.M))
            shown = re.sub(r"^\$ .*", "", item.text, flags=re.M)
            self.compared += 1

        came = self.block(script)
        if came.status != wanted:
            raise WrongError(f"ends with status {came.status}, not {wanted}:\n{came.text}")

        if shown.strip():
            compare_lines(shown, came.text)

    def printed(self, item: Item) -> None:
        """Compare an item with what the command of its comment prints."""
        self.compared += 1
        command, _, values = item.said.partition(" => ")
        if item.kind == "table" and CELL.search(command):
            self.rows(item)
        elif values:
            compare_values(values, item.text, self.succeeded(command))
        elif item.kind in ("text", "table"):
            compare_lines(RULE.sub("", item.text), self.succeeded(command))
        else:
            raise WrongError("has a comment that says no values")

    def check(self, item: Item) -> None:
        """Raise unless an item is true."""
        if self.left_out(item):
            self.left += 1
        elif item.note.startswith("printed by"):
            self.printed(item)
        elif item.kind in ("sh", "console"):
            self.run(item)
        elif item.kind == "python" and not item.title:
            self.succeeded("python")
        elif item.kind == "toml":
            tomllib.loads(item.text)
        elif (
            not item.title
            and item.kind in ("text", "table")
            and DECIMAL.search(CODE.sub("", item.text))
        ):
            raise WrongError("has decimals, and no comment says what prints them")


def check_page(name: str, *, long: bool) -> tuple[str, list[str]]:
    """Return a line about a page, and what is wrong in it."""
    start = time.monotonic()
    wrong = []
    with tempfile.TemporaryDirectory(prefix="docs-") as folder:
        try:
            text = (ROOT / name).read_text(encoding="utf-8")
            page = Page(text, Path(folder), long=long, quick=name != "README.md")
        except WrongError as error:
            return f"{name}: not read", [f"{name}: {error}"]
        if any(item.kind in ("sh", "console", "python") or item.note for item in page.items):
            page.lay()
        for item in page.items:
            try:
                page.check(item)
            except WrongError as error:
                wrong.append(f"{name}:{item.line}: {error}")

    said = f"{page.ran} commands run, {page.compared} outputs compared, {page.left} left out"
    return f"{name}: {said}, {time.monotonic() - start:.0f} s", wrong


def main() -> int:
    """Check pages in parallel; return 1 if something in them is wrong."""
    parser = argparse.ArgumentParser(description="Run what the documentation shows.")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="none: README.md and docs/")
    parser.add_argument("--long", action="store_true", help="also what takes minutes")
    options = parser.parse_args()
    found = sorted((ROOT / "docs").rglob("*.md"), key=lambda path: -path.stat().st_size)
    names = options.pages or ["README.md", *(str(path.relative_to(ROOT)) for path in found)]
    failed = False
    os.environ.update(PLAIN)

    with ProcessPoolExecutor() as pool:
        for job in [pool.submit(check_page, name, long=options.long) for name in names]:
            line, wrong = job.result()
            print(line, *wrong, sep="\n", flush=True)
            failed |= bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
