"""How the commands end: exit statuses, and the one line that says why; quick to import."""

from __future__ import annotations

import sys

from fivebar_sim.cli.plain import plain

FAILED = 1
WRONG = 2
INTERRUPTED = 130
UNREAD = 141

HEAD = 400
TAIL = 190
"""Characters that are kept of the begin and the end of a line too long to be read."""


def say(error: BaseException | str) -> None:
    """Print one line to stderr, short enough to be read, and nothing that a terminal obeys."""
    print(f"fivebar: {one_line(str(error))}", file=sys.stderr)  # noqa: T201


def one_line(text: str) -> str:
    """Return a text on one line: what cannot be printed is told with backslashes."""
    line = plain(" ".join(text.split()))
    return line if len(line) <= HEAD + TAIL + 10 else f"{line[:HEAD]} ... {line[-TAIL:]}"
