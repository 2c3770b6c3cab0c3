"""Rollouts against the independent model of oracle.py, which shares nothing with the package."""

from __future__ import annotations

from functools import cache

import numpy as np
import oracle
import oracle_simulation
import pytest

from fivebar_sim import kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import DivergedError, UnreachableError
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

INTEGRATORS = ("discrete", "implicitfast")
LAWS = ("none", "velocity")
MOTORS = ("A", "E")


DURATION = 0.75
"""The ramp and a turn of the ellipse [s]."""
RTOL = 1e-9
"""Of the oracle: a part in a thousand of what is compared at the closest."""


@cache
def ellipse(*settings: str) -> Result:
    return rollout.run(Scenario.load("classic-ellipse", [f"duration={DURATION}", *settings]))


@cache
def truth(feedforward: str = "none", limit: float = np.inf) -> oracle_simulation.Motion:
    leg = oracle.Leg.of(Scenario.load("classic-ellipse").leg)
    law = oracle_simulation.Servo(kp=8.0, kd=0.05, feedforward=feedforward, limit=limit)
    path = oracle_simulation.eased_ellipse((0.0, -0.072), (0.020, 0.008), 2.0, 0.25)
    times = np.arange(1.0, 1e3 * DURATION + 1.0) * 1e-3
    return oracle_simulation.simulate(leg, law, path, DURATION, times, rtol=RTOL)


def rms(values: Array) -> float:
    """Return the root mean square over time of a column, or of vectors (N, 2)."""
    return float(np.sqrt(np.mean(np.sum(np.atleast_2d(values.T) ** 2, axis=0))))


def column_pair(result: Result, name: str) -> Array:
    return np.stack([result.record[f"{name}_{side}"] for side in MOTORS], axis=-1)


def foot(result: Result) -> Array:
    return np.stack([result.record["foot_x"], result.record["foot_z"]], axis=-1)


def target(result: Result) -> Array:
    return np.stack([result.record["target_x"], result.record["target_z"]], axis=-1)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_oracle_tracking_of_the_plain_servo(integrator: str) -> None:
    result = ellipse(f"sim.integrator={integrator}")
    true = truth()
    window = result.scenario.window
    error = rms((true.foot - target(result))[window])
    assert error == pytest.approx(1.19e-3, rel=0.01)
    assert result.metrics["tracking"]["rms"] == pytest.approx(error, rel=0.02)
    # the foot itself: of first order, a part of what it moves in a step at its peak speed
    step = 0.02 * 4 * np.pi * 1e-3
    assert np.linalg.norm(foot(result) - true.foot, axis=-1).max() < 0.15 * step


@pytest.mark.parametrize("feedforward", LAWS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_oracle_torque_rms(integrator: str, feedforward: str) -> None:
    result = ellipse(f"sim.integrator={integrator}", f"controller.feedforward={feedforward}")
    window = result.scenario.window
    true = truth(feedforward).tau[window]
    ours = column_pair(result, "torque")[window]
    for i, motor in enumerate(MOTORS):
        size = rms(true[:, i])
        assert result.metrics["load"]["torque_rms"][motor] == pytest.approx(size, rel=0.01)
        # step by step too, not only on average
        assert rms(ours[:, i] - true[:, i]) < 0.01 * size


def test_velocity_feedforward_leaves_tau_over_kp() -> None:
    result = ellipse("controller.feedforward=velocity")
    assert result.metrics["tracking"]["rms"] < 20e-6
    # what remains is the spring's own deflection: foot error = J tau / kp
    window = result.scenario.window
    theta = column_pair(result, "theta")[window]
    tau = column_pair(result, "torque")[window]
    J = kinematics.jacobian(result.scenario.leg, theta)
    sag = np.einsum("nij,nj->ni", J, tau) / result.scenario.servo.kp
    left = (target(result) - foot(result))[window]
    assert rms(left - sag) < 0.15 * rms(sag)


def test_remaining_error_falls_with_kp() -> None:
    soft = ellipse("controller.feedforward=velocity").metrics["tracking"]["rms"]
    stiff = ellipse("controller.feedforward=velocity", "servo.kp=32.0", "servo.kd=0.2").metrics[
        "tracking"
    ]["rms"]
    assert soft / stiff == pytest.approx(4.0, rel=0.1)


def test_loop_gap_stays_within_a_micrometre() -> None:
    closure = ellipse().metrics["closure"]
    assert 0.0 < closure["rms"] < closure["max"] < 1e-6


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_setpoint_timing_is_the_better_one(integrator: str) -> None:
    """One step early or late costs an order of magnitude more than tau / kp does."""
    scenario = Scenario.load(
        "classic-ellipse",
        [
            f"duration={DURATION}",
            f"sim.integrator={integrator}",
            "controller.feedforward=velocity",
        ],
    )
    planned = rollout.plan(scenario)
    best = rollout.execute(planned).metrics["tracking"]["rms"]
    for shift in (-1, 1):
        moved = planned._replace(setpoints=np.roll(planned.ctrl, shift, axis=0))
        assert rollout.execute(moved).metrics["tracking"]["rms"] > 5.0 * best


def test_saturation_against_the_oracle() -> None:
    """With a limit below what the motion needs the leg falls behind, as the oracle's does."""
    limit = 0.00283
    result = ellipse(f"servo.limit={limit}", "duration=0.75")
    law = oracle_simulation.Servo(kp=8.0, kd=0.05, limit=limit)
    path = oracle_simulation.eased_ellipse((0.0, -0.072), (0.020, 0.008), 2.0, 0.25)
    true = oracle_simulation.simulate(
        oracle.Leg.of(result.scenario.leg), law, path, 0.75, result.record["time"], rtol=1e-7
    )
    clipped = np.abs(column_pair(result, "torque")) > limit * (1.0 - 1e-9)
    assert 0.02 < clipped.mean() <= 1.0
    assert np.linalg.norm(foot(result) - true.foot, axis=-1).max() < 0.02 * 0.020


def test_share_of_a_mirrored_leg_is_mirrored() -> None:
    """Seen from behind, A and E change places, and so does the motion's direction."""
    plain = ellipse("leg.L2=0.065").metrics["load"]
    mirrored = ellipse(
        "leg.L3=0.065",
        "leg.foot_radius=1e-6",
        "path.kind=line",
        "path.start=[-0.01, -0.07]",
        "path.stop=[0.02, -0.075]",
    )
    original = ellipse(
        "leg.L2=0.065",
        "leg.foot_radius=1e-6",
        "path.kind=line",
        "path.start=[0.01, -0.07]",
        "path.stop=[-0.02, -0.075]",
    )
    share = original.metrics["load"]["share_A"]
    assert mirrored.metrics["load"]["share_A"] == pytest.approx(1.0 - share, abs=1e-6)
    assert abs(share - 0.5) > 1e-3
    assert plain["share_A"] != pytest.approx(0.5, abs=1e-3)


def test_record_is_consistent() -> None:
    result = ellipse()
    record = result.record
    leg = result.scenario.leg
    assert all(column.shape == (750,) and column.dtype == np.float64 for column in record.values())
    np.testing.assert_array_equal(record["time"], np.arange(1, 751) * 0.001)
    q = np.stack([record[f"theta_{joint}"] for joint in "ABED"], axis=-1)
    np.testing.assert_allclose(foot(result), kinematics.chain_points(leg, q).F, atol=0.0)
    # angles from their rates: trapezoid over a step, error h^2 / 12 times the acceleration's change
    q_dot = np.stack([record[f"theta_dot_{joint}"] for joint in "ABED"], axis=-1)
    np.testing.assert_allclose(np.diff(q, axis=0), 1e-3 * q_dot[1:], atol=1e-12)


def test_flip_is_kept_and_fails() -> None:
    """A leg that moves in another working mode than its own is seen at the first step."""
    own = Scenario.load("classic-ellipse", ["duration=0.75"])
    other = Scenario.load("classic-ellipse", ["duration=0.75", "leg.mode=[-1, -1]"])
    result = rollout.execute(rollout.plan(other)._replace(scenario=own))
    branch = result.metrics["branch"]
    assert branch["working_mode"] == [-1, -1]
    assert branch["flips"] == 1
    assert branch["first_flip"] == pytest.approx(0.001)
    assert result.verdict == "fail"


def test_refusal_of_a_diverging_timestep() -> None:
    scenario = Scenario.load(
        "classic-ellipse", ["sim.timestep=0.05", "sim.integrator=implicitfast"]
    )
    with pytest.raises(DivergedError, match=r"broke down at t = 0\.\d+ s") as caught:
        rollout.run(scenario)
    assert 0.0 < caught.value.time < 1.0


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_refusal_of_a_timestep_that_cannot_see_the_path(integrator: str) -> None:
    """Even where the step is stable: at a whole period a step, every sample would look perfect."""
    scenario = Scenario.load(
        "classic-ellipse", ["sim.timestep=0.25", f"sim.integrator={integrator}"]
    )
    with pytest.raises(
        DivergedError, match=r"broke down|cannot follow the path: the timestep must"
    ):
        rollout.run(scenario)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["path.radii=[0.02, 0.04]"], r"at t = 0 s: .* is 13\.1 mm out; .*\(0\.00, -98\.87\) mm"),
        (["path.centre=[0.0, 0.018]", "path.radii=[0.001, 0.001]"], "other assembly mode"),
        (
            [
                "path.kind=circle",
                "path.centre=[0.0, 0.0]",
                "path.radius=0.08",
                "path.frequency=4.0",
            ],
            r"winds theta_A beyond its range of \+-360 deg: at t = ",
        ),
    ],
)
def test_refusal_of_paths(settings: list[str], message: str) -> None:
    with pytest.raises(UnreachableError, match=message):
        rollout.plan(Scenario.load("classic-ellipse", settings))
