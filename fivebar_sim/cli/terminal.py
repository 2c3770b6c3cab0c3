"""What the program tells a terminal and a shell: plain text, one-line messages, exit statuses.

Control characters are escaped in one place, whoever wrote them. Quick to import.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any

FAILED = 1
WRONG = 2
INTERRUPTED = 130
UNREAD = 141

HEAD = 400
TAIL = 190
"""Characters kept from the beginning and from the end of a message that is too long to read."""


def plain(text: str) -> str:
    r"""Return a text with every invisible character written as an escape: "\x1b", "\u202e".

    These are control characters, marks that change the direction of writing, line separators and
    bytes that are not UTF-8; line breaks stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


class Plain:
    """A stream that writes plain text only, and otherwise behaves like the stream it wraps.

    Attributes:
        styled: Whether colours pass: only while no text of others is written.
        stream: The wrapped stream.
    """

    def __init__(self, stream: Any) -> None:
        self.styled = False
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text, escaped unless `styled`."""
        return self.stream.write(text if self.styled else plain(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def output() -> Iterator[None]:
    """Make stdout and stderr plain; what is written to one that was closed before is dropped."""
    with ExitStack() as both:
        # Where they are closed, as by `>&-` or under pythonw, Python has none.
        nowhere = both.enter_context(open(os.devnull, "w", encoding="utf-8"))
        both.enter_context(redirect_stdout(Plain(sys.stdout or nowhere)))  # pyright: ignore[reportArgumentType]
        both.enter_context(redirect_stderr(Plain(sys.stderr or nowhere)))  # pyright: ignore[reportArgumentType]
        yield


def style(*, allowed: bool) -> None:
    """Switch the colours of stdout and stderr on or off."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Plain):
            stream.styled = allowed


def unwrap(stream: Any) -> Any:
    """Return the stream within a plain one, for a writer that escapes text and adds colours."""
    return stream.stream if isinstance(stream, Plain) else stream


def say(error: BaseException | str) -> None:
    """Print a message to stderr: one short line of plain text."""
    # Where nobody can be told, as on a full disk, the status still counts.
    with suppress(OSError):
        print(f"fivebar: {one_line(str(error))}", file=sys.stderr, flush=True)  # noqa: T201


def one_line(text: str) -> str:
    """Return a text as one line, with unprintable characters escaped."""
    line = plain(" ".join(text.split()))
    return line if len(line) <= HEAD + TAIL + 10 else f"{line[:HEAD]} ... {line[-TAIL:]}"
