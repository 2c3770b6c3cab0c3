"""Text as it may go out: nothing that a terminal obeys, whoever wrote it; escaped in one place."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import Any


def plain(text: str) -> str:
    r"""Return a text with everything that cannot be seen told with backslashes: "\x1b", "\u202e".

    That is control characters, what turns the direction of writing, separators of lines and bytes
    that are no UTF-8; the ends of lines stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


class Plain:
    """A stream that lets only plain text through; in all else it is the stream behind it.

    Attributes:
        styled: Whether colours go through: what is written is known to have no foreign text.
        stream: What is behind it.
    """

    def __init__(self, stream: Any) -> None:
        self.styled = False
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text, plain."""
        return self.stream.write(text if self.styled else plain(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def output() -> Iterator[None]:
    """Let stdout and stderr be plain."""
    with ExitStack() as both:
        if sys.stdout is not None:
            both.enter_context(redirect_stdout(Plain(sys.stdout)))  # pyright: ignore[reportArgumentType]
        if sys.stderr is not None:
            both.enter_context(redirect_stderr(Plain(sys.stderr)))  # pyright: ignore[reportArgumentType]
        yield


def style(*, allowed: bool) -> None:
    """Let colours through, or no more."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, Plain):
            stream.styled = allowed


def behind(stream: Any) -> Any:
    """Return the stream behind a plain one, for who writes plain text in colours of his own."""
    return stream.stream if isinstance(stream, Plain) else stream
