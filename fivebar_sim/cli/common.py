"""Shared by the commands: the types of their arguments, what they are to run, consoles."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from tyro.conf import Positional, UseAppendAction, arg
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    UnsupportedTypeAnnotationError,
)

from fivebar_sim.cli import memory, terminal
from fivebar_sim.errors import ConfigError, FiveBarError

if TYPE_CHECKING:
    from fivebar_sim.rollout import AnyPlan
    from fivebar_sim.scenario import Scenario


# The parser looks whether a default is of its parameter's type: itself for classes and unions as
# typing writes them, and else with typeguard, which takes as long to import as the parser.
T = TypeVar("T")
Maybe = T | None
"""What may be left out, as a parameter's type."""


class Words(tuple[str, ...]):
    """Any number of words, as a parameter's type."""

    __slots__ = ()


class Paths(tuple[Path, ...]):
    """Any number of paths, as a parameter's type."""

    __slots__ = ()


NO_WORDS = Words()
NO_PATHS = Paths()
MANY = {Words: tuple[str, ...], Paths: tuple[Path, ...]}
"""What the parser reads each of these as."""

TYPES = ConstructorRegistry()
"""Has the parser read them."""


@TYPES.primitive_rule
def _many(
    info: PrimitiveTypeInfo,
) -> PrimitiveConstructorSpec | UnsupportedTypeAnnotationError | None:
    if info.type not in MANY:
        return None
    return ConstructorRegistry.get_primitive_spec(
        PrimitiveTypeInfo.make(MANY[info.type], info.markers)
    )


Scenarios = Positional[Annotated[Words, arg(metavar="[SCENARIO ...]")]]
Settings = UseAppendAction[Annotated[Words, arg(name="set", metavar="KEY=VALUE")]]

NARROWEST = 80
"""Columns that tables are laid out for: in fewer, numbers would be cut."""


TOGETHER = 200_000
"""Steps, over all scenarios, whose plans are kept, and whose runs are simulated, at one time: with
their records some 120 MB."""


class Order:
    """A scenario to run: its plan has been checked.

    Args:
        scenario: The scenario.
        plan: Its plan; None where it would take too much memory until it is needed.
    """

    def __init__(self, scenario: Scenario, plan: AnyPlan | None) -> None:
        self.scenario = scenario
        self._plan = plan

    def take(self) -> AnyPlan:
        """Return the plan, which is then forgotten here, or make it again."""
        from fivebar_sim import rollout

        kept = self._plan
        self._plan = None
        return rollout.plan(self.scenario) if kept is None else kept


def orders_of(scenarios: Iterable[str], settings: Sequence[str]) -> list[Order]:
    """Return all scenarios with checked plans, so that all are validated before the first runs."""
    from fivebar_sim import rollout
    from fivebar_sim.files import resources
    from fivebar_sim.scenario import Scenario

    chosen = list(scenarios) or list(resources.shipped("scenarios"))
    loaded = [(source, Scenario.load(source, settings)) for source in chosen]
    # Planning allocates arrays for every step already, so memory is checked before.
    steps = [scenario.steps for _, scenario in loaded]
    memory.check(max(*steps, min(sum(steps), TOGETHER)))

    orders = []
    kept = 0
    for source, scenario in loaded:
        try:
            plan = rollout.plan(scenario)
        except FiveBarError as error:
            raise ConfigError(f"{source}: {error}") from None
        fits = kept + scenario.steps <= TOGETHER or len(loaded) == 1
        kept += scenario.steps if fits else 0
        orders.append(Order(scenario, plan if fits else None))
    return orders


def batches(orders: Sequence[Order]) -> Iterator[list[Order]]:
    """Yield the orders in their order, as many at a time as may run at one time, at least one."""
    batch: list[Order] = []
    steps = 0
    for order in orders:
        if batch and steps + order.scenario.steps > TOGETHER:
            yield batch
            batch = []
            steps = 0
        batch.append(order)
        steps += order.scenario.steps
    if batch:
        yield batch


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
    # Rich takes a tenth of a second to import.
    if quiet:
        return nullcontext()
    from rich.text import Text

    return screen(stderr=True).status(Text(what))
