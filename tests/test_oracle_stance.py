"""The oracle's stance is proven here: energy, power, statics, the floor, and its other self."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import oracle
import oracle_simulation
import oracle_stance
import pytest
from oracle import Array, Leg
from oracle_simulation import Pair, Path, Servo
from oracle_stance import Ground, Stance, simulate

from fivebar_sim.geometry import FiveBar

CLASSIC = Leg.of(FiveBar())
ODD = replace(  # nothing equal, nothing on an axis: a swap or a lost sign shows
    Leg.of(FiveBar(L1=0.040, L2=0.066, L3=0.058, L4=0.045, L5=0.030, L6=0.020, bend=0.5, tilt=0.2)),
    com=(0.017 + 0.003j, 0.037 - 0.005j, 0.026 + 0.004j, 0.021 - 0.002j),
)
SQUATS = {"classic": (CLASSIC, (0.0, -0.072)), "odd": (ODD, (0.005, -0.085))}
GRIPS = pytest.mark.parametrize("grips", [False, True], ids=["slides", "grips"])
EACH = pytest.mark.parametrize("name", SQUATS)
SERVO = Servo(8.0, 0.05, "velocity")
TIMES: Array = np.linspace(0.001, 0.4, 400)


@cache
def squat(name: str, *, grips: bool, servo: Servo = SERVO, still: bool = False) -> Stance:
    leg = SQUATS[name][0]
    path = path_of(name, still=still)
    return simulate(leg, Ground(0.5, 0.006, grips), servo, path, TIMES)


def path_of(name: str, *, still: bool = False) -> Path:
    depth = 0.0 if still else 0.008
    return oracle_simulation.eased_ellipse(SQUATS[name][1], (0.0, depth), 2.0, 0.25)


# law


@EACH
@GRIPS
def test_energy_grows_by_the_work_of_the_motors_alone(name: str, grips: bool) -> None:
    """The floor does no work: N has nothing to move, T nothing that slides."""
    from scipy.integrate import simpson

    motion = squat(name, grips=grips)
    theta_dot = np.gradient(motion.theta, TIMES, axis=0, edge_order=2)
    power = np.sum(motion.tau * theta_dot, axis=-1)
    late = slice(200, None)  # the start's jolt is too fast for differences on 1 ms
    work = simpson(power[late], x=TIMES[late])
    gain = motion.energy[-1] - motion.energy[200]
    assert abs(gain) > 1e-3
    # differences on 1 ms of motions of 25 rad/s: h^2 w^2 / 6 is 1e-4 of the power
    assert gain == pytest.approx(work, rel=3e-4)


@EACH
def test_free_leg_keeps_its_energy(name: str) -> None:
    leg = SQUATS[name][0]

    def free(leg: Leg, path: Path, t: float, theta: Pair, theta_dot: Pair) -> Pair:
        return 0.0, 0.0

    for grips in (False, True):
        ground = Ground(0.5, 0.006, grips)
        motion = simulate(leg, ground, free, path_of(name), TIMES[:25], rtol=1e-12)
        fallen = motion.hip_z[0] - motion.hip_z[-1]
        assert fallen > 5e-4
        lost = np.abs(motion.energy - motion.energy[0]).max()
        assert lost < 1e-9 * 0.5 * 9.81 * fallen


@EACH
def test_floor_holds_and_the_ball_rolls(name: str) -> None:
    slides, grips = (squat(name, grips=each) for each in (False, True))
    np.testing.assert_allclose(slides.hip_z + slides.foot[:, 1], 0.006, rtol=0, atol=1e-15)
    assert np.abs(slides.slip).max() > 1e-4
    assert np.abs(grips.slip).max() < 1e-9  # kept as an acceleration only: the solver's tolerance
    np.testing.assert_array_equal(slides.ground[:, 0], 0.0)
    assert np.abs(grips.ground[:, 0]).max() > 0.1


@EACH
@GRIPS
def test_hip_accelerates_by_what_the_floor_gives(name: str, grips: bool) -> None:
    """N - weight = sum m a over trunk and links, the accelerations by differences."""
    leg = SQUATS[name][0]
    motion = squat(name, grips=grips)
    psi = [oracle.closed(leg, *theta) for theta in motion.theta.tolist()]
    height = motion.hip_z * (0.5 + sum(leg.mass))
    height += [
        sum(
            m * oracle.position(c).imag
            for m, c in zip(leg.mass, oracle.centres(leg, p), strict=True)
        )
        for p in psi
    ]
    rate = np.gradient(np.gradient(height, TIMES), TIMES)[250:-5]
    weight = -(0.5 + sum(leg.mass)) * leg.gravity.imag
    push = motion.ground[250:-5, 1] - weight
    assert np.abs(push).max() > 0.3
    # h^2 w^2 of differences of differences, and what still rings of the start
    np.testing.assert_allclose(rate, push, rtol=0, atol=2e-3 * np.abs(push).max())


# oracle


@EACH
@GRIPS
def test_torques_are_those_of_the_lifted_leg(name: str, grips: bool) -> None:
    """In the hip's falling frame it is a leg in the air, with less weight and a foot force."""
    # without radius, T acts at F itself
    leg = SQUATS[name][0]
    ground = Ground(0.5, 0.0, grips)
    psi = oracle.closed(leg, -2.2, -0.9)
    rate = [3.0, -2.0]
    psi_dot = oracle_simulation.knee_rates(leg, psi, *rate)
    psi_ddot, lift, force = oracle_stance.forward_dynamics(leg, ground, psi, psi_dot, (0.1, -0.2))
    lifted = replace(leg, gravity=leg.gravity - 1j * lift)
    known, _ = oracle.forward_dynamics(lifted, psi, psi_dot, (0.1, -0.2), force)
    np.testing.assert_allclose(psi_ddot, known, rtol=1e-9)


@EACH
@GRIPS
def test_at_rest_the_motors_hold_the_weight(name: str, grips: bool) -> None:
    leg = SQUATS[name][0]
    motion = squat(name, grips=grips, servo=Servo(8.0, 0.05), still=True)
    weight = -(0.5 + sum(leg.mass)) * leg.gravity.imag
    T, N = motion.ground[-1]
    assert pytest.approx(weight, rel=1e-3) == N  # still ringing: e^(-160 t) and slower
    psi = oracle.closed(leg, *motion.theta[-1].tolist())
    M = Ground(0.5, 0.006, grips)
    ddot, lift, _ = oracle_stance.forward_dynamics(leg, M, psi, [0.0] * 4, motion.tau[-1].tolist())
    assert abs(lift) < 0.05
    assert np.abs(ddot).max() < 5.0
    if grips:
        assert abs(T) > 0.05
    foot = complex(*motion.foot[-1])
    held = oracle.torques(leg, foot, 0j, 0j, complex(T, N))
    twist = 0.006 * T  # the side force acts a radius below F: a moment on L2
    scale = np.abs(held).max()
    assert np.abs(motion.tau[-1] - held).max() < 5e-3 * scale + 3.0 * abs(twist)


# refusal


def test_a_floor_does_not_pull() -> None:
    path = oracle_simulation.eased_ellipse((0.0, -0.070), (0.0, 0.012), 8.0, 0.05)
    with pytest.raises(ValueError, match="lifts off at t = "):
        simulate(CLASSIC, Ground(0.5, 0.006), SERVO, path, TIMES)
    assert math.isfinite(TIMES[-1])
