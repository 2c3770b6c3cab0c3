"""The feedback controllers' laws, one command at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from fivebar_controllers.computed_torque import ComputedTorque
from fivebar_controllers.gain_schedule import GainSchedule
from fivebar_controllers.gravity_compensation import GravityCompensation
from fivebar_controllers.impedance import Impedance
from fivebar_controllers.pd import Pd
from hypothesis import given
from hypothesis import strategies as st
from poses import BATCHES, RIGHT, RIGID, sample

from fivebar_sim import control, dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, LoopOpenError, SingularError
from fivebar_sim.files.tables import convert
from fivebar_sim.geometry import FiveBar

NAMES = {
    "pd": Pd,
    "gain_schedule": GainSchedule,
    "computed_torque": ComputedTorque,
    "impedance": Impedance,
    "gravity_compensation": GravityCompensation,
}
Law = Pd | GainSchedule | ComputedTorque | Impedance | GravityCompensation
AIRHOCKEY = FiveBar.load("airhockey")
HOME = kinematics.home(AIRHOCKEY)[::2]
APART = np.array([np.pi, 0.0])
"""The links of the leg RIGHT do not meet there."""
gain = st.floats(0.0, 100.0)


def moving(leg: FiveBar, rng: np.random.Generator, batch: tuple[int, ...]) -> tuple[Any, Any]:
    """Return an observation and a reference a bit away from it, in motion and under a force."""
    foot, theta = sample(leg, batch)

    def draw(size: float) -> Array:
        return rng.uniform(-size, size, (*batch, 2))

    seen = Observation(0.0, theta, draw(3.0))
    wanted = Reference(
        foot + draw(0.005), draw(1.0), draw(10.0), theta + draw(0.1), draw(3.0), draw(30.0),
        draw(2.0), 0.1,
    )  # fmt: skip
    return seen, wanted


def ask(law: Law, leg: FiveBar, seen: Observation, wanted: Reference) -> Array:
    return law.command(leg, Servo(), seen, wanted)


def at_rest(leg: FiveBar, theta: Array, **changes: Any) -> tuple[Observation, Reference]:
    """Return a leg at rest in a pose that it shall keep, but for what is said."""
    zero = np.zeros_like(theta)
    foot = changes.pop("foot", None)
    foot = kinematics.forward(leg, theta) if foot is None else foot
    wanted = Reference(foot, zero, zero, theta, zero, zero, zero, 0.0)._replace(**changes)
    return Observation(0.0, theta, zero), wanted


def slopes(function: Callable[[Array], Array], theta: Array) -> Array:
    """Return d function / d theta_j in column j, by central differences."""
    step = 1e-6
    ends = [(function(theta + e) - function(theta - e)) / (2 * step) for e in step * np.eye(2)]
    return np.stack(ends, axis=-1)


# law


@pytest.mark.parametrize("name", NAMES)
def test_controllers_are_found_and_are_feedback(name: str) -> None:
    assert control.known()[name].load() is NAMES[name]
    law = NAMES[name]()
    assert isinstance(law, control.Feedback)
    assert law.drive == "torque"
    assert NAMES[name](period=0.004).period == 0.004
    assert msgspec.convert(msgspec.to_builtins(law), NAMES[name]) == law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("name", NAMES)
def test_batch_is_one_by_one_to_the_last_bit(
    name: str, batch: tuple[int, ...], rng: np.random.Generator
) -> None:
    law = NAMES[name]()
    seen, wanted = moving(RIGID, rng, batch)
    tau = ask(law, RIGID, seen, wanted)
    assert tau.shape == (*batch, 2)
    assert np.all(np.abs(tau) > 0.0)
    for index in np.ndindex(batch):
        one = Observation(seen.time, seen.theta[index], seen.theta_dot[index])
        alone = Reference(*(field[index] for field in wanted[:-1]), payload=wanted.payload)
        np.testing.assert_array_equal(ask(law, RIGID, one, alone), tau[index])


@given(kp=gain, kd=gain, derivative=st.sampled_from(["measurement", "error"]))
def test_pd_is_linear_in_its_gains(kp: float, kd: float, derivative: Any) -> None:
    angle = np.array([0.3, -0.2])
    rate = np.array([1.5, -4.0])
    wanted = at_rest(RIGID, HOME, foot=np.zeros(2))[1]._replace(theta_dot=np.array([2.0, 7.0]))
    seen = Observation(0.0, HOME - angle, rate)
    tau = ask(Pd(kp=kp, kd=kd, derivative=derivative), RIGID, seen, wanted)
    lag = [0.5, 11.0] if derivative == "error" else [-1.5, 4.0]
    np.testing.assert_allclose(tau, kp * angle + kd * np.array(lag), rtol=0, atol=1e-11)  # rounding


def test_schedule_is_pd_at_both_ends_and_half_way(rng: np.random.Generator) -> None:
    law = GainSchedule(kp_near=90.0, kd_near=2.0, kp_far=10.0, kd_far=1.0, blend=0.1)
    seen, wanted = at_rest(AIRHOCKEY, np.broadcast_to(HOME, (5, 2)))
    seen = seen._replace(theta_dot=rng.uniform(-1.0, 1.0, (5, 2)))
    away = np.array([0.0, 0.025, 0.05, 0.1, 0.7])[:, None] * [0.6, -0.8]
    wanted = wanted._replace(foot=wanted.foot + away, theta=wanted.theta + 0.1)
    tau = ask(law, AIRHOCKEY, seen, wanted)
    s = np.array([0.0, 0.15625, 0.5, 1.0, 1.0])[:, None]  # 0.25^2 (3 - 0.5) = 0.15625
    kp = 90.0 - 80.0 * s
    kd = 2.0 - s
    np.testing.assert_allclose(tau, kp * 0.1 - kd * seen.theta_dot, rtol=0, atol=1e-12)
    near = Pd(kp=90.0, kd=2.0, derivative="error")
    np.testing.assert_array_equal(tau[0], ask(near, AIRHOCKEY, seen, wanted)[0])


def test_schedule_changes_its_gains_without_a_step_or_a_kink() -> None:
    law = GainSchedule(kp_near=1.0, kp_far=0.0, kd_near=0.0, kd_far=0.0, blend=0.1)
    x = np.linspace(0.0, 0.2, 401)
    seen, wanted = at_rest(AIRHOCKEY, np.broadcast_to(HOME, (401, 2)))
    foot = wanted.foot + np.stack([x, np.zeros(401)], axis=-1)
    kp = ask(law, AIRHOCKEY, seen, wanted._replace(foot=foot, theta=wanted.theta + 1.0))[:, 0]
    slope = np.diff(kp) / np.diff(x)
    steps = 0.0005
    assert np.all(slope < 1e-9)
    assert slope.min() == pytest.approx(-15.0, rel=1e-4)  # -3 / (2 blend), half way
    assert np.abs(np.diff(slope)).max() < 1.01 * steps * 600.0  # |kp''| <= 6 / blend^2


def test_computed_torque_on_the_reference_is_the_inverse_dynamics(rng: np.random.Generator) -> None:
    seen, wanted = moving(RIGID, rng, (6,))
    wanted = wanted._replace(theta=seen.theta, theta_dot=seen.theta_dot)
    tau = dynamics.inverse(
        RIGID, seen.theta, seen.theta_dot, wanted.theta_ddot, wanted.force, payload=wanted.payload
    )
    np.testing.assert_allclose(ask(ComputedTorque(), RIGID, seen, wanted), tau, rtol=1e-12)


def test_mass_error_is_that_of_a_heavier_leg(rng: np.random.Generator) -> None:
    """Of links given by their masses, with the rotors', the payload's and their weight."""
    light = FiveBar(
        0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3, mass=(0.01, 0.02, 0.03, 0.04),
        inertia=(1e-5, 2e-5, 3e-5, 4e-5), armature=1e-5,
    )  # fmt: skip
    more: dict[str, Any] = {
        key: tuple(1.2 * x for x in getattr(light, key) or ()) for key in ("mass", "inertia")
    }
    heavy = replace(light, armature=1.2e-5, **more)
    seen, wanted = moving(light, rng, (6,))
    wrong = ask(ComputedTorque(mass_error=0.2), light, seen, wanted)
    right = ask(ComputedTorque(), heavy, seen, wanted._replace(payload=0.12))
    np.testing.assert_allclose(wrong, right, rtol=1e-12)


def test_impedance_does_the_work_of_its_spring(rng: np.random.Generator) -> None:
    """At rest, without weight: tau . d theta = (stiffness (p* - p) - F*) . d foot."""
    leg = replace(RIGID, gravity=(0.0, 0.0))
    theta = sample(leg, ())[1]
    offset = np.array([0.003, -0.002])
    force = np.array([1.0, 2.0])
    foot = kinematics.forward(leg, theta) + offset
    seen, wanted = at_rest(leg, theta, foot=foot, force=force)
    J = slopes(lambda q: kinematics.forward(leg, q), theta)
    law = Impedance(stiffness=(100.0, 300.0), damping=(1.0, 2.0))
    pull = np.array([100.0, 300.0]) * offset - force
    tau = ask(law, leg, seen, wanted)
    np.testing.assert_allclose(tau, J.T @ pull, rtol=1e-8)  # step^2 and eps / step
    rate = rng.uniform(-1.0, 1.0, 2)
    foot_dot = np.array([0.3, -0.4])
    fast = ask(law, leg, seen._replace(theta_dot=rate), wanted._replace(foot_dot=foot_dot))
    damper = np.array([1.0, 2.0]) * (foot_dot - J @ rate)
    np.testing.assert_allclose(fast - tau, J.T @ damper, rtol=1e-7)


@pytest.mark.parametrize("law", [GravityCompensation(), Impedance()])
def test_weight_is_carried_like_the_slope_of_its_energy(law: Law) -> None:
    theta = sample(RIGID, ())[1]
    force = np.array([0.5, -2.0])
    seen, wanted = at_rest(RIGID, theta, force=force, payload=0.2)
    weight = slopes(lambda q: dynamics.energy(RIGID, q, (0.0, 0.0), payload=0.2).potential, theta)
    J = slopes(lambda q: kinematics.forward(RIGID, q), theta)
    tau = ask(law, RIGID, seen, wanted)
    np.testing.assert_allclose(tau, weight - J.T @ force, rtol=1e-7)  # as above
    turning = seen._replace(theta_dot=np.array([2.0, -1.0]))
    drag = ask(GravityCompensation(kd=0.5), RIGID, turning, wanted)
    np.testing.assert_allclose(drag, weight - J.T @ force - [1.0, -0.5], rtol=1e-7)


# edge


def test_angles_that_cannot_close_are_far() -> None:
    there = sample(RIGHT, ())[1]
    theta = np.array([[APART, there], [there, there + 0.1]])
    seen, wanted = at_rest(RIGHT, theta, foot=kinematics.forward(RIGHT, there))
    wanted = wanted._replace(theta=theta + 0.2)
    with pytest.raises(LoopOpenError):
        kinematics.forward(RIGHT, theta)
    law = GainSchedule(blend=0.02)
    tau = ask(law, RIGHT, seen, wanted)
    far = Pd(kp=law.kp_far, kd=law.kd_far)
    near = Pd(kp=law.kp_near, kd=law.kd_near)
    np.testing.assert_array_equal(tau[0, 0], ask(far, RIGHT, seen, wanted)[0, 0])
    np.testing.assert_array_equal(tau[0, 1], ask(near, RIGHT, seen, wanted)[0, 1])
    between = (law.kp_far * 0.2, law.kp_near * 0.2)
    assert np.all((between[0] < tau[1, 1]) & (tau[1, 1] < between[1]))
    one = seen._replace(theta=theta[1, 1], theta_dot=np.zeros(2))
    alone = at_rest(RIGHT, theta[1, 1] + 0.2, foot=wanted.foot)[1]
    np.testing.assert_array_equal(tau[1, 1], ask(law, RIGHT, one, alone))


# refusal


@pytest.mark.parametrize("name", ["computed_torque", "impedance", "gravity_compensation"])
def test_singular_and_open_poses_pass_their_own_error(name: str) -> None:
    line = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)  # B, C and D are in line at (pi, 0)
    for leg, error in ((line, SingularError), (RIGHT, LoopOpenError)):
        seen, wanted = at_rest(leg, APART, foot=np.zeros(2))
        with pytest.raises(error):
            ask(NAMES[name](), leg, seen, wanted)


@pytest.mark.parametrize(
    ("name", "key", "value", "message"),
    [
        ("pd", "kp", -1.0, "kp must be in [0, inf) N m/rad, got -1.0"),
        ("pd", "kd", np.inf, "kd must be in [0, inf) N m s/rad, got inf"),
        ("pd", "period", 0.0, "period must be in (0, inf) s, got 0.0"),
        ("gain_schedule", "kp_near", -1.0, "kp_near must be in [0, inf) N m/rad, got -1.0"),
        ("gain_schedule", "kp_far", np.nan, "kp_far must be in [0, inf) N m/rad, got nan"),
        ("gain_schedule", "kd_near", -1.0, "kd_near must be in [0, inf) N m s/rad, got -1.0"),
        ("gain_schedule", "kd_far", -0.1, "kd_far must be in [0, inf) N m s/rad, got -0.1"),
        ("gain_schedule", "blend", 0.0, "blend must be in (0, inf) m, got 0.0"),
        ("gain_schedule", "period", -1.0, "period must be in (0, inf) s, got -1.0"),
        ("computed_torque", "kp", -1.0, "kp must be in [0, inf) 1/s^2, got -1.0"),
        ("computed_torque", "kd", -1.0, "kd must be in [0, inf) 1/s, got -1.0"),
        ("computed_torque", "mass_error", -1.0, "mass_error must be in (-1, inf), got -1.0"),
        ("computed_torque", "period", 0.0, "period must be in (0, inf) s, got 0.0"),
        ("impedance", "stiffness", (1.0, -1.0), "stiffness[1] must be in [0, inf) N/m, got -1.0"),
        ("impedance", "damping", (np.nan, 1.0), "damping[0] must be in [0, inf) N s/m, got nan"),
        ("impedance", "period", 0.0, "period must be in (0, inf) s, got 0.0"),
        ("gravity_compensation", "kd", -1.0, "kd must be in [0, inf) N m s/rad, got -1.0"),
        ("gravity_compensation", "period", 0.0, "period must be in (0, inf) s, got 0.0"),
    ],
)
def test_bad_gains_are_refused_by_key(name: str, key: str, value: Any, message: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        NAMES[name](**{key: value})
    assert str(caught.value) == message
    with pytest.raises(ConfigError) as said:
        convert({key: value}, NAMES[name], "controller", "mine.toml")
    assert str(said.value) == f"mine.toml: controller.{message}"


def test_pairs_are_pairs_and_words_are_known() -> None:
    with pytest.raises(ArgumentError, match=r"stiffness must be two numbers \(x, z\) \[N/m\], got"):
        Impedance(stiffness=5.0)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ConfigError, match=r"controller\.damping must be an array of length 2"):
        convert({"damping": [1.0]}, Impedance, "controller", "mine.toml")
    with pytest.raises(ConfigError, match=r"controller\.derivative must be one of 'measurement', "):
        convert({"derivative": "rate"}, Pd, "controller", "mine.toml")
