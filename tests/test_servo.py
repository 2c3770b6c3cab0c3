"""Servos: the torque that enters the step's momentum, the motor's line, commands as they arrive."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim import model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.control.bus import Bus
from fivebar_sim.control.servo import Drive, MotorStep, Servo, applied_torque, saturated
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.paths import Ellipse
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.steps import Legs

H = 1e-3
LEG = FiveBar()
PATH = Ellipse(centre=(0.0, -0.072), radii=(0.020, 0.008), frequency=2.0, ramp=0.25)
MOTORS = [0, 2]
PRESETS = sorted(resources.shipped("models/servos"))

each_drive = pytest.mark.parametrize("drive", ["position", "torque"])
each_integrator = pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])


def motor(name: str) -> Servo:
    """Return a preset with Coulomb's friction alone; tests/test_friction_load.py has the others."""
    servo = Servo.load(name)
    return msgspec.structs.replace(servo, friction=servo.dry)


each_motor = pytest.mark.parametrize("name", [name for name in PRESETS if name != "ideal"])

PLAIN = Servo(limit=0.05)
LINE = Servo(kp=8.0, kd=0.045, limit=0.05, speed=10.0)
SERVOS = {
    "unlimited": Servo(),
    "plain": PLAIN,
    "plain clipped": Servo(limit=0.0025),
    "line": LINE,
    "line clipped": Servo(kp=8.0, kd=0.045, limit=0.01, speed=2.0),
    "line with friction": Servo(kp=8.0, kd=0.045, limit=0.05, speed=10.0, friction=0.002),
    "clipped with friction": Servo(kp=8.0, kd=0.045, limit=0.01, speed=2.0, friction=0.002),
    "xl330": Servo.load("xl330"),
    "hobby-9g": Servo.load("hobby-9g"),
    "t-motor": Servo.load("t-motor"),
}
CLIPS = {"plain clipped", "line clipped", "clipped with friction"}
"""Seen clipping and not clipping on the ellipse."""


def commands(servo: Servo, drive: Drive) -> tuple[Array, Array]:
    """Return the start pose and commands of 0.3 s: an ellipse of 2 Hz, or torques that swing."""
    wanted = motion.plan(LEG, PATH, 300, H)
    theta = wanted.q[:, MOTORS]
    if drive == "position":
        return wanted.q[0], theta[1:] + servo.damping / servo.kp * np.diff(theta, axis=0) / H
    time = H * np.arange(len(theta) - 1)
    size = 0.02 if servo.limit is None else min(0.02, 1.5 * servo.limit)
    return wanted.q[0], size * np.sin(2 * np.pi * np.stack([3 * time, 4 * time + 0.1], axis=1))


def steps(mj: mujoco.MjModel, start: Array, ctrl: Array) -> tuple[Array, ...]:
    """Return q before each step, q and v after it, and the force that its momentum needs.

    Needed is M (v+ - v) / h + bias - constraint force (gear friction is one), M and bias at the
    start of the step.
    """
    states = Legs(mj, start[None]).advance(ctrl[None])
    q_next, v_next, force = (field[0] for field in (states.qpos, states.qvel, states.constraint))
    q = np.concatenate([start[None], q_next[:-1]])
    v = np.concatenate([np.zeros((1, 4)), v_next[:-1]])
    data = mujoco.MjData(mj)
    M = np.zeros((4, 4))
    needed = np.empty_like(v)
    for k in range(len(v)):
        data.qpos[:] = q[k]
        data.qvel[:] = v[k]
        mujoco.mj_forward(mj, data)
        mujoco.mj_fullM(mj, data, M)
        needed[k] = M @ (v_next[k] - v[k]) / H + data.qfrc_bias - force[k]
    return q, q_next, v_next, needed


@each_drive
@each_integrator
@pytest.mark.parametrize("name", SERVOS)
def test_torque_balances_momentum(name: str, integrator: Integrator, drive: Drive) -> None:
    start, ctrl = commands(servo := SERVOS[name], drive)
    mj = model.build(LEG, servo=servo, timestep=H, integrator=integrator, drive=drive)
    q, q_next, v_next, needed = steps(mj, start, ctrl)
    q, q_next, v_next = (rows[:, MOTORS] for rows in (q, q_next, v_next))
    torque = np.zeros_like(needed)
    step = MotorStep(integrator, ctrl, q, q_next, v_next, drive)
    torque[:, MOTORS] = applied_torque(servo, step)
    # rounding: M v / h and the constraint force, tens of times the torque, cancel in the balance
    np.testing.assert_allclose(needed, torque, rtol=0, atol=1e-9 * np.abs(torque).max())
    clips = saturated(servo, step)
    if name in CLIPS and drive == "position":
        assert 0.01 < clips.mean() < 1.0
    if drive == "torque" and servo.limit is not None and 1.5 * servo.limit < 0.02:
        assert 0.2 < clips.mean() < 0.8


@each_drive
def test_damping_is_what_a_velocity_feedforward_cancels(drive: Drive) -> None:
    zero = np.zeros(2)
    rate = np.array([0.3, -0.2])
    lost = applied_torque(LINE, MotorStep("implicitfast", zero, zero, zero, rate, drive))
    gain = LINE.damping if drive == "position" else LINE.back_emf
    np.testing.assert_allclose(lost, -gain * rate, rtol=1e-12)
    assert (PLAIN.damping, PLAIN.back_emf) == (PLAIN.kd, 0.0)


def lone_motors(servo: Servo, integrator: Integrator, drive: Drive, inertia: float):
    """Return the model of both motors with their cranks alone: no loop, no gravity, no stops."""
    spec = model.leg_spec(LEG, servo=servo, timestep=H, integrator=integrator, drive=drive)
    for gone in [*spec.equalities, *spec.tendons, *spec.sensors, *spec.keys]:
        spec.delete(gone)
    for name in ("L2", "L3"):
        spec.delete(spec.body(name))
    for name in ("A", "E"):
        spec.joint(name).limited = mujoco.mjtLimited.mjLIMITED_FALSE
        spec.joint(name).armature = inertia
    spec.option.gravity = (0.0, 0.0, 0.0)
    return spec.compile()


@each_drive
@each_integrator
@each_motor
def test_free_motor_reaches_its_speed(name: str, integrator: Integrator, drive: Drive) -> None:
    servo = motor(name)
    assert servo.limit is not None
    data = mujoco.MjData(mj := lone_motors(servo, integrator, drive, 1e-4))
    push = servo.limit if drive == "torque" else 1e4 * servo.limit / servo.kp
    data.ctrl[:] = push, -push
    mujoco.mj_step(mj, data, 2000)
    expected = (servo.limit - servo.dry) / servo.back_emf  # speed, less what friction takes
    np.testing.assert_allclose(data.qvel, [expected, -expected], rtol=1e-2)


@each_drive
@each_integrator
@each_motor
def test_stalled_motor_gives_its_limit(name: str, integrator: Integrator, drive: Drive) -> None:
    """Held by an inertia of 1000 kg m^2, the torque is what sets it in motion."""
    servo = motor(name)
    assert servo.limit is not None
    data = mujoco.MjData(mj := lone_motors(servo, integrator, drive, inertia := 1e3))
    push = 2.0 * servo.limit if drive == "torque" else 2.0 * servo.limit / servo.kp
    before = data.qpos.copy()
    data.ctrl[:] = np.array([push, -push]) + (before if drive == "position" else 0.0)
    mujoco.mj_step(mj, data)
    gives = inertia * data.qvel / H + servo.dry * np.sign(data.qvel)
    # the damping acts on the rate after the step, h limit / 1000 kg m^2
    np.testing.assert_allclose(gives, [servo.limit, -servo.limit], rtol=1e-6)
    state = data.ctrl, before, data.qpos, data.qvel
    torque = applied_torque(servo, MotorStep(integrator, *state, drive))
    np.testing.assert_allclose(torque, [servo.limit, -servo.limit], rtol=1e-6)


@each_integrator
def test_friction_holds_what_is_below_it(integrator: Integrator) -> None:
    servo = Servo(limit=1.0, friction=0.01)
    moved = []
    mj = lone_motors(servo, integrator, "torque", 1e-4)
    for torque in (0.009, 0.011):
        data = mujoco.MjData(mj)
        start = data.qpos.copy()
        data.ctrl[:] = torque
        for _ in range(500):
            mujoco.mj_step(mj, data)
        moved.append(np.abs(data.qpos - start).max())
    # 0.5 * (0.001 / 1e-4) * 0.5^2 = 1.25 rad with an excess of 0.001 N m; without, the constraint
    # is soft: (1 - 0.9999) 0.009 / 1e-4 * h for half a second
    assert moved[0] < 1e-5
    assert 1.2 < moved[1] < 1.25


TIMESTEPS = st.sampled_from([2.5e-4, 1e-3, 2e-3])
RATES = st.none() | st.floats(1.0, 500.0)
DELAYS = st.floats(0.0, 0.05)
BUSES = st.builds(Servo, rate=RATES, delay=DELAYS, resolution=st.sampled_from([0.0, 1e-3, 0.3]))


@given(servo=BUSES, timestep=TIMESTEPS, count=st.integers(0, 300))
def test_commands_arrive_late_and_hold(servo: Servo, timestep: float, count: int) -> None:
    row = servo.latched(count, timestep)
    late = math.floor(servo.delay / timestep + 1e-6)
    hold = 1 if servo.rate is None else max(1, round(1.0 / (servo.rate * timestep)))
    assert row.shape == (count,)
    for k in range(count):  # by hand: the last that was sent `late` steps ago or before
        assert row[k] == max(range(0, k - late + 1, hold), default=-1)
    np.testing.assert_array_equal(row, servo.latched(count + 7, timestep)[:count])  # a growing one


def carried(
    servo: Servo, table: Array, rest: Array, timestep: float, drive: Drive = "position"
) -> Array:
    """Return what acts in each step of a command a step, (nsim, N, 2)."""
    bus = Bus([servo] * len(table), drive, timestep=timestep, steps=table.shape[1])
    bus.restart(np.arange(len(table)), rest)
    return bus.send_all(table)


@given(servo=BUSES, timestep=TIMESTEPS, seed=st.integers(0, 99), k=st.integers(0, 79))
def test_what_is_sent_is_causal(servo: Servo, timestep: float, seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    table = rng.standard_normal((3, 80, 2))
    rest = rng.standard_normal((3, 2))
    changed = table.copy()
    changed[:, k] += 1.0
    one = carried(servo, table, rest, timestep)
    other = carried(servo, changed, rest, timestep)
    assert one.shape == table.shape
    np.testing.assert_array_equal(one[:, :k], other[:, :k])
    np.testing.assert_array_equal(one[1], carried(servo, table[1:2], rest[1:2], timestep)[0])
    raw = carried(servo, table, rest, timestep, "torque")
    rounded = (servo.rounded(table), servo.rounded(rest))
    for got, (sent, held) in ((raw, (table, rest)), (one, rounded)):  # torques are not rounded
        new, old = (
            np.stack([held if row < 0 else sent[:, row] for row in rows], axis=1)
            for rows in (servo.latched(80, timestep), servo.latched(80, timestep, 1))
        )
        part = servo.delay / timestep - math.floor(servo.delay / timestep + 1e-6)
        np.testing.assert_allclose(got, new + part * (old - new), atol=1e-5)


@pytest.mark.parametrize("drive", ["position", "torque"])
def test_a_delay_within_a_step_is_no_whole_step(drive: Drive) -> None:
    """A ramp that comes 0.3 steps late is 0.3 steps of it behind."""
    ramp = np.tile(np.arange(9.0)[:, None], (1, 1, 2))
    for delay, behind in [(0.3e-3, 0.3), (2.7e-3, 2.7), (3e-3, 3.0)]:
        got = carried(Servo(delay=delay), ramp, np.zeros((1, 2)), 1e-3, drive)
        np.testing.assert_allclose(got[0, 4:], ramp[0, 4:] - behind, atol=1e-12)


@given(theta=st.floats(-10.0, 10.0), resolution=st.floats(1e-4, 1.0))
def test_rounding_is_to_the_nearest_whole_step(theta: float, resolution: float) -> None:
    servo = Servo(resolution=resolution)
    got = float(servo.rounded(np.array(theta)))
    assert abs(got - theta) <= 0.5 * resolution * (1.0 + 1e-9) + 1e-14
    assert abs(got / resolution - round(got / resolution)) < 1e-9
    assert float(servo.rounded(np.array(got))) == pytest.approx(got, abs=1e-14)


def test_ideal_and_extreme_buses() -> None:
    table = np.random.default_rng(1).standard_normal((1, 5, 2))
    np.testing.assert_array_equal(carried(Servo(), table, np.zeros((1, 2)), H), table)
    np.testing.assert_array_equal(Servo(rate=1.0 / 3e-3).latched(4, 3e-3), [0, 1, 2, 3])
    assert Servo(delay=1e300).latched(3, 1e-300).tolist() == [-1, -1, -1]
    assert Servo(rate=5e-324).latched(3, 1e-3).tolist() == [0, 0, 0]


def test_presets_are_their_data_sheets() -> None:
    xl330, hobby, direct = (Servo.load(name) for name in ("xl330", "hobby-9g", "t-motor"))
    tick = 2 * math.pi / 4096
    figures = [
        (xl330.limit, 0.215),
        (xl330.speed, 383 * 2 * math.pi / 60),
        (xl330.resolution, tick),
        (xl330.kp, 400 / 128 / 885 * 0.215 / tick),
        (hobby.limit, 0.018 * 9.80665),
        (hobby.speed, math.radians(60) / 0.1),
        (hobby.resolution, math.radians(180) * 10 / 2000),
        (hobby.kp, 0.018 * 9.80665 / 0.1),
        (direct.speed, 16 / 0.0954),
        (direct.kp, 1.0 * 16 * 0.0954 / 0.186),
        (direct.damping, 0.015 * 16 * 0.0954 / 0.186 + 0.0954**2 / 0.186),
    ]
    for value, figure in figures:
        assert value == pytest.approx(figure, rel=1e-7)
    assert Servo.load("ideal") == Servo()
    assert PRESETS == ["hobby-9g", "ideal", "t-motor", "xl330", "xl330-m077", "xl330-m288"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"limit": math.nan}, r"limit must be in \(0, inf\) N m, got nan"),
        ({"speed": 40.0}, r"speed needs limit beside it: the stalled motor's torque \[N m\]"),
        ({"limit": 1.0, "speed": -1.0}, r"speed must be in \(0, inf\) rad/s, got -1\.0"),
        ({"limit": 1.0, "speed": math.nan}, "speed must be in"),
        ({"limit": 1e300, "speed": 1e-300}, "limit / speed must be in"),
        ({"friction": -0.1}, r"friction must be in \[0, inf\) N m, got -0\.1"),
        ({"rate": 0.0}, r"rate must be in \(0, inf\) Hz, got 0\.0"),
        ({"delay": -1e-3}, r"delay must be in \[0, inf\) s, got -0\.001"),
        ({"resolution": math.nan}, r"resolution must be in \[0, inf\) rad, got nan"),
        ({"kp": -8.0}, "kp must be in"),
        ({"kd": -0.1}, "kd must be in"),
    ],
)
def test_refusal(keys: dict, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Servo(**keys)


def test_refusal_of_a_bus_faster_than_the_steps() -> None:
    message = (
        r"rate must be in \(0, 1000\] Hz, at most one command a timestep of 0\.001 s, got 2000\.5"
    )
    with pytest.raises(ArgumentError, match=message):
        Servo(rate=2000.5).latched(10, H)
    with pytest.raises(ArgumentError, match=message):
        Servo(rate=2000.5).check_rate(H)
    Servo(rate=1000.0).check_rate(H)
    with pytest.raises(ArgumentError, match="timestep must be in"):
        Servo().latched(10, math.nan)


def test_refusal_of_a_rate_that_would_be_rounded() -> None:
    message = r"rate must be 1 / \(a whole number of timesteps of 0\.001 s\), here 1000 or 500 Hz"
    with pytest.raises(ConfigError, match="servo." + message):
        Scenario.load("classic-ellipse", ["servo.rate=667.0"])
    for rate in (1000.0, 500.0, 333.33333, 50.0, 1e-300):
        Servo(rate=rate).check_whole(H)


def test_refusal_names_file_and_key(tmp_path: Path) -> None:
    for text, message in [
        ("speed = 3.0\n", "speed needs limit"),
        ("kp = nan\n", "kp must be finite"),
        ("limits = 1\n", "unknown key 'limits'.*did you mean 'limit'"),
        ("limit = 'big'\n", "servo.limit must be"),
        ("kp =", "not TOML"),
    ]:
        (path := tmp_path / "mine.toml").write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError, match=f"mine.toml.*{message}"):
            Servo.load(path)
    for name, said in [("xl33", "unknown servo preset 'xl33'"), ("no.toml", "cannot read servo")]:
        with pytest.raises(ConfigError, match=said):
            Servo.load(name)
    with pytest.raises(ArgumentError, match="unknown drive 'speed'; known: position, torque"):
        model.build(LEG, drive="speed")  # pyright: ignore[reportArgumentType]
