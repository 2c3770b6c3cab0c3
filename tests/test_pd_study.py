"""The published PD study of the preset `airhockey`, and the page about the controllers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from fivebar_controllers.pd import Pd
from shell import Shell

from fivebar_sim import dynamics, kinematics, rollout, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.servo import Servo
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

PAGE = Path(__file__).parents[1] / "docs" / "controllers.md"
STUDY = "airhockey-pd"
LONG = "duration=4.0"
FREE = "servo={}"
SLOW = "controller.period=0.01"
BARS = {5: (150e-3, np.inf), 50: (30e-3, 70e-3), 150: (0.0, 25e-3)}
"""RMS over the lines [m] of what the study says of its gains: does not follow, follows, follows
closely. Half the lines' mean length is 0.24 m; a follower's lag kd / kp is 0.1 s at 0.5 m/s."""


def moved(dx: float) -> list[str]:
    points = Scenario.load(STUDY).table()["path"]["points"]
    return ["path.outside=nearest", f"path.points={[[x + dx, z] for x, z in points]}"]


RUNS = {
    **{f"free {kp}": (STUDY, FREE, f"controller.kp={kp}") for kp in BARS},
    **{f"limited {kp}": (STUDY, f"controller.kp={kp}") for kp in BARS},
    **{f"moved {dx:g}": (STUDY, FREE, *moved(dx)) for dx in (0.4, -0.4)},
    "slow limited": (STUDY, SLOW),
    "schedule": ("airhockey-gain-schedule",),
}


@pytest.fixture(scope="module")
def ran() -> dict[str, Result]:
    """Return all runs that hold, of one batch."""
    plans = [rollout.plan(Scenario.load(source, [LONG, *s])) for source, *s in RUNS.values()]
    return dict(zip(RUNS, rollout.run_all(plans), strict=True))


def rms(result: Result) -> float:
    return result.metrics["tracking"]["rms"]


# law


@pytest.mark.parametrize("kp", BARS)
@pytest.mark.parametrize("limit", ["free", "limited"])
def test_gains_do_what_the_study_says(ran: dict[str, Result], kp: int, limit: str) -> None:
    result = ran[f"{limit} {kp}"]
    low, high = BARS[kp]
    assert low < rms(result) < high
    assert result.scenario.servo.limit == (1.0 if limit == "limited" else None)
    peak = max(result.metrics["load"]["torque_peak"].values())
    assert peak <= 1.0 or limit == "free"
    assert (peak >= 1.0) == (kp == 150)  # the corners ask the stiffest for more than the limit
    assert (result.scenario.window.start, result.scenario.window.stop) == (0, 4000)


def test_path_is_the_studys_from_A(ran: dict[str, Result]) -> None:
    """In its frame, with the origin at A, every corner is one of its round numbers."""
    scenario = ran["free 150"].scenario
    A = kinematics.bases(scenario.leg)[0]
    corners = scenario.path.at(np.arange(5.0)).position - A
    expected = [(0.6, 0.4), (0.5, 0.5), (-0.25, 0.25), (-0.2, 0.6), (0.3, 0.6)]
    np.testing.assert_allclose(corners, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("dx", [0.4, -0.4])
def test_moved_path_stays_in_the_workspace(ran: dict[str, Result], dx: float) -> None:
    result = ran[f"moved {dx:g}"]
    leg = result.scenario.leg
    record = result.record
    targets = np.stack([record["target_x"], record["target_z"]], axis=-1)
    asked = result.scenario.path.at(record["time"]).position
    assert workspace.reachable(leg, targets, mode=leg.mode).all()
    out = ~workspace.reachable(leg, asked, mode=leg.mode)
    assert 0.05 < out.mean() < 0.6
    assert np.hypot(*(asked - targets).T)[out].max() > 0.05
    assert rms(result) < BARS[150][1]
    assert result.metrics["branch"]["flips"] == 0


def test_schedule_at_ten_milliseconds_is_nearer_than_the_pd_at_one(ran: dict[str, Result]) -> None:
    assert ran["schedule"].scenario.controller.period == 0.01  # pyright: ignore[reportAttributeAccessIssue]
    assert rms(ran["schedule"]) < 0.1 * rms(ran["free 150"])
    assert ran["schedule"].verdict == "pass"


def test_limited_pd_at_ten_milliseconds_only_swings(ran: dict[str, Result]) -> None:
    """From limit to limit most of the time, where at 1 ms only the corners saturate."""
    slow = ran["slow limited"].metrics["load"]["saturated"]
    fast = ran["limited 150"].metrics["load"]["saturated"]
    assert min(slow.values()) > 0.7
    assert 0.0 < max(fast.values()) < 0.02


# oracle


def test_study_agrees_with_the_equations_of_motion(ran: dict[str, Result]) -> None:
    """The PD asked at every instant, on two coordinates, by an error-controlled integrator."""
    result = ran["free 150"]
    leg = result.scenario.leg
    path = result.scenario.path
    law = Pd(kp=150.0, kd=5.0)
    still = np.zeros(2)
    corners = path.at(np.arange(3.0)).position

    def torque(t: float, theta: Array, theta_dot: Array) -> Array:
        k = min(int(t), 1)  # a line takes a second
        foot = corners[k] + (t - k) * (corners[k + 1] - corners[k])
        wanted = kinematics.inverse(leg, foot)
        wanted = wanted + 2.0 * np.pi * np.round((theta - wanted) / (2.0 * np.pi))
        reference = Reference(foot, still, still, wanted, still, still, still, 0.0)
        return law.command(leg, Servo(), Observation(t, theta, theta_dot), reference)

    theta = kinematics.inverse(leg, path.at(0.0).position)
    rate = still
    feet = []
    for line in range(2):  # one by one: the reference has a kink at the corner
        time = line + np.linspace(0.0, 1.0, 101)
        # its own error is 0.6 um
        motion = dynamics.integrate(leg, theta, rate, time, torque, rtol=1e-5, atol=1e-6)
        theta = motion.theta[-1]
        rate = motion.theta_dot[-1]
        feet.append(kinematics.forward(leg, motion.theta[1:]))
    simulated = np.stack([result.record[f"foot_{axis}"][9:2000:10] for axis in "xz"], axis=-1)
    off = np.hypot(*(np.concatenate(feet) - simulated).T)
    assert off.max() < 0.4e-3  # half a timestep, which the torque is held for, at up to 0.8 m/s


# refusal


@pytest.mark.parametrize(
    ("settings", "left"), [((), 0.075), (("controller.derivative=error",), 0.047)]
)
def test_stiff_pd_breaks_down_at_ten_milliseconds(
    shell: Shell, settings: tuple[str, ...], left: float
) -> None:
    sets = [word for s in (FREE, SLOW, *settings) for word in ("--set", s)]
    line = shell.refused("run", STUDY, *sets, "--out", "never", status=1)
    found = re.match(r"airhockey-pd: the foot left its path at t = ([0-9.]+) s; ", line)
    assert found is not None, line
    assert float(found[1]) == pytest.approx(left, abs=2e-3)
    assert "broke down at t = " in line
