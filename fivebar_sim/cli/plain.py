"""Plain text for terminals: control characters are escaped in one place, whoever wrote them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import Any


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
    """Make stdout and stderr plain."""
    with ExitStack() as both:
        # Without a console, as under pythonw, Python has no streams at all.
        if sys.stdout is not None:
            both.enter_context(redirect_stdout(Plain(sys.stdout)))  # pyright: ignore[reportArgumentType]
        if sys.stderr is not None:
            both.enter_context(redirect_stderr(Plain(sys.stderr)))  # pyright: ignore[reportArgumentType]
        yield


def style(*, allowed: bool) -> None:
    """Switch the colours of stdout and stderr on or off."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Plain):
            stream.styled = allowed


def unwrap(stream: Any) -> Any:
    """Return the stream within a plain one, for a writer that escapes text and adds colours."""
    return stream.stream if isinstance(stream, Plain) else stream
