"""The shipped scenarios: what they cover, how tight their limits are, what each of them sees."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import faults_disturbed as disturbed
import pytest
from shipped import NAMES, SCENARIOS, planned, results

from fivebar_sim import control, rollout
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import FiveBarError
from fivebar_sim.files import resources
from fivebar_sim.metrics import Limit
from fivebar_sim.metrics.guards import Guards
from fivebar_sim.regression import baseline, comparison
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import scenes

SOLIMP = "solimp of the loop 0.9 0.95"
"""Under `discrete` the gap of a loop that carries next to nothing hardly depends on it: 0.6 %."""

SOLREF = "solref of the loop 10 % slow"
"""The same of a gap below 0.3 um: it grows by 1 %, and a baseline allows 1.7 nm."""

UNDAMPED = "motors 10 % more damped"
"""Motors that are sent torques, and have no torque-speed line, have no damping in the model."""

UNSEEN = {
    "airhockey-gain-schedule": {UNDAMPED},
    "airhockey-pd": {UNDAMPED, SOLIMP},
    "classic-ellipse": {SOLIMP},
    "classic-figure-eight": {SOLIMP},
    "classic-pd-sensors": {SOLIMP},
    "doggo-fast-ellipse": {UNDAMPED, SOLIMP},
    "doggo-landing": {UNDAMPED},
    "extended-gravity-hold": {UNDAMPED},
    "extended-stance-force": {UNDAMPED},
    "minitaur-trot": {SOLIMP},
    "payload-xl330": {SOLIMP, SOLREF},
    "q8bot-trot": {SOLIMP},
    "q8bot-xl330": {SOLIMP},
}
"""What a scenario does not see of a model that is disturbed, since there it makes no difference."""

UNSEEN_LENGTHS = {
    "doggo-fast-ellipse": {"L5"},  # symmetric legs: half of it on either side costs next to nothing
    "minitaur-trot": {"L5"},
    "payload-xl330": {"L2", "L3"},  # as with q8bot-xl330
    "q8bot-squat": {"L2"},  # stands the better for it
    "q8bot-trot": {"L5"},
    "q8bot-xl330": {"L3"},  # its rotors take far more torque than its links
}
UNSEEN_GAINS = {
    "airhockey-gain-schedule": {"kp_far", "kd_far"},  # 6.5 mm from the target, of 100, is near
}
UNTIMED = {"rail-landing"}
"""Is sent the same angles all the time."""

ERRORS = ("tracking.rms", "closure.max", "load.torque_rms.A", "load.torque_rms.E")
"""What every scenario has limits of."""


def red(result: Result) -> bool:
    """Return whether a check of a run fails."""
    recorded = baseline.read(baseline.place(result.scenario.name))
    return bool(comparison.compare(result, recorded).failures)


def turn_red(plans: list[Plan]) -> list[bool]:
    """Return which plans do not pass: they break down, or their check fails."""
    try:
        return [red(result) for result in rollout.run_all(plans, nthread=2)]
    except FiveBarError:
        return [True] if len(plans) == 1 else [turn_red([plan])[0] for plan in plans]


# coverage


def test_every_part_of_the_mission_is_driven() -> None:
    every = list(SCENARIOS.values())
    assert {s.leg.name for s in every} == set(resources.shipped("models/legs"))
    assert {s.controller_name for s in every} == set(control.known())
    assert {s.scene.kind for s in every} == set(scenes.KINDS)
    assert {s.sim.integrator for s in every} == {"discrete", "implicitfast"}
    shapes = {getattr(s.controller, "feedforward", None) for s in every}
    assert shapes == {"none", "velocity", "torque", None}
    # Those with friction by load take five times as long: one is enough.
    presets = {name: Servo.load(name) for name in resources.shipped("models/servos")}
    servos = {n for n, servo in presets.items() if n != "ideal" and not servo.gear.changes}
    driven = {n for n, servo in presets.items() if servo in [s.servo for s in every]}
    assert servos < driven
    assert any(presets[n].gear.changes for n in driven)
    periods = [s.path.period for s in every if s.path.period is not None]
    assert (max(periods), min(periods)) == (2.0, 0.2)  # 0.5 Hz and 5 Hz
    assert len({type(s.path) for s in every}) >= 8
    assert len({type(s.force) for s in every}) >= 3


def test_whole_suite_is_short() -> None:
    assert sum(s.steps for s in SCENARIOS.values()) <= 70_000
    assert max(s.duration for s in SCENARIOS.values()) <= 4.5


# law


def tight(limit: Limit) -> bool:
    """Return whether a limit holds, and breaks where its metric is 10 % beyond the value."""
    if limit.value is None:
        return False
    room = 0.1 * abs(limit.value)
    below = limit.low == -math.inf or limit.value - room <= limit.low <= limit.value
    return below and limit.value <= limit.high <= limit.value + room


@pytest.mark.parametrize("name", NAMES)
def test_ten_percent_worse_breaks_every_limit(name: str) -> None:
    limits = results()[name].limits
    assert [limit for limit in limits if not tight(limit)] == []
    assert set(ERRORS) <= {limit.key for limit in limits}
    for limit in limits:
        both = "share" in limit.key or "torque_rms" in limit.key
        assert not (both and limit.low == -math.inf), limit.key


def test_what_is_loose_is_seen() -> None:
    assert tight(Limit("tracking.rms", -math.inf, 1.1, 1.0, ok=True))
    assert not tight(Limit("tracking.rms", -math.inf, 1.11, 1.0, ok=True))
    assert not tight(Limit("tracking.rms", -math.inf, 0.99, 1.0, ok=False))
    assert tight(Limit("load.share_A", 0.46, 0.54, 0.5, ok=True))
    assert not tight(Limit("load.share_A", 0.44, 0.54, 0.5, ok=True))
    assert tight(Limit("warnings", -math.inf, 0.0, 0.0, ok=True))
    assert not tight(Limit("warnings", -math.inf, 1.0, 0.0, ok=True))


# oracle: a disturbance of which nothing is told must be seen


def unseen(plans: dict[str, Plan]) -> set[str]:
    """Return which disturbances stay green."""
    return {what for what, seen in zip(plans, turn_red([*plans.values()]), strict=True) if not seen}


SOME = pytest.mark.parametrize("count", [2, pytest.param(5, marks=pytest.mark.long)])
"""Of five disturbances two, others of the next scenario."""


def in_turn(every: Sequence[str], name: str, count: int) -> list[str]:
    """Return some of all disturbances: of five scenarios in a row each has others."""
    first = 2 * NAMES.index(name)
    return [every[(first + i) % len(every)] for i in range(count)]


QUICK = [n for n in NAMES if isinstance(SCENARIOS[n].controller, control.Setpoints)]
SLOW = [pytest.param(n, marks=pytest.mark.long) for n in NAMES if n not in QUICK]
ASKED = ("airhockey-gain-schedule", "doggo-landing", "extended-stance-force")
"""Of the scenarios with a controller that is asked at every step, the short form's."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in (*QUICK, *ASKED) else pytest.mark.long) for n in NAMES],
)
@SOME
def test_each_scenario_sees_a_model_that_is_not_its_own(name: str, count: int) -> None:
    asked = in_turn(list(disturbed.MODEL), name, count)
    found = unseen(disturbed.in_the_model(planned(name), asked))
    assert found == UNSEEN.get(name, set()) & set(asked)


@pytest.mark.parametrize("name", [*QUICK, *SLOW])
def test_each_scenario_sees_commands_that_come_a_step_late(name: str) -> None:
    assert turn_red([disturbed.in_time(planned(name))]) == [name not in UNTIMED]


@SOME
@pytest.mark.parametrize("name", [*QUICK, *SLOW])
def test_each_scenario_sees_another_leg(name: str, count: int) -> None:
    asked = in_turn(disturbed.LENGTHS, name, count)
    found = unseen(disturbed.in_length(planned(name), asked))
    assert found == UNSEEN_LENGTHS.get(name, set()) & set(asked)


@pytest.mark.parametrize("name", SLOW)
def test_each_controller_sees_other_gains(name: str) -> None:
    """10 % more or 10 % less of each is red; the servos' gains are those of the model above."""
    more, less = (unseen(disturbed.in_gain(planned(name), factor)) for factor in (1.1, 0.9))
    assert more & less == UNSEEN_GAINS.get(name, set())


def test_guards_stay_far_below_their_bounds() -> None:
    """What docs/model.md says of them, in the bounds' own parts."""
    most = dict.fromkeys(Guards.__struct_fields__, 0.0)
    for result in results().values():
        for guard in result.metrics["guards"]:
            if guard["name"] in most:
                bound = getattr(result.scenario.guards, guard["name"])
                # high is the bound times a scale of the run, but where the bound is 0: not at all
                part = bound * guard["value"] / guard["high"] if bound else guard["value"]
                most[guard["name"]] = max(most[guard["name"]], part)
    page = (Path(__file__).parents[1] / "docs" / "model.md").read_text("utf-8")
    for name, part in most.items():
        bound, shipped = re.findall(rf"\| `{name}` \| .* \| (.*) \| (.*) \|", page)[0]
        assert getattr(Guards(), name) == float(bound)
        assert 0.5 * float(shipped) <= part <= float(shipped)
