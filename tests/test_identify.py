"""Numbers that are identified from synthetic logs: the truth lies in the intervals."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from fivebar_sim import FiveBar, Scenario, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.identify import findings, motions, written
from fivebar_sim.identify.fit import Fit, fit
from fivebar_sim.identify.intervals import NORMAL, Spread, newey_west
from fivebar_sim.identify.measured import Measured, check
from fivebar_sim.identify.parameters import DEFAULT, Case, Parameter, parameters, put
from fivebar_sim.identify.predict import predict
from fivebar_sim.identify.validate import explained

COUNT = 2.0 * np.pi / 4096
NOISE = 1e-3
RATE = 200.0
SCENARIO = msgspec.structs.replace(
    Scenario.load(
        "payload-ellipse",
        [
            *(
                "servo=xl330-m288",
                "servo.friction={model='constant', base=0.012, viscous=0.004}",
                "limits={}",
            ),
            *("servo.delay=0.004", "scene.mass=0.15", "sim.timestep=0.0025"),
        ],
    ),
    force=None,
)


class Made(NamedTuple):
    """A synthetic log, and the numbers of the leg that made it."""

    log: Measured
    chosen: list[Parameter]
    truth: Array


def motion(rng: np.random.Generator, seconds: float) -> tuple[Array, Array]:
    """Return sample times and the setpoints of random sines, in counts."""
    time = np.arange(round(seconds * RATE) + 1) / RATE
    ctrl = np.tile(kinematics.home(SCENARIO.leg)[::2], (len(time), 1))
    for column in ctrl.T:
        for frequency in rng.uniform(0.3, 4.0, 6):
            phase = rng.uniform(0.0, 2.0 * np.pi)
            wave = np.sin(2.0 * np.pi * frequency * time + phase)
            column += 0.14 * np.clip(time / 0.5, 0.0, 1.0) * wave
    return time, np.round(ctrl / COUNT) * COUNT


def made(
    seed: int, keys: tuple[str, ...] = (), seconds: float = 2.0, scenario: Scenario = SCENARIO
) -> Made:
    """Return what a leg with random numbers would log."""
    rng = np.random.default_rng(seed)
    chosen = parameters(scenario, keys)
    truth = np.array([_true(rng, each) for each in chosen])
    time, ctrl = motion(rng, seconds)
    still = np.repeat(ctrl[:1], len(time), axis=0)
    case = put(scenario, chosen, truth)
    said = predict([case], [Measured("", time, still, ctrl)], 1)[0][0]
    noisy = said.theta + NOISE * rng.standard_normal(said.theta.shape)
    current = None
    if said.current is not None and "servo.kt" in keys:
        current = np.round((said.current + 2e-3 * rng.standard_normal(noisy.shape)) / 1e-3) * 1e-3
    log = Measured(f"log {seed}", time, np.round(noisy / COUNT) * COUNT, ctrl, current)
    return Made(log, chosen, truth)


def _true(rng: np.random.Generator, each: Parameter) -> float:
    if each.key == "servo.delay":
        return float(rng.uniform(0.0, 8e-3))
    if each.start == 0.0:
        return float(rng.uniform(0.0, 0.5) * each.doubt)
    part = 0.03 if each.key.startswith("leg.L") else 0.25
    return each.start * (1.0 + float(rng.uniform(-part, part)))


def fitted(made: Made, scenario: Scenario = SCENARIO) -> Fit:
    return fit(scenario, made.chosen, [made.log], 1)


def off(made: Made, found: Fit) -> Array:
    """Return how far each number is off, in half-widths of its 95 % interval."""
    return np.abs(found.values - made.truth) / found.half_widths


KEYS = ("leg.L1", "servo.kp", "servo.delay")


@functools.cache
def first() -> tuple[Made, Fit]:
    log = made(1, KEYS, 1.5)
    return log, fitted(log)


def test_numbers_and_delay_of_a_leg_are_found() -> None:
    log, found = first()
    # Outside one half-width is one of 20, outside two one of 10^4.
    assert (off(log, found) < 2.0).all()
    assert abs(found.values[2] - log.truth[2]) < 0.3e-3
    assert (found.half_widths < 0.5 * np.array([each.doubt for each in log.chosen])).all()
    assert findings.untold(found) == []
    assert found.rms[0] < 1.3 * np.hypot(NOISE, COUNT / np.sqrt(12.0))
    assert found.rms[0] < 0.2 * found.rms_before[0]
    other = made(2, KEYS, 1.5)
    before, after = explained(SCENARIO, found, [other.log], 1)[0]
    assert before > 0.0
    assert after > 0.0


def test_intervals_hold_the_truth_95_of_100_times() -> None:
    """500 noises of an encoder on one motion: how they move the numbers, against the intervals.

    That 100 fits move as this linear law says is what the long test shows.
    """
    log, found = first()
    rng = np.random.default_rng(7)
    said = predict([put(SCENARIO, log.chosen, found.values)], [log.log], 1)[0][0].theta
    J = found.jacobian
    move = np.linalg.pinv(J)
    inside = np.zeros(len(KEYS))
    for _ in range(500):
        noisy = np.round((said + NOISE * rng.standard_normal(said.shape)) / COUNT) * COUNT
        r = (noisy - said)[log.log.used].T.ravel() / found.rms[0]
        moved = move @ r
        spread = newey_west(J, r - J @ moved, [len(r) // 2] * 2)
        inside += np.abs(moved) < spread.half_widths
    # 500 trials scatter by 5 of 500.
    assert ((inside > 460) & (inside < 492)).all(), inside


def test_torque_per_current_is_found_where_currents_are_logged() -> None:
    log = made(3, ("servo.kt", "scene.mass", "servo.delay"), 1.2)
    found = fitted(log)
    assert log.log.current is not None
    assert (off(log, found) < 2.0).all()
    assert found.half_widths[0] < 0.05 * log.truth[0]


@pytest.mark.long
def test_the_truth_is_in_95_of_100_intervals() -> None:
    """8 numbers of legs, links off by up to 3 %, delays of 0 to 8 ms: each in 90 to 99 of 100.

    Of 200 logs: of 100 even perfect intervals have one number of eight outside 90 to 99 in one of
    eight tries, of 200 in one of eighty.
    """
    logs = 200
    inside = np.zeros(len(DEFAULT))
    for seed in range(logs):
        log = made(seed, seconds=4.0)
        found = fitted(log)
        inside += off(log, found) < 1.0
        delay = DEFAULT.index("servo.delay")
        assert abs(found.values[delay] - log.truth[delay]) < 0.3e-3
    share = inside / logs
    assert ((share >= 0.90) & (share <= 0.99)).all(), dict(zip(DEFAULT, inside, strict=True))


def plain(J: Array, values: Array | None = None) -> Fit:
    """Return a fit of two lengths with given derivatives and white noise."""
    chosen = parameters(SCENARIO, ["leg.L1", "leg.L4"])
    noise = np.random.default_rng(0).standard_normal(len(J))
    doubt = np.array([each.doubt for each in chosen])
    spread = newey_west(J, noise, [len(J) // 2] * 2)
    spread = spread._replace(covariance=spread.covariance * np.outer(doubt, doubt))
    start = np.array([each.start for each in chosen])
    return Fit(chosen, start if values is None else values, spread, J, [0.0], [0.0], 1)


def test_a_number_that_nothing_depends_on_is_not_exact() -> None:
    """As kt is, of a log without currents: its interval was +- 0."""
    J = np.random.default_rng(1).standard_normal((400, 2)) * np.array([1.0, 0.0])
    found = plain(J)
    assert np.isfinite(found.half_widths[0])
    assert found.half_widths[1] == np.inf
    # The first is a variance over itself: 1 but for the rounding of the processor's BLAS.
    np.testing.assert_allclose(found.correlations, np.eye(2), rtol=1e-14)
    assert findings.remarks(found) == ["", "not identified"]
    assert findings.correlated(found) == []
    assert findings.inflation(found) < 2.0


def test_what_cannot_be_told_apart_is_said() -> None:
    """Two links whose derivatives differ in their sign alone: their sum is not told."""
    first = np.random.default_rng(3).standard_normal((400, 1))
    found = plain(np.concatenate([first, -(1.0 + 1e-9) * first], axis=1))
    (combination,) = findings.untold(found)
    assert combination.words == "0.71 leg.L1 + 0.71 leg.L4"
    assert findings.remarks(found) == ["not identified", "not identified"]
    ((one, other, rho),) = findings.correlated(plain(np.c_[first, first + 0.1 * first[::-1]]))
    assert {one.key, other.key} == {"leg.L1", "leg.L4"}
    assert rho < -0.9
    each = found.parameters[0]
    ends = np.array([each.low, found.parameters[1].start])
    sure = np.random.default_rng(4).standard_normal((400, 2))
    assert findings.remarks(plain(100.0 * sure, ends)) == ["at the end of its range", ""]


def test_a_better_motion_is_found_and_the_result_written(tmp_path: Path) -> None:
    chosen = parameters(SCENARIO, ["leg.L2", "servo.delay"])
    time, ctrl = motion(np.random.default_rng(5), 1.0)
    still = Measured("still", time, ctrl, ctrl)
    values = np.array([0.061, 0.003])
    J = np.random.default_rng(0).standard_normal((402, 2))
    spread = Spread(np.diag([1e-8, 1e-10]), np.full(2, NORMAL))
    found = Fit(chosen, values, spread, J, [1e-3], [1e-2], 1)
    better = motions.suggest(SCENARIO, found, still, 1)
    assert {each.name for each in better} == {"slow", "fast", "mixed", "steps"}
    # A delay is seen in what moves fast.
    widths = {each.name: each.half_widths[1] for each in better}
    assert widths["fast"] < widths["slow"]
    files = written.write(tmp_path / "mine.toml", SCENARIO, found, ["log.csv"])
    assert [file.name for file in files] == ["mine.toml", "mine-leg.toml", "mine-servo.toml"]
    again = Scenario.load(str(tmp_path / "mine.toml"))
    assert (again.leg.L2, again.servo.delay) == (0.061, 0.003)
    assert again.servo.gear == SCENARIO.servo.gear
    other = Scenario.load("classic-ellipse", [f"leg.preset={tmp_path}/mine-leg.toml"])
    assert other.leg.L2 == 0.061
    assert Servo.load(tmp_path / "mine-servo.toml").delay == 0.003
    assert "# leg.L2 = 0.061 +- 0.0002 m, 95 %" in files[0].read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (["leg.L9"], "'leg.L9' cannot be identified; known: leg.L1"),
        (["leg.L1", "leg.L1"], r"leg\.L1 is to be identified twice"),
        (["leg.L6"], r"leg\.L6 must start above 0 to be identified, got 0"),
        (["servo.friction.load"], "do not go together: friction.load has no use in model"),
    ],
)
def test_refusal_of_numbers(keys: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        moved(keys)


def moved(keys: list[str]) -> Case:
    """Return the scenario with some numbers a little off."""
    chosen = parameters(SCENARIO, keys)
    return put(SCENARIO, chosen, np.array([each.start + 0.1 * each.doubt for each in chosen]))


def test_refusal_of_a_floor_and_of_logs_that_tell_nothing() -> None:
    with pytest.raises(ConfigError, match=r"identify needs a leg that hangs.*got 'rail'"):
        parameters(Scenario.load("rail-landing"), [])
    time, ctrl = motion(np.random.default_rng(0), 2.0)
    with pytest.raises(ConfigError, match="commands never change"):
        check(Measured("x", time, ctrl, np.zeros_like(ctrl)), SCENARIO.leg)
    with pytest.raises(ConfigError, match="at least 200 samples, got 100"):
        check(Measured("x", time[:100], ctrl[:100], ctrl[:100]), SCENARIO.leg)
    apart = Measured("x", time, np.tile([np.pi, 0.0], (len(time), 1)), ctrl)
    short = Case(msgspec.structs.replace(SCENARIO, leg=FiveBar(L2=0.05, L3=0.05)), (0.0, 0.0))
    with pytest.raises(ConfigError, match="x: the leg cannot stand as it begins: the loop is open"):
        predict([short], [apart], 1)
