"""Held feedback: the bounds of sampled control, and what steps as long as the period make of it."""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np
import pytest

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import DivergedError, PoseError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import sampling
from fivebar_sim.simulation.sampling import FINER, Hold, Plant, Stability, growth

M = 2e-5  # [kg m^2]
T = 0.001  # [s]
KP = 1.0  # [N m/rad]


def slopes(kp: float, kd: float) -> Array:
    """Return those of a PD law for both motors, (1, 2, 4)."""
    return -np.concatenate([kp * np.eye(2), kd * np.eye(2)], axis=1)[None]


def rate(kp: float, kd: float, hold: Hold, parts: int, plant: Plant | None = None) -> float:
    """Return the growth of two uncoupled motors under a PD law [1/s]."""
    alone = Plant(M * np.eye(2)[None], 0.0, 0.0)
    return float(growth(plant or alone, slopes(kp, kd), hold, parts)[0])


@pytest.mark.parametrize("steps", [1, 4])
def test_held_torque_is_stable_within_the_published_bounds(steps: int) -> None:
    """It has kp T / 2 < kd < 2 m / T, whatever the timestep of the run."""
    hold = Hold(T / steps, steps, 0)
    low = 0.5 * KP * T
    high = 2.0 * M / T
    for factor, stable in ((0.9, False), (1.1, True)):
        assert (rate(KP, factor * low, hold, FINER * 8) < 0.0) == stable
        assert (rate(KP, high / factor, hold, FINER * 8) < 0.0) == stable


def test_steps_add_half_a_step_of_the_spring_to_the_damper() -> None:
    """With a step a period a spring alone stands still; with four it lacks three quarters."""
    assert rate(KP, 0.0, Hold(T, 1, 0), 1) == pytest.approx(0.0, abs=1e-6)
    assert rate(KP, 1e-6 * KP, Hold(T, 1, 0), 1) < 0.0
    soft = 1e-3 * KP  # so that a period is short beside an oscillation
    for steps in (1, 2, 4, 8):
        lacks = 0.5 * soft * T * (1.0 - 1.0 / steps)
        found = rate(soft, 0.0, Hold(T / steps, steps, 0), 1)
        assert found == pytest.approx(lacks / (2.0 * M), rel=1e-2, abs=1e-9)


@pytest.mark.parametrize("late", [0, 1, 2, 3, 4, 7])
def test_late_commands_grow_as_they_do_step_by_step(late: int) -> None:
    """Two steps a period, seen and sent late, against a plain loop over the steps."""
    h = 0.5 * T
    kp = 0.05
    kd = 0.002
    x = np.array([1.0, 0.0])
    states = [x]
    torque = 0.0
    for k in range(4000):
        if (k - late) % 2 == 0 and k >= late:
            q, v = states[k - late]
            torque = -kp * q - kd * v
        v = states[-1][1] + h * torque / M
        states.append(np.array([states[-1][0] + h * v, v]))
    sizes = np.hypot(np.array(states)[:, 0], np.array(states)[:, 1] / np.sqrt(kp / M))
    # The largest of an oscillation, early and late.
    first = sizes[1000:2000].max()
    last = sizes[3000:4000].max()
    expected = np.log(last / first) / (2000 * h)
    assert rate(kp, kd, Hold(h, 2, late), 1) == pytest.approx(expected, rel=0.05, abs=0.5)


def test_servo_between_commands_is_in_the_map() -> None:
    """Alone, spring and damper of a position servo die out as exp(-kd t / 2 m)."""
    plant = Plant(M * np.eye(2)[None], 0.5, 0.004)
    found = rate(0.0, 0.0, Hold(T, 1, 0), 64 * FINER, plant)
    assert found == pytest.approx(-0.004 / (2.0 * M), rel=0.01)


def test_only_what_the_run_does_not_show_is_hidden() -> None:
    time = np.array([1.0, 2.0, 3.0, 4.0])
    ten = np.log(10.0)
    real = ten * np.array([1.0, 1.0, -5.0, 1.0])
    unseen = Stability(time, real, np.array([-1.0, 0.0, 0.0, -3.0]))
    at = np.array([0.5, 1.0, 1.5, 2.0, 3.5, 9.0])
    np.testing.assert_allclose(unseen.hidden(at), [0.0, 1.0, 1.0, 2.0, 0.0, 1.0])
    np.testing.assert_allclose(Stability(time, real, np.abs(real)).hidden(at), 0.0)


UNDAMPED = "controller={name='pd',kd=0.0}"


def feedback(result: Result) -> Guard | None:
    found = [guard for guard in result.measured.guards if guard.name == "feedback"]
    return found[0] if found else None


def test_a_shorter_step_shows_what_the_guard_says() -> None:
    settings = [UNDAMPED, "sim.timestep=0.0005", "duration=1.25"]
    with pytest.raises(DivergedError, match=r"the foot left its path at t = 1\.0"):
        rollout.run(Scenario.load("classic-ellipse", settings))


@pytest.mark.parametrize(
    "settings",
    [
        ["controller.name=pd"],
        ["controller.name=computed_torque"],
        ["controller={name='pd',kp=0.05,kd=0.0002,period=0.005}"],
        # It falls by itself, and the run shows it.
        ["controller.name=gravity_compensation", "controller.kd=0.001"],
        # Twice the damper that a spring of 1 N m/rad needs, asked twice as often.
        ["controller={name='pd',kd=0.0005,period=0.0005}", "sim.timestep=0.0005"],
    ],
)
def test_stable_feedback_passes(settings: list[str]) -> None:
    result = rollout.run(
        Scenario.load("classic-ellipse", ["limits={}", "duration=0.75", *settings])
    )
    guard = feedback(result)
    assert guard is not None
    assert guard.ok
    assert guard.value == 0.0


def test_planned_setpoints_have_no_such_guard() -> None:
    result = rollout.run(Scenario.load("classic-ellipse", ["duration=0.75"]))
    assert feedback(result) is None


class Stiffening(msgspec.Struct, frozen=True):
    """Looks at the time: from 0.3 s on its spring is the stiffer the later it is."""

    drive: ClassVar[Drive] = "torque"
    period: float = 0.001

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the torques of a damped spring [N m], (nsim, 2)."""
        del leg, servo
        kp = 1.0 + seen.time if seen.time > 0.3 else 1.0
        return kp * (wanted.theta - seen.theta) - 0.01 * seen.theta_dot


def test_slopes_are_those_of_the_time_of_each_pose() -> None:
    scenario = Scenario.load("classic-ellipse", ["limits={}"]).driven_by(Stiffening())
    plan = rollout.plan(scenario)
    k = np.array([100, 400, 700])
    theta = plan.motion.q[k][:, ::2]
    rate = plan.motion.q_dot[k][:, ::2]
    found = sampling._slopes(scenario, Stiffening(), plan.motion, k, theta, rate)
    for slope, kp in zip(found, (1.0, 1.4, 1.7), strict=True):
        np.testing.assert_allclose(slope, slopes(kp, 0.01)[0], rtol=0, atol=1e-8)


class Shy(msgspec.Struct, frozen=True):
    """Answers one leg at a time, and refuses all others."""

    drive: ClassVar[Drive] = "torque"
    period: float = 0.001

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the torques of a damped spring [N m], (1, 2)."""
        del leg, servo
        if len(seen.theta) > 1:
            raise PoseError("too many")
        return 1.0 * (wanted.theta - seen.theta) - 0.01 * seen.theta_dot


def test_a_controller_that_does_not_answer_nearby_still_runs() -> None:
    scenario = Scenario.load("classic-ellipse", ["limits={}", "duration=0.75"]).driven_by(Shy())
    result = rollout.run(scenario)
    assert result.verdict == "not judged"
    assert feedback(result) is None
