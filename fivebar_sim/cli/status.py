"""Exit statuses, and the one-line message that explains them; quick to import."""

from __future__ import annotations

import sys
from contextlib import suppress

from fivebar_sim.cli.plain import plain

FAILED = 1
WRONG = 2
INTERRUPTED = 130
UNREAD = 141

HEAD = 400
TAIL = 190
"""Characters kept from the beginning and from the end of a message that is too long to read."""


def say(error: BaseException | str) -> None:
    """Print a message to stderr: one short line of plain text."""
    # Where nobody can be told, as on a full disk, the status still counts.
    with suppress(OSError):
        print(f"fivebar: {one_line(str(error))}", file=sys.stderr, flush=True)  # noqa: T201


def one_line(text: str) -> str:
    """Return a text as one line, with unprintable characters escaped."""
    line = plain(" ".join(text.split()))
    return line if len(line) <= HEAD + TAIL + 10 else f"{line[:HEAD]} ... {line[-TAIL:]}"
