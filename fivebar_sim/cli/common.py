"""Shared by the commands: the types of their arguments, plans, consoles."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim.cli import memory, terminal
from fivebar_sim.errors import ConfigError, FiveBarError

if TYPE_CHECKING:
    from fivebar_sim.rollout import Plan

Scenarios = Positional[Annotated[tuple[str, ...], arg(metavar="[SCENARIO ...]")]]
Settings = UseAppendAction[Annotated[tuple[str, ...], arg(name="set", metavar="KEY=VALUE")]]

NARROWEST = 80
"""Columns that tables are laid out for: in fewer, numbers would be cut."""


def plans_of(scenarios: Iterable[str], settings: Sequence[str]) -> list[Plan]:
    """Return the plans of all scenarios, so that all are validated before the first one runs."""
    from fivebar_sim import rollout
    from fivebar_sim.files import resources
    from fivebar_sim.scenario import Scenario

    chosen = list(scenarios) or list(resources.shipped("scenarios"))
    loaded = [(source, Scenario.load(source, settings)) for source in chosen]
    plans = []
    # Planning allocates arrays for every step already, so memory is checked before.
    memory.check(sum(scenario.steps for _, scenario in loaded))

    for source, scenario in loaded:
        try:
            plans.append(rollout.plan(scenario))
        except FiveBarError as error:
            raise ConfigError(f"{source}: {error}") from None
    return plans


def screen(*, stderr: bool = False, quiet: bool = False):
    """Return a console for stdout or stderr; a closed pipe raises BrokenPipeError.

    Text is made plain (see `terminal.plain`) before it is coloured; ":words:" do not become emoji,
    and what looks like a number or an address gets no colour. Tables get the columns that they
    need, also on a terminal that has fewer.
    """
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    class Screen(Console):
        def on_broken_pipe(self) -> None:
            # rich itself would exit with status 1, as if a limit were broken.
            raise BrokenPipeError

        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterator[Segment]:
            # Control segments are rich's own escape codes; all other text may come from a file.
            for part in super().render(renderable, options):
                yield part if part.control else part._replace(text=terminal.plain(part.text))

    stream = terminal.unwrap(sys.stderr if stderr else sys.stdout)
    console = Screen(file=stream, quiet=quiet, emoji=False, highlight=False)
    if not stderr:
        console.width = max(console.width, NARROWEST)
    return console


def spinner(what: str, *, quiet: bool):
    """Return a context that shows a spinner on a terminal's stderr."""
    from rich.text import Text

    return screen(stderr=True, quiet=quiet).status(Text(what))
