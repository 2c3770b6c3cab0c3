"""Guards reject runs whose physics cannot be trusted, whatever their limits say.

They look for physics that does not hold, torque that the motors do not have, and a leg that has
folded the other way.

A scenario may change the bounds in its table [guards], but not that the leg keeps its branch and
that MuJoCo's solver converges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.heat import Heating
from fivebar_sim.errors import unknown
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.stops import Ranges, beyond
from fivebar_sim.metrics import ground
from fivebar_sim.metrics.branch import Branch
from fivebar_sim.metrics.columns import JOINT_COLUMNS, side_by_side
from fivebar_sim.metrics.energy import Balance
from fivebar_sim.metrics.json_types import LARGEST, Amount, Number, Table
from fivebar_sim.metrics.lasting import chattering, clipped

DEGREES = float(np.degrees(1.0))
"""Of a radian."""


class Guards(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The bounds within which a run counts.

    Attributes:
        loop: Largest gap of the loop at C, as a part of the leg's size.
        ground: Largest depth of the foot in the floor, as a part of its ball's diameter.
        torque: Largest part of any second, or of a shorter run, in which a motor's torque may be
            clipped; 1 is all of it.
        chatter: Largest part of any second, or of a shorter run, in which a motor's torque may go
            up and down with every command.
        energy: Largest imbalance of the energy, as a part of the energy turned over.
        constraints: Largest energy that loop, gear friction and ends of travel may give, as a part
            of the energy turned over and of that which lifts all that moves by the leg's size.
        step: Largest energy that MuJoCo's steps may give or take by themselves, as a part of the
            energy turned over.
        floor: Largest depth of a joint or the trunk in the floor, as a part of the leg's size.
        stops: Largest angle by which a joint may lean into a stop [rad]; above 0 the stop pushes.
        rail: Largest force of the rail's end on the trunk [N].
        contact: Largest RMS of what the foot's creep under `implicitfast` changes in a motor's
            torque, as a part of the torque's RMS. See `dynamics.creep`.
        heat: Largest heat of a motor's winding if the motion goes on for good, as a part of what it
            bears. See `heat.heating`.
        feedback: Largest growth of errors between the commands of a feedback controller that the
            timestep hides, as a power of ten: 1 is tenfold.
        jolts: Largest torque that lasts a single step, as a part of the largest torque of the run.
    """

    loop: float = 0.01
    ground: float = 1.0
    torque: float = 0.5
    chatter: float = 0.5
    energy: float = 1e-3
    constraints: float = 0.01
    step: float = 0.02
    floor: float = 0.01
    stops: float = 1e-5
    rail: float = 0.0
    contact: float = 0.025
    heat: float = 1.0
    feedback: float = 1.0
    jolts: float = 0.25

    def __post_init__(self) -> None:
        for part in self.__struct_fields__:
            unit = "N" if part == "rail" else ""
            # Parts of a second; all others have no upper bound.
            high = 1.0 if part in ("torque", "chatter") else math.inf
            check_number(part, getattr(self, part), unit, low=0.0, high=high)


class Guard(Table, frozen=True):
    """One guard and its result.

    Attributes:
        name: Name of the guard.
        value: The worst value of the run, in SI units; None where it is undefined.
        high: Largest value that is fine.
        time: When it tripped, the first step above `high` [s]; None if it never did. `heat` counts
            from a cold start of the motion that goes on for good, also beyond the end of the run.
        ok: Whether it held.
        part: Which part of the leg tripped it, "joint B", where it watches several by name.
    """

    name: str
    value: Number
    high: Annotated[float, msgspec.Meta(ge=0, le=LARGEST)]
    time: Amount
    ok: bool
    part: Annotated[str, msgspec.Meta(pattern="^[A-Za-z0-9 ]+$")] | None = None

    def __post_init__(self) -> None:
        if self.name not in RULES:
            raise ValueError(unknown("guard", self.name, RULES))
        if self.ok != (self.time is None):
            raise ValueError(f"ok must be {str(not self.ok).lower()} with time {self.time}")

    @property
    def bound(self) -> str:
        """What must not happen, in words, of the part that tripped it or of any part of the leg."""
        rule = RULES[self.name]
        return rule.what.format(rule.show(self.high, 3), part=self.part or rule.who)

    def __str__(self) -> str:
        """Return the message of a guard that tripped: the bound, when, and the worst value."""
        if self.time is None:
            return f"guard {self.name}: ok"

        rule = RULES[self.name]
        worst = rule.worst.format(rule.show(self.value, 3))
        # A leg of a robot, where the sentence has no place for it.
        of = f" of {self.part}" if self.part and "{part}" not in rule.what else ""
        return f"guard {self.name}{of}: {self.bound} at t = {self.time:g} s{worst}"


class Evidence(NamedTuple):
    """What guards look at: all steps of a run.

    Attributes:
        bounds: The scenario's bounds.
        leg: The leg.
        record: The columns of rollout.parquet.
        branch: Branch of the last step, and when it flipped.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        balance: Works and energies of each step.
        unsolved: Whether the constraint solver ran out of iterations in each step, (N,).
        command: Steps from one command of the motors to the next.
        ranges: The ranges of the joints, see `stops.beyond`.
        trunk: Height of the trunk's lowest point above the hip frame's origin [m].
        crept: What a creeping foot changes in each motor's torque, see `creep.changes`, (N, 2);
            None under `discrete`, and on a floor without friction.
        heating: Heat of the motors if the motion goes on for good; None where the servo's table
            does not describe the winding.
        growth: Decades by which errors of the feedback would have grown by each step if commands
            were held as long as a motor holds them, and which the timestep hides, (N,); None
            without feedback.
        jolts: Torque that lasts a single step, as a part of the run's largest, (N,); None in torque
            drive.
        heights: Heights of the joints, see `ground.heights_of`; None: the record tells them.
    """

    bounds: Guards
    leg: FiveBar
    record: Mapping[str, Array]
    branch: Branch
    saturated: Bools
    balance: Balance
    unsolved: Bools
    command: int
    ranges: Ranges
    trunk: float
    crept: Array | None = None
    heating: Heating | None = None
    growth: Array | None = None
    jolts: Array | None = None
    heights: Mapping[str, Array] | None = None


class Found(NamedTuple):
    """The worst value and the bound, both SI, when the guard tripped [s], and which part did."""

    value: float | None
    high: float
    time: float | None
    part: str | None = None


class Rule(NamedTuple):
    """What a guard looks at, and what it says.

    Attributes:
        name: Name of the guard, and of its bound in a scenario, if it has one.
        function: Finds the worst value; returns None for runs that the guard does not apply to.
        what: First part of its message, with {} for the bound and its unit and, as {part}, the part
            that tripped it.
        worst: Last part of its message, with {} for the worst value and its unit.
        scale: Factor from SI to the shown unit.
        unit: The shown unit.
        who: What {part} is while the guard holds.
    """

    name: str
    function: Callable[[Evidence], Found | None]
    what: str
    worst: str
    scale: float
    unit: str
    who: str = "leg"

    def show(self, value: float | None, digits: int = 4) -> str:
        """Return a bound or a value as people read it: "1.2 mm"."""
        return units.text(self.scale * (value or 0.0), self.unit, digits)


def judge(run: Evidence) -> list[Guard]:
    """Return every guard of a run."""
    found = [(rule.name, rule.function(run)) for rule in GUARDS]
    return [
        Guard(name=name, **each._asdict(), ok=each.time is None)
        for name, each in found
        if each is not None
    ]


def tripped(guards: Sequence[Guard]) -> list[str]:
    """Return the messages of the guards that tripped."""
    return [str(guard) for guard in guards if not guard.ok]


def _left_branch(run: Evidence) -> Found:
    # One flip is too many: what follows is another mechanism.
    return Found(float(run.branch.flips), 0.0, run.branch.first_flip)


def _open_loop(run: Evidence) -> Found:
    return _highest(run, run.record["gap"], run.bounds.loop * run.leg.size)


def _clipped_torque(run: Evidence) -> Found:
    return _highest(run, clipped(run.saturated, run.record["time"]), run.bounds.torque)


def _chatter(run: Evidence) -> Found:
    return _highest(run, chattering(run.record, run.command), run.bounds.chatter)


def _unaccounted_energy(run: Evidence) -> Found:
    return _part(run, run.balance.unaccounted, run.bounds.energy)


def _giving_constraints(run: Evidence) -> Found:
    # Loop, friction and ends of travel can only take energy; giving some is an artefact.
    # A loaded leg that hardly moves turns next to nothing over, but its weight is at stake.
    return _part(run, run.balance.given, run.bounds.constraints, run.balance.lift)


def _giving_steps(run: Evidence) -> Found:
    return _part(run, np.cumsum(run.balance.step), run.bounds.step)


def _unsolved(run: Evidence) -> Found:
    return Found(float(run.unsolved.sum()), 0.0, _first(run.unsolved, run.record["time"]))


def _leaned(run: Evidence) -> Found:
    # Nobody planned the force of a stop: the motion is not the one that was asked for.
    found = beyond(side_by_side(run.record, JOINT_COLUMNS), run.ranges)
    return first_of(run, {f"joint {joint}": found[joint] for joint in found}, run.bounds.stops)


def _overheated(run: Evidence) -> Found | None:
    if run.heating is None or run.heating.used is None:
        return None
    high = run.bounds.heat
    return Found(run.heating.used, high, run.heating.reaches(high))


def _unstable(run: Evidence) -> Found | None:
    return None if run.growth is None else _highest(run, run.growth, run.bounds.feedback)


def _jolted(run: Evidence) -> Found | None:
    return None if run.jolts is None else _highest(run, run.jolts, run.bounds.jolts)


def _in_floor(run: Evidence) -> Found | None:
    if "ground_z" not in run.record:
        return None
    # Deeper than its own ball, the foot has gone through the floor.
    depth = np.maximum(-ground.height(run.leg, run.record), 0.0)
    return _highest(run, depth, run.bounds.ground * 2.0 * run.leg.foot_radius)


def _through_floor(run: Evidence) -> Found | None:
    if "ground_z" not in run.record:
        return None
    # Only the foot collides: anything else would go through the floor without a force.
    depths = ground.depths(run.leg, run.record, run.trunk, run.heights)
    return first_of(run, depths, run.bounds.floor * run.leg.size)


def _carrying_rail(run: Evidence) -> Found | None:
    if "rail_end" not in run.record:
        return None
    # What the end carries, foot and motors do not: their load would be that of a lighter robot.
    return _highest(run, run.record["rail_end"], run.bounds.rail)


def _fallen(run: Evidence) -> Found | None:
    # A leg alone hangs on its rail; of a robot, `walking.guards` looks at the trunk.
    del run


def _creeping(run: Evidence) -> Found | None:
    if run.crept is None:
        return None
    high = run.bounds.contact
    value = float(np.sqrt((run.crept**2).mean(axis=0)).max())
    # Where the RMS is above the bound, some step is, too.
    above = np.abs(run.crept).max(axis=1) > high
    return Found(value, high, _first(above, run.record["time"]) if value > high else None)


def _highest(run: Evidence, values: Array, high: float) -> Found:
    worst = float(values.max())
    # Nearly every guard of nearly every run holds; NaN does not.
    return Found(worst, high, None if worst <= high else _first(values > high, run.record["time"]))


def first_of(run: Evidence, parts: Mapping[str, Array], high: float) -> Found:
    """Return the worst value of all parts, and which of them was the first above the bound."""
    found = {part: _highest(run, values, high) for part, values in parts.items()}
    worst = max((each.value or 0.0 for each in found.values()), default=0.0)
    times = {part: each.time for part, each in found.items() if each.time is not None}
    if not times:
        return Found(worst, high, None)
    first = min(times, key=lambda part: times[part])
    return Found(worst, high, times[first], first)


def _first(chosen: Bools, time: Array) -> float | None:
    return float(time[np.argmax(chosen)]) if chosen.any() else None


def _part(run: Evidence, energy: Array, high: float, more: float = 0.0) -> Found:
    """Return the largest |energy so far|, as a part of the energy turned over, and of `more`."""
    balance = run.balance
    # A leg that only stands turns nothing over: every part of it would be rounding.
    if balance.imbalance is None:
        return Found(None, high, None)
    return _highest(run, np.abs(energy) / (balance.turnover + more), high)


GUARDS = (
    Rule("branch", _left_branch, "the leg left its branch", "", 1.0, "flips"),
    Rule(
        "loop",
        _open_loop,
        "the loop was open by more than {}",
        ", by {} at worst",
        1e3,
        "mm",
    ),
    Rule(
        "torque",
        _clipped_torque,
        "a motor's torque had been clipped for more than {} of a second",
        ", for {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "chatter",
        _chatter,
        "a motor's torque had turned round with every command in more than {} of a second",
        ", in {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "energy",
        _unaccounted_energy,
        "more than {} of the energy turned over was unaccounted for",
        ", {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "constraints",
        _giving_constraints,
        "loop, gears or ends of travel had given more than {} of the energy at stake",
        ", {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "step",
        _giving_steps,
        "the steps by themselves had given or taken more than {} of the energy turned over",
        ", {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "solver",
        _unsolved,
        "MuJoCo's solver did not converge",
        ", nor in {} in all",
        1.0,
        "steps",
    ),
    Rule(
        "stops",
        _leaned,
        "{part} leaned into its stop by more than {}",
        ", by {} at worst",
        DEGREES,
        "deg",
    ),
    Rule(
        "contact",
        _creeping,
        "a foot that should stick crept under implicitfast, and changed a torque by more than {}",
        ", by {} RMS: shorten the timestep or use discrete",
        1e2,
        "%",
    ),
    Rule(
        "heat",
        _overheated,
        "for good, this would give a winding more than {} of the heat that it bears",
        ", {} at worst",
        1e2,
        "%",
    ),
    Rule(
        "feedback",
        _unstable,
        "held for its period the feedback is unstable, which the timestep hides: errors had grown "
        "by more than 10^{}",
        ", by 10^{} at worst: shorten the period or change the gains",
        1.0,
        "",
    ),
    Rule(
        "jolts",
        _jolted,
        "a command jumped: torque of more than {} of the largest did not last a step",
        ", {} at worst: shorten the timestep, or ease path or bus",
        1e2,
        "%",
    ),
    Rule(
        "ground",
        _in_floor,
        "the foot was in the floor by more than {}",
        ", by {} at worst",
        1e3,
        "mm",
    ),
    Rule(
        "floor",
        _through_floor,
        "the {part} was in the floor by more than {}",
        ", by {} at worst",
        1e3,
        "mm",
    ),
    Rule(
        "rail",
        _carrying_rail,
        "the rail's end carried the trunk, with more than {}",
        ", {} at worst",
        1.0,
        "N",
    ),
    Rule(
        "fall",
        _fallen,
        "the robot fell: {part}",
        ", {} in all",
        1.0,
        "falls",
        "its trunk came down",
    ),
)
"""Every guard, in the order of metrics.json; a new guard is a rule and a function."""

RULES = {rule.name: rule for rule in GUARDS}
"""The guards by name."""
