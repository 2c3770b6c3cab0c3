"""What all workers have in common, and the plainest of them: this process, one task by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

Task = tuple[int, Any]
"""A task: its number, and the argument of the function that does it."""

Answer = tuple[int, Any]
"""The number of a task, and what came of it."""


class Workers(Protocol):
    """Those who do tasks."""

    def results(self, function: Callable[[Any], Any], tasks: Iterable[Task]) -> Iterator[Answer]:
        """Yield the result of every task as it comes, in any order.

        Tasks are drawn only as they are needed, so that there may be any number of them.

        Args:
            function: Does a task: a function of a module, which other processes can import.
            tasks: The tasks.
        """
        ...


class Here:
    """This process: one task after the other, in their order."""

    def results(self, function: Callable[[Any], Any], tasks: Iterable[Task]) -> Iterator[Answer]:
        """Yield the result of every task; see `Workers`."""
        for number, argument in tasks:
            yield number, function(argument)
