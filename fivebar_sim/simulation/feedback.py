"""Legs in the loop: their controllers are asked at every control step.

Whether all is well is looked for after every block of steps. Controllers have no memory, so that
one may be asked a few times too often: what came after a fault is forgotten.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import DivergedError, FiveBarError, PoseError
from fivebar_sim.model import without_log
from fivebar_sim.simulation.asked import Asked, Latest, asked
from fivebar_sim.simulation.lean import without_clock
from fivebar_sim.simulation.plan import Plan, period_steps
from fivebar_sim.simulation.steps import Legs, States, Watch, moving
from fivebar_sim.simulation.taken import Periods, Singles, Taken

BLOCK = 256
"""Steps after which a block ends, with the control period in which it does."""

SINGLY = 8
"""Steps of a control period up to which it costs less to take them one by one than at once."""

HANDED = 16
"""Steps, over all legs, that are taken between two commands, from which on more threads pay off: to
hand them a step takes as long as several steps."""

GLANCE = 0.2
"""Time between two moments at which whoever watches a run in the loop is shown its steps [s]."""


class NoAnswerError(DivergedError):
    """A controller has no answer, or commands what no motor can follow.

    Attributes:
        row: The plan of the leg that it has none for.
    """

    def __init__(self, message: str, time: float, row: int) -> None:
        super().__init__(message, time)
        self.row = row


def steer(plans: Sequence[Plan], nthread: int, watch: Watch | None) -> Iterator[States]:
    """Yield the states of plans with feedback controllers of one timestep, length and period.

    Some steps after the other; fewer than there are if a simulation broke down on the way.

    Raises:
        ConfigError: A controller that fails, or commands what is no finite (nsim, 2).
        NoAnswerError: A controller that cannot answer, as where the loop would not close.
    """
    loop = _Loop(plans, nthread, GLANCE if watch is not None else np.inf)
    # What led to an error is worth seeing, too.
    with closing(Glances(watch)) as glances:
        for states in loop.blocks():
            yield states
            glances.add(states)


class Glances:
    """Shows states to whoever watches, every `GLANCE` those of all steps since the last time.

    Args:
        watch: Is shown them; None: nobody is.
    """

    def __init__(self, watch: Watch | None) -> None:
        self._watch = watch
        self._pending: list[States] = []
        self._last = time.monotonic()

    def add(self, states: States) -> None:
        """Show the states of some steps, now or with later ones."""
        if self._watch is None:
            return
        self._pending.append(states)
        if time.monotonic() - self._last >= GLANCE:
            self.close()

    def close(self) -> None:
        """Show all that was not shown yet."""
        if self._watch is None or not self._pending:
            return
        self._watch(States.joined(self._pending))
        self._pending.clear()
        self._last = time.monotonic()


class _Stop(NamedTuple):
    """Why a block of steps cannot be whole.

    Attributes:
        steps: How many of its steps are right.
        error: The error of the step after them.
    """

    steps: int
    error: FiveBarError


class _Loop:
    """Legs and their controllers.

    Args:
        plans: The plans.
        nthread: Threads; 0 is one for every processor.
        patience: Time after which a block ends [s].
    """

    def __init__(self, plans: Sequence[Plan], nthread: int, patience: float) -> None:
        self._plans = plans
        self._patience = patience
        start = np.stack([plan.start for plan in plans])
        self._every = period_steps(plans[0])
        once = len(plans) * (1 if self._every <= SINGLY else self._every)
        threads = nthread if once >= HANDED else 1
        self._legs = Legs([plan.model for plan in plans], start, threads)

        self._steps = plans[0].scenario.steps
        self._ctrl = np.empty((len(plans), self._every, plans[0].model.nu))
        self._pushed = plans[0].pushes.size > 0
        self._asked = asked(plans)
        # Whose commands are all that there are.
        self._only = self._asked[0] if len(self._asked) == 1 and not self._pushed else None
        self._asking = 0
        self._k = 0

    @property
    def over(self) -> bool:
        """Whether all steps were taken."""
        return self._k >= self._steps

    def blocks(self) -> Iterator[States]:
        """Yield the states of one block after the other; see `steer`."""
        latest: Latest | None = None
        while not self.over:
            begin = self._k
            taken = self._room()
            stopped = self._block(taken, latest)
            latest = taken.latest() if self._k > begin else latest
            states = taken.states() if self._k > begin else None
            broken = None if states is None else self._broken(states)
            refused = self._refused(begin, stopped)

            # Of two faults the first is the cause of the second.
            if refused is not None and (broken is None or refused.steps < broken):
                if states is not None and refused.steps:
                    yield states.part(slice(refused.steps))
                raise refused.error
            if states is not None:
                yield states.part(slice(broken))
            if broken is not None:
                return

    def _room(self) -> Taken:
        """Return room for a block of steps."""
        if self._every <= SINGLY and self._legs.whole:
            # The last period may end beyond the block.
            return Singles(self._legs, BLOCK + self._every, self._every)
        return Periods(self._legs)

    def _block(self, taken: Taken, latest: Latest | None) -> FiveBarError | None:
        """Take a block of steps; return the error of a controller that ended it early."""
        end = min(self._k + BLOCK, self._steps)
        until = time.monotonic() + self._patience
        try:
            # What is not finite is found afterwards.
            with without_log(), without_clock(), np.errstate(all="ignore"):
                while self._k < end and time.monotonic() < until:
                    taken.take(self._commands(latest))
                    latest = taken.latest()
                    self._k = min(self._k + self._every, self._steps)
        except FiveBarError as error:
            return error
        return None

    def _commands(self, latest: Latest | None) -> Array:
        """Return the commands of the next control period, (nsim, n, nu)."""
        k = self._k
        if self._only is not None:
            # A command may be of whole numbers, or of another size.
            return np.asarray(self._only.sent(k, latest), dtype=np.float64)

        left = self._steps - k
        ctrl = self._ctrl if left >= self._every else self._ctrl[:, :left]
        if self._pushed:
            for row, plan in enumerate(self._plans):
                ctrl[row, :, :-2] = plan.pushes[k : k + self._every]

        for number, group in enumerate(self._asked):
            self._asking = number
            if len(self._asked) == 1:
                ctrl[..., -2:] = group.sent(k, latest)
            else:
                own = None if latest is None else (latest[0][group.part], latest[1][group.part])
                ctrl[group.part, :, -2:] = group.sent(k, own)
        return ctrl

    def _broken(self, states: States) -> int | None:
        """Return how many steps it took until a simulation broke down, in whole control periods.

        None if none did.
        """
        steps = states.time.shape[1]
        good = moving(states).all(axis=0)
        if not good.all():
            return min((int(np.argmin(good)) // self._every + 1) * self._every, steps)
        return steps if states.warnings.any() else None

    def _refused(self, begin: int, stopped: FiveBarError | None) -> _Stop | None:
        """Return the first command of the block that is none, or the error that ended it.

        Args:
            begin: The first step of the block.
            stopped: That error, if any.
        """
        refusals = [(group.refusal(), group) for group in self._asked]
        # The groups are asked in their order: of two at one step the first comes first.
        found = [(each.after, each.error, group) for each, group in refusals if each is not None]
        if found:
            count, error, group = min(found, key=lambda each: each[0])
            steps = count * self._every
        elif stopped is not None:
            steps = self._k - begin
            group = self._asked[self._asking]
            error = stopped
        else:
            return None
        return _Stop(steps, self._named(error, group, begin + steps))

    def _named(self, error: FiveBarError, group: Asked, k: int) -> FiveBarError:
        """Return an error of a controller at step k, with its leg if it has no answer for it."""
        if not isinstance(error, PoseError):
            return error
        row = group.rows[error.index[0] if error.index else 0]
        h = self._plans[row].motion.timestep
        why = f"controller {group.name!r} has no answer: {error}"
        found = NoAnswerError(why, k * h, row)
        found.__cause__ = error
        return found
