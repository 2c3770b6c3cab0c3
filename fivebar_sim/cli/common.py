"""What the commands share: their arguments' types, their plans, and what they print to."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim.cli import memory, plain
from fivebar_sim.errors import ConfigError, FiveBarError

if TYPE_CHECKING:
    from fivebar_sim.rollout import Plan

Scenarios = Positional[Annotated[tuple[str, ...], arg(metavar="[SCENARIO ...]")]]
Settings = UseAppendAction[Annotated[tuple[str, ...], arg(name="set", metavar="KEY=VALUE")]]


def plans_of(scenarios: Iterable[str], settings: Sequence[str]) -> list[Plan]:
    """Return the plans of all scenarios: everything is validated before the first one runs."""
    from fivebar_sim import rollout
    from fivebar_sim.files import resources
    from fivebar_sim.scenario import Scenario

    chosen = list(scenarios) or list(resources.shipped("scenarios"))
    loaded = [(source, Scenario.load(source, settings)) for source in chosen]
    plans = []
    memory.check(sum(scenario.steps for _, scenario in loaded))

    for source, scenario in loaded:
        try:
            plans.append(rollout.plan(scenario))
        except FiveBarError as error:
            raise ConfigError(f"{source}: {error}") from None
    return plans


def screen(*, stderr: bool = False, quiet: bool = False):
    """Return a console for stdout, or stderr; a reader that has gone raises BrokenPipeError.

    What is printed is plain before it gets its colours, and no word becomes a picture.
    """
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

    class Screen(Console):
        def on_broken_pipe(self) -> None:  # rich itself would exit with 1, as if a limit failed
            raise BrokenPipeError

        def render(
            self, renderable: RenderableType, options: ConsoleOptions | None = None
        ) -> Iterator[Segment]:
            for part in super().render(renderable, options):
                yield part if part.control else part._replace(text=plain.plain(part.text))

    stream = plain.behind(sys.stderr if stderr else sys.stdout)
    return Screen(file=stream, quiet=quiet, emoji=False)


def working(what: str, *, quiet: bool):
    """Return a context that shows a spinner on a terminal's stderr."""
    from rich.text import Text

    return screen(stderr=True, quiet=quiet).status(Text(what))
