"""Nothing foreign is printed raw: names, options, keys, values and paths, on stdout and stderr."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest
from shell import ELLIPSE, Said, Shell

from fivebar_sim.cli import common, terminal
from fivebar_sim.report import single

ODD = [
    "\x1b[31mred \x07bell a\rb a\x0bb \x7fdel \x9b31m",
    "\u202eright \u2066in a\u2028b a\u2029b \u200bnothing",
    "\udcffhalf",
]
"""Words of letters that would do something to a terminal, or hide something."""


def test_what_cannot_be_seen_is_told_and_all_else_stays() -> None:
    assert terminal.plain("two\nlines, é, ╭, [red]x") == "two\nlines, é, ╭, [red]x"
    assert terminal.plain("\x1b[31m \x7f \x9b \u202e \u2028 \r \t") == (
        "\\x1b[31m \\x7f \\x9b \\u202e \\u2028 \\r \\t"
    )
    for odd in "".join(ODD):
        assert terminal.plain(odd).isprintable()


def _raw(text: str) -> set[str]:
    return {c for c in text if not c.isprintable() and c != "\n"}


@pytest.mark.parametrize("odd", ODD)
def test_odd_words_are_told(shell: Shell, odd: str) -> None:
    commands = [
        [odd],
        ["run", odd],
        ["run", f"--o{odd}"],
        ["run", "short.toml", f"--{odd}", "x"],
        ["check", "short.toml", "--keep", odd, odd],
        ["run", "short.toml", "--set", odd],
        ["run", "short.toml", "--set", f"{odd}=1"],
        ["run", "short.toml", "--set", f"name={odd}"],
        ["run", "short.toml", "--set", f"leg.name={odd}"],
        ["run", "short.toml", "--set", f"path.kind={odd}"],
        ["render", "no", "--fps", odd],
        ["report", odd, "--out", f"{odd}.html"],
        ["replay", odd, "--web", "--port", odd],
        ["workspace", odd],
    ]
    for command in commands:
        try:
            said = shell(*command)
        except SystemExit as end:  # the parser's own way out
            out, err = shell.capture.readouterr()
            said = Said(int(str(end.code)), out, err)
        assert said.status == 2
        assert said.err
        assert _raw(said.out + said.err) == set(), command


def test_places_are_printed_as_they_are(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(single, "figures", lambda run: [])  # nobody looks at them
    for place, told in (("[red]x", "[red]x"), (":apple:", ":apple:"), ("\x1b[31m", "\\x1b[31m")):
        for name in ("[bold]y", ":apple:"):
            run = ["run", "short.toml", "--set", f"leg.name={name}", "--out", place]
            said = shell(*run)
            assert (said.status, said.err) == (0, "")
            assert f"written to {told}\n" in said.out
            assert f"short: {name} leg" in said.out
            assert _raw(said.out) == set()
    page = "\u202e.html"
    said = shell("report", "[red]x", "--out", page)
    assert said == (0, "report of 1 run in \\u202e.html\n", "")


def test_names_in_files_are_refused_plainly(shell: Shell) -> None:
    for key in ("name", "leg.name", "path.kind", "servo.preset"):
        odd = r'"\u001b[31m\u202e"'
        line = ELLIPSE.replace('name = "short"', "") if key == "name" else ELLIPSE
        Path("odd.toml").write_text(f"{key} = {odd}\n{line}" if key == "name" else line)
        settings = () if key == "name" else ("--set", f"{key}={odd}")
        said = shell("run", "odd.toml", *settings)
        assert said.status == 2
        assert _raw(said.out + said.err) == set()
        assert "\\x1b[31m\\u202e" in said.err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such terminals")
def test_a_terminal_gets_our_colours_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    stream = Terminal()
    monkeypatch.setattr(sys, "stdout", stream)
    with terminal.output():
        common.screen().print("[green]ok[/green]", "\x1b[5mblinks")
        common.screen().print("3.14 True http://example.org :apple: 'x'")
        sys.stdout.write("\x1b[5mblinks\n")
        terminal.style(allowed=True)
        sys.stdout.write("\x1b[1mours\n")
        terminal.style(allowed=False)
        sys.stdout.write("\x1b[1mnot\n")
    assert stream.getvalue() == (
        "\x1b[32mok\x1b[0m \\x1b[5mblinks\n3.14 True http://example.org :apple: 'x'\n"
        "\\x1b[5mblinks\n\x1b[1mours\n\\x1b[1mnot\n"
    )
    assert sys.stdout is stream
