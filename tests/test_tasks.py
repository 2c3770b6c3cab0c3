"""Tasks as pure NumPy: what is seen, rewarded and bounded, when it ends, what is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim import FiveBar, dynamics, kinematics, tasks, workspace
from fivebar_sim.control import Observation
from fivebar_sim.control.servo import Drive, MotorStep, Servo, ServoArrays, applied_torque
from fivebar_sim.errors import ArgumentError, ConfigError, UnreachableError
from fivebar_sim.kinematics.leg_arrays import LegArrays
from fivebar_sim.paths import Circle, Gait, Line
from fivebar_sim.scenario.scenes import Treadmill
from fivebar_sim.tasks import KINDS, REASONS, Randomise, Task
from fivebar_sim.tasks.episodes import Episodes, part_at
from fivebar_sim.tasks.legs import LegGroup, starts
from fivebar_sim.tasks.motion import Motion, motion

LEG = FiveBar.load("extended")  # unequal links, L6 > 0, a tilted base
EVERY = st.sampled_from(sorted(KINDS))


def at(leg: FiveBar, q: Any, q_dot: Any = 0.0, *, broken: bool = False) -> Motion:
    """Return what a leg in the air is doing, (1, ...)."""
    pose = np.atleast_2d(np.asarray(q, dtype=np.float64))
    rate = np.broadcast_to(np.asarray(q_dot, dtype=np.float64), pose.shape)
    return motion(leg, pose, rate, np.zeros((1, 5, 2)), np.array([broken]))


def reason(now: Motion) -> str:
    return str(REASONS[now.reason[0]])


# law


@given(kind=EVERY, rows=st.integers(1, 5))
def test_every_part_of_an_observation_is_where_it_says(kind: str, rows: int) -> None:
    task = tasks.task(kind).resolved()
    targets = np.concatenate(list(task.targets().values()), axis=1)[:rows]
    qpos = np.tile(starts(task)[0], (rows, 1))
    now = motion(task.leg, qpos, 0.1 + 0 * qpos, np.zeros((rows, 5, 2)), np.zeros(rows, bool))
    seen = Observation(0.0, np.full((rows, 2), 7.0), np.full((rows, 2), 8.0))
    observation = task.observation(seen, now, targets)
    ends = np.cumsum([part.size for part in task.parts.values()])
    parts = dict(zip(task.parts, np.split(observation, ends[:-1], axis=1), strict=True))
    assert observation.shape == (rows, ends[-1])
    assert (parts["theta"] == 7.0).all()
    assert (parts["theta_dot"] == 8.0).all()
    np.testing.assert_array_equal(parts["foot"], now.foot)
    np.testing.assert_array_equal(parts["foot_dot"], now.foot_dot)
    if task.GROUNDED:
        np.testing.assert_array_equal(parts["hip_z"][:, 0], qpos[:, 0])
        assert (parts["hip_dot_z"] == 0.1).all()
    for name, value in task.targets().items():
        assert value.shape == (task.periods + 1, task.parts[name].size)
        np.testing.assert_array_equal(parts[name], value[:rows])


@given(theta=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
def test_foot_velocity_is_the_slope_of_the_foot(theta: tuple[float, float]) -> None:
    home = kinematics.home(LEG)[::2] + theta
    step = 1e-6
    rate = np.array([3.0, -2.0])

    def pose(t: float) -> np.ndarray:
        angles = home + t * rate
        return np.stack([angles, kinematics.passive(LEG, angles)]).T.ravel()

    q_dot = (pose(step) - pose(-step)) / (2.0 * step)
    foot = kinematics.forward(LEG, [home - step * rate, home + step * rate])
    slope = (foot[1] - foot[0]) / (2.0 * step)
    now = at(LEG, pose(0.0), q_dot)
    np.testing.assert_allclose(now.foot_dot[0], slope, atol=1e-8)
    np.testing.assert_allclose(now.foot_dot[0], kinematics.jacobian(LEG, home) @ rate, atol=1e-8)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_reward_is_the_weighted_sum_of_its_terms(kind: str) -> None:
    task = tasks.task(kind)
    weights = dict(zip(task.WEIGHTS, (2.0, -3.0, 5.0), strict=False))
    group = LegGroup(tasks.task(kind, weights=weights), [0, 1])
    group.reset([np.random.default_rng(i) for i in range(2)])
    low = group.episodes.low
    high = group.episodes.high
    for part in (0.3, 0.6):
        outcome = group.step(np.tile(low + part * (high - low), (2, 1)))
        assert list(outcome.terms) == list(task.WEIGHTS)
        total = sum(weights[name] * term for name, term in outcome.terms.items())
        np.testing.assert_allclose(outcome.reward, total, rtol=1e-12)
        assert (outcome.terms["effort"] > 0.0).all()


def test_effort_at_rest_is_the_torque_that_holds_the_leg() -> None:
    """The torque truth: static balance from the closed chain, not from the simulation."""
    group = LegGroup(tasks.task("track", spread=0.0), [0])
    outcome = group.reset([np.random.default_rng(0)])
    theta = group.episodes.qpos[0, ::2].copy()
    for _ in range(100):
        outcome = group.step(theta[None])
    held = group.episodes.qpos[0, ::2]
    torque = dynamics.inverse(group.task.leg, held, np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(outcome.terms["effort"], (torque**2).sum(), rtol=1e-3)


@given(seed=st.integers(0, 2**31))
def test_draws_stay_in_their_ranges(seed: int) -> None:
    ranges = Randomise(
        length=(0.9, 1.1), mass=(0.5, 2.0), friction=(0.3, 0.4), kp=(0.7, 0.8), delay=(0.0, 0.01)
    )
    nominal = tasks.task("stand")
    drawn = ranges.drawn(nominal, seed)
    assert drawn == ranges.drawn(nominal, seed)
    assert isinstance(drawn, tasks.Stand)
    for name in ("L1", "L2", "L3", "L4"):
        assert 0.9 <= getattr(drawn.leg, name) / getattr(nominal.leg, name) <= 1.1
    assert drawn.leg.L5 == nominal.leg.L5
    assert 0.5 <= drawn.leg.density / nominal.leg.density <= 2.0
    assert 0.3 <= drawn.friction <= 0.4
    assert 5.6 <= drawn.servo.kp <= 6.4
    assert drawn.servo.kd == nominal.servo.kd
    assert 0.0 < drawn.servo.delay <= 0.01
    assert drawn.path == nominal.foot_path


@pytest.mark.parametrize("leg", ["classic", "q8bot", "minitaur", "doggo"])
def test_rail_of_the_gait_ends_below_every_stance(leg: str) -> None:
    """Where the hip is while the foot is on the belt, and the path can be followed at all."""
    task = tasks.task("gait", leg=leg)
    path = task.foot_path
    assert isinstance(path, Gait)
    time = np.linspace(0.0, 2.0, 2001)
    foot = path.at(time).position
    assert workspace.reachable(task.leg, foot, mode=task.leg.mode).all()
    assert isinstance(task.scene, Treadmill)
    assert task.scene.stop is not None
    stance = task.leg.foot_radius - foot[path.cycle(time) < path.duty, 1]
    assert task.scene.stop < 0.8 * stance.min()


def test_no_ranges_draw_the_leg_itself() -> None:
    nominal = tasks.task("gait", leg="q8bot").resolved()
    assert Randomise().drawn(nominal, 3) == nominal


def test_masses_given_are_drawn_with_their_inertias() -> None:
    leg = FiveBar.load("airhockey")
    drawn = Randomise(mass=(2.0, 2.0)).drawn(tasks.task("track", leg=leg), 0).leg
    for ours, theirs in zip(drawn.links, leg.links, strict=True):
        assert (ours.mass, ours.inertia) == pytest.approx((2.0 * theirs.mass, 2.0 * theirs.inertia))


@given(lengths=st.lists(st.floats(0.05, 0.07), min_size=1, max_size=4))
def test_leg_arrays_move_as_each_alone(lengths: list[float]) -> None:
    legs = [FiveBar(L2=length, L3=length) for length in lengths]
    q = np.stack([kinematics.home(leg) for leg in legs])
    torque = np.zeros((len(legs), 1, 2))
    sound = np.zeros(len(legs), bool)
    together = motion(LegArrays.of(legs), q, 0.5 + q, torque, sound)
    assert not together.reason.any()
    for row, leg in enumerate(legs):
        alone = at(leg, q[row], 0.5 + q[row])
        np.testing.assert_array_equal(together.foot[row], alone.foot[0])
        np.testing.assert_array_equal(together.foot_dot[row], alone.foot_dot[0])


@pytest.mark.parametrize("preset", ["airhockey", "extended"])
def test_equal_legs_move_as_one_leg_for_all(preset: str) -> None:
    """Environments of equal legs have one: not a bit differs from those of many."""
    leg = FiveBar.load(preset)
    q = np.random.default_rng(0).normal(size=(3, 5))
    state = (q, 0.5 + q, np.ones((3, 2, 2)), np.zeros(3, bool))
    together = motion(LegArrays.of([leg] * 3), *state)
    for name, ours, theirs in zip(together._fields, motion(leg, *state), together, strict=True):
        assert ours.tobytes() == theirs.tobytes(), name


@pytest.mark.parametrize("drive", ["position", "torque"])
@pytest.mark.parametrize("speed", [None, 40.0])
def test_servo_arrays_apply_what_each_servo_does(speed: float | None, drive: Drive) -> None:
    servos = [Servo(kp=kp, kd=kd, limit=0.3, speed=speed) for kp, kd in ((2.0, 0.1), (9.0, 0.02))]
    ctrl, q, q_next, v_next = np.random.default_rng(2).normal(size=(4, 2, 4, 2))
    both = ServoArrays.of(servos)
    together = applied_torque(both, MotorStep("discrete", ctrl, q, q_next, v_next, drive))
    for row, servo in enumerate(servos):
        own = (ctrl[row], q[row], q_next[row], v_next[row])
        alone = applied_torque(servo, MotorStep("discrete", *own, drive))
        np.testing.assert_array_equal(together[row], alone)


# edge


def test_reasons() -> None:
    q = kinematics.home(LEG)
    assert reason(at(LEG, q)) == ""
    assert reason(at(LEG, q, broken=True)) == "broken"
    assert reason(at(LEG, q + np.array([0.0, 0.02, 0.0, 0.0]))) == "gap"
    assert reason(at(LEG, q + 2.0 * np.pi * np.array([-1, 0, 0, 0]))) == "limit"


@pytest.mark.parametrize(("short", "expected"), [(0.5e-6, "limit"), (50e-6, "")])
def test_a_leg_at_its_stop_is_at_its_limit(short: float, expected: str) -> None:
    """L2 and L3 almost in line: |BD| = L5 + 2 L1 cos(d) is L2 + L3 less a little."""
    leg = FiveBar(L2=0.05, L3=0.05)
    d = np.arccos((0.1 - short - leg.L5) / (2.0 * leg.L1))
    theta = np.array([d - np.pi, -d])
    q = np.stack([theta, kinematics.passive(leg, theta)]).T.ravel()
    assert reason(at(leg, q)) == expected


@pytest.mark.parametrize("mode", [(-1, -1), (1, 1), (1, -1)])
def test_another_working_mode_is_a_flip(mode: tuple[int, int]) -> None:
    leg = FiveBar()
    foot = kinematics.forward(leg, kinematics.home(leg)[::2])
    theta = kinematics.inverse(leg, foot, mode)
    for assembly in (-1, 1):
        if np.allclose(kinematics.forward(leg, theta, assembly), foot):
            q = np.stack([theta, kinematics.passive(leg, theta, assembly=assembly)]).T.ravel()
            assert reason(at(leg, q)) == "flip"


def test_mirrored_assembly_is_a_flip() -> None:
    leg = FiveBar()
    theta = kinematics.home(leg)[::2]
    knees = kinematics.passive(leg, theta, assembly=-leg.assembly)
    assert reason(at(leg, np.stack([theta, knees]).T.ravel())) == "flip"


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("preset", ["classic", "q8bot", "minitaur", "doggo", "extended"])
def test_every_leg_has_every_task(kind: str, preset: str) -> None:
    poses = starts(tasks.task(kind, leg=preset, duration=0.5, spread=0.001))
    assert np.isfinite(poses).all()


def test_starts_fill_the_disc_from_the_path_outwards() -> None:
    task = tasks.task("track", spread=0.003).resolved()
    feet = kinematics.chain_points(task.leg, starts(task)).F - task.foot_path.at(0.0).position
    away = np.hypot(feet[:, 0], feet[:, 1])
    assert away[0] < 1e-12
    assert away.max() < 0.003
    np.testing.assert_allclose(np.sort(away) ** 2, np.arange(32) / 32 * 0.003**2, atol=1e-12)


def test_a_warning_is_a_break_and_the_state_stays() -> None:
    """MuJoCo stops a simulation that it warns about; its rows repeat, and look sound."""
    task = tasks.task("track").resolved()
    episodes = Episodes(task, [task, task], np.stack([starts(task)] * 2))
    before = episodes.qpos.copy()
    rest = np.repeat(before[:, None], task.every, axis=1)
    episodes.update(rest + 1e-4, 0.0 * rest, np.array([0, 1]))
    assert REASONS[episodes.outcome().reason].tolist() == ["", "broken"]
    np.testing.assert_array_equal(episodes.qpos, before + np.array([[1e-4], [0.0]]))


def test_part_at() -> None:
    parts = tasks.task("track", action="motion").actions
    assert [part_at(parts, i) for i in range(4)] == [
        ("theta", "rad", 0),
        ("theta", "rad", 1),
        ("theta_dot", "rad/s", 0),
        ("theta_dot", "rad/s", 1),
    ]
    with pytest.raises(IndexError):
        part_at(parts, 4)


def test_motion_action_is_a_lead_of_the_servos_lag() -> None:
    def sent(kp: float) -> np.ndarray:
        servo = Servo(kp=kp, kd=0.05)
        task = tasks.task("track", action="motion", servo=servo).resolved()
        episodes = Episodes(task, [task], starts(task)[None])
        return episodes.commands(np.array([[-2.3, -0.8, 4.0, -6.0]]))[0]

    np.testing.assert_allclose(sent(8.0)[0], [-2.3 + 0.025, -0.8 - 0.0375])
    np.testing.assert_allclose(sent(4.0)[-1], [-2.3 + 0.05, -0.8 - 0.075])


# refusal


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("trot", {}, r"unknown task 'trot'; known: gait, hop, stand, track"),
        ("track", {"tarque": 1}, r"unknown option of task 'track' 'tarque'; known: action"),
        ("track", {"action": "speed"}, r"unknown action 'speed'; known: motion, position, torque"),
        ("track", {"action": "torque"}, r"action 'torque' needs a servo with a limit"),
        ("track", {"period": 0.0015}, r"period must be a whole number of timesteps of 0.001 s"),
        ("track", {"servo": Servo(rate=333.0)}, r"servo.rate must be 1 / \(a whole number of "),
        ("track", {"servo": Servo(rate=2e3)}, r"servo.rate must be in \(0, 1000\] Hz, at most one"),
        ("track", {"duration": 0.0012}, r"duration must be a whole number of periods of 0.005"),
        ("track", {"duration": float("nan")}, r"duration must be in \(0, 1000\) s, got nan"),
        ("track", {"span": 4.0}, r"span must be in \(0, 3.14159\) rad, got 4.0"),
        ("track", {"spread": -1.0}, r"spread must be in \[0, 0.1\] m, got -1.0"),
        ("track", {"integrator": "rk4"}, r"unknown integrator 'rk4'"),
        ("track", {"weights": {"speed": 1.0}}, r"unknown reward term 'speed'; known: effort, trac"),
        ("track", {"weights": {"effort": float("inf")}}, r"weights.effort must be in"),
        ("hop", {"mass": 0.0}, r"mass must be in \(0, "),
        ("hop", {"target": -1.0}, r"target must be in \(0, 1\) m, got -1.0"),
    ],
)
def test_refusal_of_a_task(kind: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{message}"):
        tasks.task(kind, **options)


def test_refusal_of_paths() -> None:
    circle = Circle(centre=(0.0, -0.07), radius=0.01, frequency=1.0)
    with pytest.raises(ConfigError, match=r"^the path of task 'gait' must be of kind 'gait', got"):
        tasks.task("gait", path=circle)
    far = Circle(centre=(0.0, -0.09), radius=0.03, frequency=1.0)
    with pytest.raises(UnreachableError, match=r"^path out of reach at t ="):
        starts(tasks.task("track", path=far))
    once = Line(start=(0.0, -0.07), stop=(0.01, -0.07), frequency=1.0)
    assert tasks.task("track", path=once).targets()["phase"].shape == (801, 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mass": (0.0, 1.0)}, r"mass\[0\] must be in \[0.1, 10\], got 0.0"),
        ({"mass": (1.2, 1.0)}, r"mass\[1\] must be in \[1.2, 10\], got 1.0"),
        ({"delay": (0.0, 2.0)}, r"delay\[1\] must be in \[0, 1\] s, got 2.0"),
        ({"kp": 1.0}, r"kp must be two numbers \(low, high\), got 1.0"),
    ],
)
def test_refusal_of_ranges(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{message}"):
        Randomise(**options)


def test_a_task_may_be_changed() -> None:
    changed = tasks.task(tasks.task("track"), period=0.01)
    assert isinstance(changed, Task)
    assert changed.every == 10
    with pytest.raises(ArgumentError, match="period must be a whole number"):
        tasks.task(tasks.task("track"), period=0.0123456)


@pytest.mark.parametrize("key", ["limit", "speed", "resolution"])
def test_refusal_of_servos_that_differ_in_more_than_gains(key: str) -> None:
    keys = {"limit": 0.3, "speed": 40.0, "resolution": 0.01}
    servos = [Servo(**keys), Servo(**{**keys, key: 2.0 * keys[key]})]
    with pytest.raises(ArgumentError, match=rf"^servos of one group must have the same {key}$"):
        ServoArrays.of(servos)


def test_refusal_of_legs_that_differ_in_more_than_lengths() -> None:
    with pytest.raises(ArgumentError, match=r"^legs of one group must have the same foot_radius$"):
        LegArrays.of([FiveBar(), FiveBar(foot_radius=0.007)])
