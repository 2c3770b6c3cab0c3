"""How far a long command is, with its rate, on a terminal's stderr."""

from __future__ import annotations

import time
from types import TracebackType

from fivebar_sim.cli.common import screen


class Progress:
    """A line that says how far a command is; only on a terminal.

    Args:
        what: What is counted, in the plural.
        quiet: Whether nothing is shown.
    """

    def __init__(self, what: str, *, quiet: bool) -> None:
        self._what = what
        self._quiet = quiet
        self._begun: tuple[float, int] | None = None
        self._latest: tuple[float, int] | None = None

    def __enter__(self) -> Progress:
        # Rich takes a tenth of a second to import.
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        words = TextColumn("{task.completed:,.0f} of {task.total:,.0f} " + self._what)
        rate = TextColumn("{task.fields[rate]}")
        console = screen(stderr=True, quiet=self._quiet)
        # On anything but a terminal it would be a line in a log that says nothing new.
        shown = console.is_terminal and not self._quiet
        columns = (words, BarColumn(), rate, TimeRemainingColumn())
        self._bar = Bar(*columns, console=console, transient=True, disable=not shown)
        self._task = self._bar.add_task("", total=None, rate="", visible=False)
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def tell(self, done: int, total: int, more: str = "") -> None:
        """Show how far the command is, and more of it; the first call says what was before."""
        self._latest = (time.monotonic(), done)
        if self._begun is None:
            self._begun = self._latest
        rate = f"{self.rate:,.3g} a second" if self.rate else ""
        self._bar.update(self._task, completed=done, total=total, rate=rate + more, visible=True)

    @property
    def rate(self) -> float:
        """How many are done a second; 0 where none was."""
        if self._begun is None or self._latest is None:
            return 0.0
        seconds = self._latest[0] - self._begun[0]
        return (self._latest[1] - self._begun[1]) / seconds if seconds > 0.0 else 0.0
