"""Commands that jump: torques that last a step are seen, counted, and said."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import dynamics, rollout
from fivebar_sim.metrics import lasting
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import jolts

EDGE = ("path.outside=nearest", "path.centre=[0,-0.093]")
TWELVE_BITS = "servo.resolution=0.0015339807878856412"
SHORT = "duration=0.75"


def ran(name: str, *settings: str) -> Result:
    return rollout.run(Scenario.load(name, ["limits={}", *settings]))


def guard(result: Result) -> Guard:
    (found,) = (each for each in result.measured.guards if each.name == "jolts")
    return found


# law


def test_lone_values_stand_out_from_both_neighbours() -> None:
    one = np.array([0.0, 0.0, 5.0, 1.0, 1.0, 1.0, -2.0, 1.0])
    other = np.array([3.0, 3.0, 4.0, 5.0, 6.0, 9.0, 9.0, 9.0])  # steps and slopes alone
    found = lasting.lone(np.stack([one, other], axis=1), np.array([0.0, 3.0]))
    np.testing.assert_array_equal(found[:, 0], [0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 3.0, 0.0])
    np.testing.assert_array_equal(found[:, 1], 0.0)


def test_first_value_has_the_one_before_the_run_beside_it() -> None:
    found = lasting.lone(np.array([[4.0, 4.0], [1.0, 1.0]]), np.array([1.0, 4.0]))
    np.testing.assert_array_equal(found, [[3.0, 0.0], [0.0, 0.0]])


def test_resolved_decay_stands_out_by_what_is_lost_in_a_step() -> None:
    """A jump that decays by the factor r a step: 1 - r of it, which is the error of its peak."""
    r = 0.8
    decay = np.where(np.arange(60) < 20, 0.0, r ** (np.arange(60.0) - 20.0))
    found = lasting.lone(np.stack([decay, decay], axis=1), np.zeros(2))
    assert found.max() == pytest.approx(1.0 - r)


# oracle


def test_torques_needed_in_some_steps_are_those_of_the_whole_motion() -> None:
    planned = rollout.plan(Scenario.load("payload-ellipse", [SHORT, "path.ramp=0.0"]))
    motion = planned.motion
    leg = planned.scenario.leg
    whole = dynamics.step_torques(
        leg, motion.q, motion.timestep, motion.force[:-1], payload=motion.payload
    )
    steps = np.array([0, 1, 2, 300, len(whole) - 1])
    np.testing.assert_array_equal(jolts._needed(planned, steps), whole[steps])


# runs that are none


CASES = (
    ("a bus of 50 Hz", ("servo.rate=50",)),
    ("12 bits", (TWELVE_BITS,)),
    ("along the edge", (*EDGE, "controller.feedforward=torque", "duration=1")),
    ("at speed from the start", ("path.ramp=0.0", "controller.feedforward=torque")),
    ("the same without torque", ("path.ramp=0.0", "controller.feedforward=velocity")),
)
"""Each with a torque that grows as the timestep falls: at 1 ms it is a part of what it would be."""


@pytest.mark.parametrize("settings", [case[1] for case in CASES], ids=[case[0] for case in CASES])
def test_jumping_commands_do_not_pass(settings: tuple[str, ...]) -> None:
    coarse = ran("classic-ellipse", SHORT, *settings)
    found = guard(coarse)
    assert coarse.verdict == "fail"
    assert [str(each) for each in coarse.measured.guards if not each.ok] == [str(found)]
    assert str(found).startswith("guard jolts: a command jumped: torque of more than 25 % of the")

    finer = ran("classic-ellipse", SHORT, *settings, "sim.timestep=0.00025")
    peak = [max(each.metrics["load"]["torque_peak"].values()) for each in (coarse, finer)]
    assert peak[1] > 1.25 * peak[0]


def test_a_shorter_step_that_resolves_the_jump_passes() -> None:
    """The jump decays within M / kd, 0.4 ms."""
    found = guard(ran("classic-ellipse", "duration=0.76", "servo.rate=50", "sim.timestep=5e-5"))
    assert found.ok
    assert found.value is not None
    assert 0.05 < found.value < 0.15


def test_a_torque_that_the_bus_holds_by_chance_does_not_pass() -> None:
    """M v / h of the first step is held for 20 ms, four times as much at a quarter of the step."""
    free = "servo={preset='hobby-9g',friction=0.0,limit=5.0,speed=200.0}"
    held = ("path.ramp=0.0", "duration=2.0", "controller.feedforward=torque", "converge={}", free)
    coarse, finer = (ran("hobby-servo-circle", *held, f"sim.timestep={h}") for h in (1e-3, 2.5e-4))
    first = [np.abs(each.record["torque_A"]).max() for each in (coarse, finer)]
    assert first[1] > 1.25 * first[0]
    assert not guard(coarse).ok
    assert not guard(finer).ok


def test_a_jump_that_a_late_bus_spreads_over_two_steps_does_not_pass() -> None:
    """Sent 2.5 steps late it comes in two halves, and hardly a trace is in the torque of 2 ms."""
    late = ("servo={kp=3.5,kd=0.02,rate=250,delay=0.005}", "duration=1.25")
    coarse, finer = (ran("classic-figure-eight", *late, f"sim.timestep={h}") for h in (2e-3, 5e-4))
    peaks = [each.metrics["load"]["torque_peak"]["A"] for each in (coarse, finer)]
    assert peaks[1] > 5.0 * peaks[0]
    torque = np.stack([coarse.record[f"torque_{motor}"] for motor in "AE"], axis=1)
    assert lasting.lone(torque, np.zeros(2)).max() < 0.05 * np.abs(torque).max()
    assert not guard(coarse).ok


def test_torque_drive_has_no_such_guard() -> None:
    result = ran("classic-ellipse", SHORT, "controller.name=pd")
    assert "jolts" not in {each.name for each in result.measured.guards}


def test_corners_of_the_reference_count_where_a_controller_uses_its_accelerations() -> None:
    """At 0.5 ms computed torque leaves its branch there: a corner has twice the acceleration."""
    corner = ran("classic-ellipse", SHORT, *EDGE, "controller.name=computed_torque")
    assert not guard(corner).ok
    blind = ran("classic-ellipse", SHORT, *EDGE, "controller.name=pd")
    assert (guard(blind).value, guard(blind).ok) == (0.0, True)
    within = ("path.outside=nearest", "controller.name=computed_torque")
    assert guard(ran("classic-ellipse", SHORT, *within)).value == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("settings", [(), ("controller.feedforward=torque",), ("servo=xl330",)])
def test_smooth_commands_pass(settings: tuple[str, ...]) -> None:
    found = guard(ran("classic-ellipse", SHORT, *settings))
    assert found.ok
    assert found.value is not None
    assert found.value < 0.2


def test_a_leg_that_feels_nothing_is_not_jolted() -> None:
    """No gravity and no motion: all torque is rounding."""
    held = ("path={kind='line',start=[0,0.6],stop=[0,0.6],frequency=2}", SHORT)
    result = ran("airhockey-pd", *held, "controller={name='servo'}", "servo={}")
    assert guard(result).ok
