"""Laws that every call obeys: assembly, payload, what is left out, the soft loop, break-downs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from poses import sample

from fivebar_sim import dynamics, kinematics, model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.chain import Chain
from fivebar_sim.dynamics.plane import dot, placed, weigh
from fivebar_sim.errors import ArgumentError, DivergedError
from fivebar_sim.geometry import HEAVIEST, FiveBar
from fivebar_sim.integrator import pull
from fivebar_sim.paths import Ellipse

HEAVY = FiveBar(  # nothing equal, nothing in the middle of a link
    *(0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3),
    mass=(0.03, 0.05, 0.02, 0.07),
    com=(0.012, 0.031, 0.015, 0.02),
    com_across=(0.003, -0.005, 0.004, -0.002),
    inertia=(1e-5, 4e-5, 2e-5, 3e-5),
    armature=3e-5,
    gravity=(2.5, -9.0),
)
PLAIN = replace(HEAVY, L6=0.0, bend=0.0)
CLASSIC = FiveBar.load("classic")
H = 1e-3
Result = tuple[Array, ...]


def state(leg: FiveBar) -> tuple[Array, Array, Array, Array]:
    """Return angles, rates, accelerations or torques, and forces of 20 poses on a leg's branch."""
    rng = np.random.default_rng(12)
    theta = sample(leg, (20,), leg.mode, leg.assembly)[1]
    w, alpha, F = rng.uniform(-5.0, 5.0, (3, *theta.shape))
    return theta, w, alpha, F


def answers(leg: FiveBar, of: FiveBar, **more: Any) -> dict[str, Result]:
    """Return what every law of poses says of a leg, in poses of the leg `of`."""
    theta, w, alpha, F = state(of)
    still = (theta[0], 0.1 * w[0], 1e-4)
    return {
        "inverse": (dynamics.inverse(leg, theta, w, alpha, F, **more),),
        "forward": (dynamics.forward(leg, theta, w, alpha, F, **more),),
        "bias": (dynamics.bias(leg, theta, w, **more),),
        "mass_matrix": (dynamics.mass_matrix(leg, theta, **more),),
        "energy": dynamics.energy(leg, theta, w, **more),
        "reflected_inertia": (dynamics.reflected_inertia(leg, theta, **more),),
        "simulate": dynamics.simulate(leg, *still, 5, **more),
        "integrate": dynamics.integrate(leg, *still[:2], (0.0, 5e-4), **more),
    }


def planned(leg: FiveBar) -> Array:
    """Return the joint angles of an ellipse below a leg's hip, 0.3 s at 1 ms, (N, 4)."""
    foot = kinematics.chain_points(leg, kinematics.home(leg)).F
    path = Ellipse(
        centre=(float(foot[0]), float(foot[1])), radii=(0.012, 0.006), frequency=3.0, ramp=0.1
    )
    return motion.plan(leg, path, 300, H).q


# law


@pytest.mark.parametrize("assembly", [-1, 1])
def test_assembly_that_is_asked_for_is_that_of_a_leg_of_it(assembly: int) -> None:
    own, other = (replace(HEAVY, assembly=sign * assembly) for sign in (1, -1))
    mine = answers(own, own)
    asked = answers(other, own, assembly=assembly)
    for name, values in mine.items():
        for value, same in zip(values, asked[name], strict=True):
            np.testing.assert_array_equal(same, value, err_msg=name)
    theta, *_, F = state(own)
    held = dynamics.statics(other, theta, F, assembly=assembly)
    np.testing.assert_array_equal(held, dynamics.statics(own, theta, F))
    assert np.abs(held - dynamics.statics(other, theta, F)).max() > 0.01


def test_what_is_left_out_is_nothing() -> None:
    theta, w, alpha, _ = state(HEAVY)
    bare = answers(HEAVY, HEAVY)
    told = answers(HEAVY, HEAVY, payload=0.0)
    for name, values in bare.items():
        for value, same in zip(values, told[name], strict=True):
            np.testing.assert_array_equal(value, same, err_msg=name)
    zero = np.zeros(2)
    for law in (dynamics.inverse, dynamics.forward):
        np.testing.assert_array_equal(
            law(HEAVY, theta, w, alpha),
            law(HEAVY, theta, w, alpha, zero, payload=0.0, friction=0.0),
        )
    q = planned(CLASSIC)
    torque = dynamics.step_torques(CLASSIC, q, H)
    np.testing.assert_array_equal(
        torque, dynamics.step_torques(CLASSIC, q, H, zero, payload=0.0, friction=0.0)
    )
    soft = dynamics.soft_loop(CLASSIC, q, H, 0.05)
    np.testing.assert_array_equal(soft, dynamics.soft_loop(CLASSIC, q, H, 0.05, payload=0.0))
    free = dynamics.simulate(HEAVY, theta[0], zero, 1e-4, 5)
    pushed = dynamics.simulate(
        HEAVY, theta[0], zero, 1e-4, 5, lambda t, q, w: zero, foot_force=lambda t, q, w: zero
    )
    np.testing.assert_array_equal(free.theta, pushed.theta)


@pytest.mark.parametrize("payload", [0.3, 1.5])
def test_payload_is_a_point_of_L2s_own_mass(payload: float) -> None:
    """With L6 = 0 the foot is C, on the line of L2, so that the leg's own numbers can carry it."""
    assert PLAIN.mass is not None
    assert PLAIN.com is not None
    assert PLAIN.com_across is not None
    assert PLAIN.inertia is not None
    m = PLAIN.mass[1]
    c = PLAIN.com[1]
    inertia = PLAIN.inertia[1]
    both = m + payload
    apart = PLAIN.L2 - c
    across = PLAIN.com_across[1]
    reduced = m * payload / both
    loaded = replace(
        PLAIN,
        mass=(PLAIN.mass[0], both, *PLAIN.mass[2:]),
        com=(PLAIN.com[0], c + payload * apart / both, *PLAIN.com[2:]),
        com_across=(PLAIN.com_across[0], m * across / both, *PLAIN.com_across[2:]),
        inertia=(
            PLAIN.inertia[0],
            inertia + reduced * (apart**2 + across**2),
            *PLAIN.inertia[2:],
        ),
    )
    carried = answers(PLAIN, PLAIN, payload=payload)
    own = answers(loaded, PLAIN)
    for name, values in own.items():
        for value, same in zip(values, carried[name], strict=True):
            np.testing.assert_allclose(
                same, value, rtol=1e-11, atol=1e-11 * np.abs(value).max(), err_msg=name
            )
    q = planned(PLAIN)
    for ask in (
        lambda leg, P: dynamics.step_torques(leg, q, H, payload=P),
        lambda leg, P: dynamics.soft_loop(leg, q, H, 0.05, payload=P) - q,
    ):
        truth = ask(loaded, 0.0)
        np.testing.assert_allclose(
            ask(PLAIN, payload), truth, rtol=0, atol=1e-9 * np.abs(truth).max()
        )
        assert np.abs(ask(PLAIN, 0.0) - truth).max() > 1e-3 * np.abs(truth).max()


def test_foot_force_of_time_pose_and_rates_is_its_torques_at_the_motors() -> None:
    """The torques J^T F, of a damper on the motors' rates that stiffens with time and angle."""
    theta = kinematics.home(PLAIN)[::2]
    start = (theta, (3.0, -2.0))

    def force(t: float, q: Array, w: Array) -> Array:
        return -(1.0 + 50.0 * t + q[..., :1]) * w

    def torque(t: float, q: Array, w: Array) -> Array:
        return -dynamics.statics(PLAIN, q, force(t, q, w))

    for move in (
        lambda **laws: dynamics.simulate(PLAIN, *start, H, 20, **laws),
        lambda **laws: dynamics.integrate(PLAIN, *start, (0.0, 0.01, 0.02), **laws),
    ):
        pushed = move(foot_force=force).theta
        np.testing.assert_allclose(pushed, move(torque=torque).theta, rtol=0, atol=1e-11)
        assert np.abs(pushed - move().theta).max() > 1e-3


def loop_gap(mj: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Return MuJoCo's gap of the loop (x, z) [m], and its Jacobian, (2, 4)."""
    sites = [mj.site(name).id for name in ("C_left", "C_right")]
    J = np.zeros((2, 3, 4))
    for site, into in zip(sites, J, strict=True):
        mujoco.mj_jacSite(mj, data, into, None, site)
    return (data.site_xpos[sites[0]] - data.site_xpos[sites[1]])[::2], (J[0] - J[1])[::2]


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("leg", [CLASSIC, replace(HEAVY, tilt=0.2)], ids=["classic", "heavy"])
def test_gap_of_a_soft_loop_obeys_its_equation(leg: FiveBar, damping: float) -> None:
    """With MuJoCo's M and site Jacobians: gap_ddot(alpha + h M^-1 D alpha) = -b gap_dot - k gap."""
    q = dynamics.soft_loop(leg, planned(leg), H, damping)
    rate = np.diff(q, axis=0, prepend=q[:1]) / H  # of the step that ends in each row
    k, b = pull(H)
    mj = model.build(leg)
    data = mujoco.MjData(mj)
    M = np.zeros((4, 4))
    D = np.diag([damping, 0.0, damping, 0.0])
    left = []
    parts = []
    for row in range(len(q) - 1):
        v = rate[row]
        alpha = (rate[row + 1] - rate[row]) / H
        data.qpos[:] = q[row]
        data.qvel[:] = v
        mujoco.mj_forward(mj, data)
        mujoco.mj_fullM(mj, data, M)
        gap, slope = loop_gap(mj, data)
        psi, w = ([x[0], x[0] + x[1], x[2], x[2] + x[3]] for x in (q[row], v))
        reach = np.array([-leg.L1, -leg.L2, leg.L4, leg.L3]) * np.square(w)
        spun = reach @ np.stack([np.cos(psi), np.sin(psi)], axis=-1)
        asked = alpha + H * np.linalg.solve(M, D @ alpha)
        parts.append([slope @ asked, spun, b * slope @ v, k * gap])
        left.append(np.sum(parts[-1], axis=0))
    sizes = np.abs(parts).max(axis=(0, 2))
    assert sizes[0] > 0.1  # m/s^2: something is asked of the loop
    assert np.abs(left).max() < 1e-9 * sizes[0]


def test_soft_loop_stays_closer_with_less_damping_and_opens_by_it() -> None:
    q = planned(CLASSIC)
    gaps = []
    for damping in (0.0, 0.01, 0.02):
        p = kinematics.chain_points(CLASSIC, dynamics.soft_loop(CLASSIC, q, H, damping))
        gaps.append(p.C_left - p.C_right)
    once, twice = (np.abs(gap - gaps[0]).max() for gap in gaps[1:])
    assert twice / once == pytest.approx(2.0, rel=0.1)
    assert once > 10.0 * np.abs(gaps[0]).max()


# edge


def test_coarse_break_down_is_where_the_fine_one_is() -> None:
    """Free knees fly until B, C and D are in line, at some time between 10 and 100 ms."""
    theta = kinematics.inverse(CLASSIC, (0.005, -0.078))
    apart = (40.0, -40.0)
    ends = [
        broken(lambda: dynamics.integrate(CLASSIC, theta, apart, (0.0, 1.0), rtol=1e-6, atol=1e-6)),
        broken(lambda: dynamics.simulate(CLASSIC, theta, apart, 1e-3, 1000)),
        broken(lambda: dynamics.simulate(CLASSIC, theta, apart, 2.5e-4, 1000)),
    ]
    assert 0.01 < ends[0] < 0.1
    assert ends[1] == pytest.approx(ends[0], abs=3e-3)
    assert ends[2] == pytest.approx(ends[0], abs=1e-3)


def broken(ask: Callable[[], object]) -> float:
    why = r"(no step is short enough: are B, C and D in line\?|.*turn|.*open|.*in line)"
    with pytest.raises(DivergedError, match=rf"breaks down at t = 0\.0\d+ s: {why}") as info:
        ask()
    return info.value.time


@pytest.mark.parametrize("rates", [(0.55, 0.0), (0.0, -0.55)])
def test_one_motor_of_one_leg_that_turns_too_far_ends_all(rates: tuple[float, float]) -> None:
    """At constant rates, in one step of 1 s; a turn of 0.45 rad is fine."""
    theta = np.tile(kinematics.home(CLASSIC)[::2], (3, 1))
    w = np.zeros((3, 2))

    def steady(t: float, q: Array, w: Array) -> Array:
        return dynamics.bias(CLASSIC, q, w)

    w[1] = rates
    with pytest.raises(DivergedError) as info:
        dynamics.simulate(CLASSIC, theta, w, 1.0, 1, steady)
    assert str(info.value) == (
        "the motion breaks down at t = 0 s: a motor must turn by less than 0.5 rad in a step "
        "at index (1,)"
    )
    fine = dynamics.simulate(CLASSIC, theta, 0.45 / 0.55 * w, 1.0, 1, steady)
    turned = 0.45 / 0.55 * w
    np.testing.assert_allclose(fine.theta[1] - theta, turned, rtol=0, atol=1e-9)


def test_law_without_a_number_at_the_start_ends_the_motion_there() -> None:
    theta = kinematics.home(CLASSIC)[::2]
    nothing = np.full(2, np.nan)
    with pytest.raises(DivergedError, match="down at t = 3 s: torque is not finite") as info:
        dynamics.integrate(CLASSIC, theta, (0.0, 0.0), (3.0, 4.0), lambda t, q, w: nothing)
    assert info.value.time == 3.0


@pytest.mark.parametrize("half", [(np.nan, 0.0), (0.0, np.nan)])
def test_law_with_one_number_that_is_none_ends_the_motion(half: tuple[float, float]) -> None:
    theta = kinematics.home(CLASSIC)[::2]
    for move in (
        lambda **law: dynamics.simulate(CLASSIC, theta, (0.0, 0.0), H, 3, **law),
        lambda **law: dynamics.integrate(CLASSIC, theta, (0.0, 0.0), (0.0, 1.0), **law),
    ):
        for name in ("torque", "foot_force"):
            with pytest.raises(DivergedError, match=f"at t = 0 s: {name} is not finite"):
                move(**{name: lambda t, q, w: half})


# refusal


def test_payload_up_to_the_heaviest_mass_is_taken() -> None:
    theta = kinematics.home(CLASSIC)[::2]
    assert np.isfinite(dynamics.mass_matrix(CLASSIC, theta, payload=HEAVIEST)).all()
    with pytest.raises(ArgumentError, match=r"payload must be in \[0, 1e\+06\] kg, got 1000001\.0"):
        dynamics.mass_matrix(CLASSIC, theta, payload=HEAVIEST + 1.0)


def test_state_of_the_wrong_shape_is_named() -> None:
    pair = (0.0, 0.0)
    triple = (0.0, 0.0, 0.0)
    for name, state in (("theta", (triple, pair)), ("theta_dot", (pair, triple))):
        said = rf"^{name} must have shape \(..., 2\), got \(3,\)"
        with pytest.raises(ArgumentError, match=said):
            dynamics.simulate(CLASSIC, *state, H, 3)
        with pytest.raises(ArgumentError, match=said):
            dynamics.integrate(CLASSIC, *state, (0.0, 1.0))


def test_steps_without_finite_accelerations_are_refused_without_a_warning() -> None:
    rest = kinematics.home(CLASSIC)
    far = np.tile(rest, (3, 1))
    jump = np.tile(rest, (6, 1))
    far[1] = 100.0
    far[2] = 300.0
    jump[3, 1] = 1e200
    for q, h in ((far, 1e-307), (jump, 1e-150)):
        with pytest.raises(ArgumentError, match=f"q must have finite acc.* timestep of {h!r} s"):
            dynamics.step_torques(CLASSIC, q, h)


def test_steps_arguments_are_named_with_their_units() -> None:
    q = np.tile(kinematics.home(CLASSIC), (4, 1))
    one = (1.0, 2.0)
    asks: list[tuple[str, Callable[[], object]]] = [
        (r"foot_force must have shape", lambda: dynamics.step_torques(CLASSIC, q, H, (1.0,))),
        (
            r"foot_force must broadcast with .* = \(3, 2\), got \(4, 2\)$",
            lambda: dynamics.step_torques(CLASSIC, q, H, [one] * 4),
        ),
        (
            r"timestep must be in \(0, inf\) s, got",
            lambda: dynamics.simulate(CLASSIC, q[0, ::2], one, 0.0, 3),
        ),
        (
            r"times must rise",
            lambda: dynamics.integrate(CLASSIC, q[0, ::2], one, (0.0, 2.0, 1.0)),
        ),
        (
            r"friction must be in \[0, inf\) N m, got",
            lambda: dynamics.step_torques(CLASSIC, q, H, friction=-1.0),
        ),
        (
            r"damping must be in \[0, inf\) N m s/rad, got",
            lambda: dynamics.soft_loop(CLASSIC, q, H, -1.0),
        ),
    ]
    for message, ask in asks:
        with pytest.raises(ArgumentError, match=message):
            ask()
    pushed = dynamics.step_torques(CLASSIC, q, H, [one] * 3)
    np.testing.assert_array_equal(pushed, dynamics.step_torques(CLASSIC, q, H, one))


def test_rates_beyond_all_floats_are_a_break_down_and_no_warning() -> None:
    theta = kinematics.inverse(CLASSIC, (0.005, -0.078))
    with pytest.raises(DivergedError, match=r"at t = 0 s: the loop is open .* got nan m"):
        dynamics.simulate(CLASSIC, theta, (1e200, -1e200), 1e-3, 3)


def test_whole_seconds_and_the_ends_of_tolerances() -> None:
    floating = replace(CLASSIC, gravity=(0.0, 0.0))
    theta = kinematics.home(CLASSIC)[::2]
    rest = dynamics.integrate(floating, theta, (0, 0), (0, 1, 2), rtol=1.0, atol=1.0)
    assert rest.time.dtype == np.float64
    np.testing.assert_array_equal(rest.theta, np.tile(theta, (3, 1)))
    asks: list[tuple[dict[str, Any], str]] = [
        ({"rtol": 2.2e-14}, r"rtol must be in \[2\.22045e-14, 1\], got"),
        ({"rtol": 1.1}, r"rtol must be in \[2\.22045e-14, 1\], got"),
        ({"atol": 1.1}, r"atol must be in \[0, 1\] rad, got"),
    ]
    for given, said in asks:
        with pytest.raises(ArgumentError, match=said):
            dynamics.integrate(floating, theta, (0, 0), (0, 1), **given)


@pytest.mark.parametrize("leg", [HEAVY, CLASSIC])
def test_torques_without_weight_and_accelerations_are_those_of_turning(leg: FiveBar) -> None:
    """Bit by bit; of straight links too, which are placed in a shorter way."""
    theta, w, _, _ = state(leg)
    chain = Chain.of(replace(leg, gravity=(0.0, 0.0)), None, 0.01)
    pose = chain.pose(theta[:, 0], theta[:, 1])
    rates = (w[:, 0], w[:, 1], w[:, 0] + 1.0, w[:, 1] - 2.0)
    X12, X43 = chain.turning(pose, chain.moments(pose))
    alone = [X * rates[k] * rates[k] for X, k in ((-X12, 1), (X12, 0), (X43, 3), (-X43, 2))]
    np.testing.assert_array_equal(chain.link_torques(pose, rates, (0.0, 0.0, 0.0, 0.0)), alone)
    for across in (0.0, 0.003):
        x, z = placed(pose.e2, (0.05, np.array(across)))
        np.testing.assert_array_equal(placed(pose.e2, (0.05, across)), (x, z))
    for sideways in (0.0, 0.3):
        whole = dot(pose.e2, (np.array(sideways), -9.81))
        np.testing.assert_array_equal(weigh(pose.e2, (sideways, -9.81)), whole)
