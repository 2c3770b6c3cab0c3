"""A planned path is refused exactly where an independent check of the leg refuses it.

The check takes its poses from the oracle: reach, working mode, assembly mode, the stops of the
angle at C, and the motors' ranges in any of their turns.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import oracle
import pytest
from fivebar_controllers.servo import Servo
from poses import random_leg

from fivebar_sim import FiveBar, kinematics, model, motion, rollout, scenario
from fivebar_sim.arrays import Array
from fivebar_sim.errors import GeometryError, SingularError, UnreachableError
from fivebar_sim.geometry import MODES
from fivebar_sim.kinematics.stops import angle_at_C
from fivebar_sim.paths import Ellipse, Line

STEPS = 20
PERIOD = 0.04
"""Of a path there and back, whose steps are of 1 ms [s]: the steps go from end to end."""

TURN = 2.0 * math.pi
C_STOP = math.radians(2.0)
ALMOST = 1e-9
"""Nearer to a bound than this [rad] rounding decides."""


def drawn(rng: np.random.Generator) -> tuple[FiveBar, Line]:
    """Return a random leg of any branch that has a rest pose, and a path near a point it reaches.

    Most of the legs differ from the presets in everything; the path starts where side A reaches.
    """
    while True:
        mode = MODES[rng.integers(4)]
        leg = replace(random_leg(rng), mode=mode, assembly=int(rng.choice([-1, 1])))
        try:
            kinematics.home(leg)
        except GeometryError:
            continue
        A = kinematics.bases(leg)[0]
        BF = math.hypot(*leg.foot_offset)
        r = rng.uniform(abs(leg.L1 - BF), leg.L1 + BF)
        angle = rng.uniform(-math.pi, math.pi)
        start = A + r * np.array([math.cos(angle), math.sin(angle)])
        stop = start + rng.uniform(-0.1, 0.1, 2) * leg.size
        line = Line(
            start=(float(start[0]), float(start[1])),
            stop=(float(stop[0]), float(stop[1])),
            frequency=1.0 / PERIOD,
            ramp=0.0,
        )
        return leg, line


def joints(leg: FiveBar, feet: Array) -> Array | None:
    """Return (theta_A, theta_B, theta_E, theta_D) by the oracle, unwrapped, None out of reach."""
    plain = oracle.Leg.of(leg)
    rows = []
    for x, z in feet.tolist():
        try:
            psi1, psi2, psi3, psi4 = oracle.pose(plain, complex(x, z))
        except ValueError:
            return None
        if oracle.assembly_of(plain, [psi1, psi2, psi3, psi4]) != leg.assembly:
            return None
        rows.append((psi1, psi2 - psi1, psi4, psi3 - psi4))
    return np.unwrap(np.array(rows), axis=0)


def margin(leg: FiveBar, feet: Array) -> float:
    """Return how far inside all stops and ranges a path stays [rad]; negative where it does not.

    Every combination of whole turns of the motors counts, and those turns of the knees that their
    stops leave: of B where BF is folded over A, of D where DC is folded over E.
    """
    q = joints(leg, feet)
    if q is None:
        return -math.inf
    phi = math.atan2(*reversed(leg.foot_offset))
    q[:, 1] -= TURN * round((q[0, 1] + phi) / TURN)
    q[:, 3] -= TURN * round(q[0, 3] / TURN)
    rest = kinematics.home(leg)
    rest[1] -= TURN * round((rest[1] + phi) / TURN)
    at_C = rest[0] + rest[1] - rest[2] - rest[3]
    low = math.pi * math.floor(at_C / math.pi) + C_STOP
    high = low + math.pi - 2.0 * C_STOP
    best = -math.inf
    for n_A, n_E in itertools.product(range(-3, 4), repeat=2):
        theta_A = q[:, 0] + TURN * n_A
        theta_E = q[:, 2] + TURN * n_E
        angle = theta_A + q[:, 1] - theta_E - q[:, 3]
        inside = [angle - low, high - angle, TURN - abs(theta_A), TURN - abs(theta_E)]
        best = max(best, float(np.min(inside)))
    return best


def disagreements(seed: int, count: int) -> tuple[list[str], int]:
    """Return the legs and paths that plan and check judge differently, and how many are planned."""
    rng = np.random.default_rng(seed)
    wrong = []
    planned = 0
    for _ in range(count):
        leg, line = drawn(rng)
        feet = line.at(1e-3 * np.arange(STEPS + 1)).position
        room = margin(leg, feet)
        if abs(room) < ALMOST:
            continue
        try:
            motion.plan(leg, line, STEPS, 1e-3)
            accepted = True
        except SingularError:
            continue
        except UnreachableError:
            accepted = False
        planned += accepted
        if accepted != (room > 0.0):
            wrong.append(f"{leg} {line}: margin {room:g}, accepted: {accepted}")
    return wrong, planned


def test_refused_exactly_where_the_check_refuses() -> None:
    wrong, planned = disagreements(3, 60)
    assert wrong == []
    assert 8 < planned < 52  # neither all nor none


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_refused_exactly_where_the_check_refuses_of_ten_thousand(seed: int) -> None:
    assert disagreements(100 + seed, 1000)[0] == []


def test_no_stop_of_the_model_acts_on_a_planned_path() -> None:
    """Beyond its range a joint of MuJoCo is pushed back; between its ends nothing acts."""
    rng = np.random.default_rng(7)
    planned = 0
    while planned < 8:
        leg, line = drawn(rng)
        try:
            q = motion.plan(leg, line, STEPS, 1e-3).q
        except (SingularError, UnreachableError):
            continue
        built = model.build(leg)
        low, high = built.jnt_range.T
        assert np.all((q > low) & (q < high)), leg
        at_C = angle_at_C(q)
        assert np.all((at_C > built.tendon_range[0, 0]) & (at_C < built.tendon_range[0, 1])), leg
        planned += 1


def test_foot_beyond_the_motor_is_not_held_by_a_stop_of_the_knee() -> None:
    """A bent extension: theta_B passes 180 deg, while BF stays on its side of AB."""
    leg = FiveBar(0.08, 0.025, 0.06, 0.025, 0.04, 0.08, -2.2, -0.7, assembly=1)
    path = Ellipse(centre=(0.015, -0.1), radii=(0.02, 0.008), frequency=2.0)
    found = scenario.Scenario(
        name="bent",
        leg=leg,
        path=path,
        controller=Servo(feedforward="torque"),
        controller_name="servo",
        duration=1.5,
    )
    metrics = rollout.run(found).metrics
    assert metrics["tracking"]["rms"] < 2e-6  # measured: 0.6 um; with a stop at 180 deg 4.7 mm
    torque = metrics["load"]["torque_rms"]
    assert [torque["A"], torque["E"]] == pytest.approx([4.45e-3, 2.10e-3], rel=0.01)


def test_a_leg_whose_motors_need_another_turn_is_not_refused() -> None:
    leg = FiveBar(0.075, 0.115, 0.115, 0.075, 0.042, tilt=-2.75)
    line = Line(start=(-0.042, -0.055), stop=(-0.042, -0.056), frequency=1.0)
    q = motion.plan(leg, line, 1000, 1e-3).q
    assert np.degrees(q[0, [0, 2]]) % 360.0 == pytest.approx([136.36, 12.95], abs=0.01)
    assert np.abs(q[:, [0, 2]]).max() < TURN


STRETCHED = replace(FiveBar.load("classic"), L5=0.12)
"""A leg whose both sides are stretched with the foot 80 mm below its hip."""


@pytest.mark.parametrize("start", [-0.08, -0.07])
def test_singular_pose_says_when_and_where(start: float) -> None:
    """As its sisters do, the errors of a path out of reach, or beyond a stop."""
    line = Line(start=(0.0, start), stop=(0.0, -0.15 - start), frequency=1.0, ramp=0.0)
    with pytest.raises(SingularError) as caught:
        motion.plan(STRETCHED, line, 1000, 1e-3)
    k = 0 if start == -0.08 else 500
    assert caught.value.index == (k,)
    assert str(caught.value).startswith(
        f"path comes to a singular pose at t = {1e-3 * k:g} s, foot at (0.00, -80.00) mm: A, B and "
        "F are in line; the sine of the angle there must be above 2.4e-07, got "
    )
    assert "index" not in str(caught.value)
    with pytest.raises(SingularError, match=r"at t = 0 s, foot at \(0\.00, -80\.00\) mm: A, B"):
        motion.poses(STRETCHED, np.array([[0.0, -0.07], [0.0, -0.08]]))
