"""Warnings that numbers owe something to the timestep: where they are true, and where none come."""

from __future__ import annotations

import pytest

from fivebar_sim import rollout
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.rollout import Result
from fivebar_sim.runs.coarse import CHECK
from fivebar_sim.scenario import Scenario

PLAIN = ("limits={}", "converge={}")

CASES = (
    (
        "q8bot-trot",
        ("duration=2.05",),
        "torque peaks depend on the timestep: 13.",
        ("load", "torque_peak", "A"),
    ),
    (
        "rail-landing",
        ("duration=0.75", "servo={kp=27,kd=0.023}", "sim.timestep=0.002"),
        "torques of jerks depend on the timestep: kp h = 0.054 N m s/rad adds to the servos' "
        "damping of 0.023 N m s/rad",
        ("load", "torque_rms", "A"),
    ),
    (
        "classic-ellipse",
        (
            *("duration=0.75", "path.ramp=0.0", "servo={kp=13.7,kd=0.079}"),
            *("leg.armature=5e-6", "sim.timestep=0.0005"),
        ),
        "the largest torque of A is that of the first 10 steps, in which the run starts",
        ("load", "torque_peak", "A"),
    ),
    (
        "extended-figure-eight",
        (
            *("duration=0.75", "controller.feedforward=velocity", "sim.timestep=0.002"),
            "servo={kp=6,kd=0.11,limit=1.8}",
        ),
        "tracking depends on the timestep: the loop is open by 0.6",
        ("tracking", "rms"),
    ),
    (
        "minitaur-trot",
        (
            *("duration=0.75", "servo={}", "leg.armature=8e-5", "leg.L2=0.195"),
            *("controller={name='pd',kp=11.9,kd=0.0094,period=0.002}", "sim.timestep=0.002"),
        ),
        "the timestep damps the feedback: errors die out at ",
        ("load", "torque_peak", "A"),
    ),
    (
        "treadmill-trot",
        ("duration=0.5", "controller={name='impedance',stiffness=[6400,6400],damping=[9,9]}"),
        "the timestep damps the feedback: errors die out at ",
        ("load", "torque_rms", "E"),
    ),
)
"""A scenario, settings, what is said, and a metric that is wrong by 4 % or more."""


def ran(name: str, *settings: str) -> Result:
    return rollout.run(Scenario.load(name, [*PLAIN, *settings]))


@pytest.mark.parametrize(("name", "settings", "said", "key"), CASES, ids=[c[0] for c in CASES])
def test_warning_is_true(
    name: str, settings: tuple[str, ...], said: str, key: tuple[str, ...]
) -> None:
    coarse = ran(name, *settings)
    (remark,) = coarse.remarks
    assert remark.startswith(said)
    assert remark.endswith(CHECK)
    assert coarse.verdict == "not judged"

    h = coarse.scenario.sim.timestep
    finer = ran(name, *settings, f"sim.timestep={h / 4}")
    was = look_up(coarse.metrics, ".".join(key))
    now = look_up(finer.metrics, ".".join(key))
    assert was is not None
    assert now is not None
    assert abs(was - now) > 0.04 * now


def test_scenario_that_has_been_checked_says_so_itself() -> None:
    settings = ["limits={}", "duration=2.05"]
    assert not rollout.run(Scenario.load("q8bot-trot", settings)).remarks


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("classic-ellipse", ()),
        ("classic-ellipse", ("controller.name=pd",)),
        ("classic-ellipse", ("controller.name=impedance",)),
        # A leg that nothing hits is right with a spring that stiff.
        ("classic-ellipse", ("servo.kp=30", "controller.feedforward=torque")),
        ("rail-landing", ("servo.kp=7",)),
    ],
)
def test_no_warning_where_numbers_are_right(name: str, settings: tuple[str, ...]) -> None:
    assert not ran(name, "duration=0.75", *settings).remarks


def test_guard_that_tripped_is_not_said_twice() -> None:
    assert not ran("classic-ellipse", "duration=0.75", "servo.rate=50").remarks
    assert not ran("classic-ellipse", "duration=0.75", "controller={name='pd',kd=0.0}").remarks
