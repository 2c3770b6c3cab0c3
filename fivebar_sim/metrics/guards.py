"""Guards: what makes a run no evidence, whatever its limits say, trips one.

Physics that does not hold, torque that is not there, a leg that has become another one.

A scenario may move the bounds in its table [guards]; that the leg keeps its branch and MuJoCo's
solver converges is not up to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import check_number
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import ground
from fivebar_sim.metrics.energy import Balance

WITHIN = 1.0
"""Over this time [s] clipped and chattering steps are added up; of a shorter run, over all."""

FAINT = 0.1
"""Changes of torque by at most this part of a run's largest are too faint to be chatter."""


class Guards(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How far a run may go and still be one.

    Attributes:
        loop: Greatest gap of the loop at C, in parts of the leg's size.
        ground: Deepest that the foot may sink into the floor, in parts of its ball's diameter.
        torque: Greatest part of any second, or of a shorter run, in which a motor's torque may be
            clipped; 1 is all of it.
        chatter: Greatest part of any second, or of a shorter run, in which a motor's torque may go
            up and down with every command.
        energy: Greatest imbalance of the energy, in parts of what was turned over.
        constraints: Most that loop, gear friction and ends of travel may give, in the same parts.
        step: Most that MuJoCo's steps may give or take by themselves, in the same parts.
    """

    loop: float = 0.01
    ground: float = 1.0
    torque: float = 0.5
    chatter: float = 0.5
    energy: float = 1e-3
    constraints: float = 0.01
    step: float = 0.02

    def __post_init__(self) -> None:
        check_number("loop", self.loop, "", low=0.0)
        check_number("ground", self.ground, "", low=0.0)
        check_number("torque", self.torque, "", low=0.0, high=1.0)
        check_number("chatter", self.chatter, "", low=0.0, high=1.0)
        for part in ("energy", "constraints", "step"):
            check_number(part, getattr(self, part), "", low=0.0)


class Guard(NamedTuple):
    """One guard and what came of it.

    Attributes:
        name: What it looks at.
        value: What was found, in SI units; None where there is nothing to find.
        high: Greatest value that is fine.
        time: When it tripped, the first step above `high` [s]; None if it never did.
    """

    name: str
    value: float | None
    high: float
    time: float | None

    @property
    def ok(self) -> bool:
        """Whether it held."""
        return self.time is None

    def __str__(self) -> str:
        """Return what it says where it tripped: the bound, when, and the worst of the run."""
        what, worst, scale = SAID[self.name]
        high = scale * self.high
        value = scale * (self.value or 0.0)
        said = f"{what.format(high)} at t = {self.time:g} s{worst.format(value)}"
        return f"guard {self.name}: {said}"


SAID = {
    "branch": ("the leg left its branch", "", 1.0),
    "loop": ("the loop was open by more than {:.3g} mm", ", by {:.3g} mm at worst", 1e3),
    "ground": ("the foot was in the floor by more than {:.3g} mm", ", by {:.3g} mm at worst", 1e3),
    "torque": (
        "a motor's torque had been clipped for more than {:.3g} % of a second",
        ", for {:.3g} % at worst",
        1e2,
    ),
    "chatter": (
        "a motor's torque had turned round with every command in more than {:.3g} % of a second",
        ", in {:.3g} % at worst",
        1e2,
    ),
    "energy": (
        "more than {:.3g} % of the energy turned over was unaccounted for",
        ", {:.3g} % at worst",
        1e2,
    ),
    "constraints": (
        "loop, gears or ends of travel had given more than {:.3g} % of the energy turned over",
        ", {:.3g} % at worst",
        1e2,
    ),
    "step": (
        "the steps by themselves had given or taken more than {:.3g} % of the energy turned over",
        ", {:.3g} % at worst",
        1e2,
    ),
    "solver": ("MuJoCo's solver did not converge", ", nor in {:.0f} steps in all", 1.0),
}
"""What a tripped guard says, with its bound before the time and the worst value after it, and the
factor from SI of both."""


def judge(
    bounds: Guards,
    leg: FiveBar,
    record: Mapping[str, Array],
    *,
    branch: Mapping[str, Any],
    saturated: Bools,
    balance: Balance,
    unsolved: Bools,
    command: int,
) -> list[Guard]:
    """Return every guard of a run, over all of its steps.

    Args:
        bounds: Of the scenario.
        leg: The leg.
        record: The columns of rollout.parquet.
        branch: The metrics of that name.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        balance: The work of each step.
        unsolved: Whether the constraint solver ran out of iterations in each step, (N,).
        command: Steps from one command of the motors to the next.
    """
    time = record["time"]
    found = [
        Guard("branch", float(branch["flips"]), 0.0, branch["first_flip"]),
        _highest("loop", record["gap"], bounds.loop * leg.size, time),
        _highest("torque", _clipped(saturated, time), bounds.torque, time),
        _highest("chatter", _chattering(record, command), bounds.chatter, time),
        _part("energy", balance.unaccounted, bounds.energy, balance, time),
        _part("constraints", balance.given, bounds.constraints, balance, time),
        _part("step", np.cumsum(balance.step), bounds.step, balance, time),
        Guard("solver", float(unsolved.sum()), 0.0, _first(unsolved, time)),
    ]
    if "ground_z" in record:
        depth = np.maximum(-ground.height(leg, record), 0.0)
        found.append(_highest("ground", depth, bounds.ground * 2.0 * leg.foot_radius, time))

    return found


def tripped(guards: list[Mapping[str, Any]]) -> list[str]:
    """Return what the guards that tripped say, from the metrics of that name."""
    known = (Guard(**{key: each[key] for key in Guard._fields}) for each in guards)
    return [str(guard) for guard in known if not guard.ok]


def _highest(name: str, values: Array, high: float, time: Array) -> Guard:
    return Guard(name, float(values.max()), high, _first(values > high, time))


def _first(chosen: Bools, time: Array) -> float | None:
    return float(time[np.argmax(chosen)]) if chosen.any() else None


def _clipped(saturated: Bools, time: Array) -> Array:
    """Return in which part of the second before it the worse motor was clipped, (N,)."""
    window = _window(time)
    return _sums(saturated, window).max(axis=1) / window


def _chattering(record: Mapping[str, Array], command: int) -> Array:
    """Return in which part of the second before it the worse motor's torque chattered, (N,).

    It does in a step if it goes up and down, by more than `FAINT` of the run's largest torque, with
    two commands one after the other: d = tau_k - tau_k-P of the other sign than P steps before, P
    the steps of a command.
    """
    torque = np.stack([record["torque_A"], record["torque_E"]], axis=-1)
    d = np.zeros_like(torque)
    d[command:] = torque[command:] - torque[:-command]
    d[np.abs(d) <= FAINT * np.abs(torque).max()] = 0.0
    chatters = np.zeros(torque.shape, dtype=bool)
    chatters[command:] = d[command:] * d[:-command] < 0.0
    window = _window(record["time"])
    return _sums(chatters, window).max(axis=1) / window


def _window(time: Array) -> int:
    """Return the steps of `WITHIN`, or of a shorter run."""
    return min(max(1, round(WITHIN / float(time[0]))), len(time))


def _sums(values: Bools, window: int) -> Array:
    """Return the sums over the steps of a window that ends with each step, (N, 2)."""
    so_far: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(values, axis=0, dtype=float)])
    begin = np.maximum(np.arange(1, len(values) + 1) - window, 0)
    return so_far[1:] - so_far[begin]


def _part(name: str, energy: Array, high: float, balance: Balance, time: Array) -> Guard:
    """Return the guard of an energy so far, in parts of what was turned over in the run."""
    if balance.imbalance is None:
        return Guard(name, None, high, None)
    return _highest(name, np.abs(energy) / balance.turnover, high, time)
