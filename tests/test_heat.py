"""Heat: copper losses, temperatures against an integrated model, and servos that do not survive."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from sealed import seal

from fivebar_sim import rollout
from fivebar_sim.control.servo import Servo
from fivebar_sim.dynamics import heat
from fivebar_sim.dynamics.heat import Cooling, Winding
from fivebar_sim.errors import ArgumentError, ConfigError, RunDirectoryError
from fivebar_sim.rollout import Result
from fivebar_sim.runs import stored
from fivebar_sim.scenario import Scenario

COOLING = Cooling(resistance=34.0, time=92.0, hottest=70.0, ambient=20.0)
WINDING = Winding(kt=0.15, R=3.4, cooling=COOLING)

AT_REST = (
    *("limits={}", "controller.feedforward=torque", "duration=0.4"),
    "path={kind='step',start=[0,-0.055],stop=[0,-0.055],lift=0,seconds=0.1}",
)
"""The q8bot's leg lifts its foot from nowhere to nowhere, and holds it."""


def holding(mass: float, *settings: str) -> Result:
    """Return the run of a leg that stands still with a mass on its foot [kg]."""
    load = f"scene={{kind='payload',mass={mass}}}"
    return rollout.run(Scenario.load("q8bot-xl330", [*AT_REST, load, *settings]))


# law


@pytest.mark.parametrize(
    ("preset", "volts", "amperes"), [("xl330", 5.0, 1.47), ("hobby-9g", 4.8, 0.65)]
)
def test_a_stalled_servo_heats_with_all_that_its_data_sheet_draws(
    preset: str, volts: float, amperes: float
) -> None:
    servo = Servo.load(preset)
    assert servo.winding is not None
    assert servo.limit is not None
    found = heat.heating(np.full((3, 2), servo.limit), servo.winding)
    assert found.watts == pytest.approx(volts * amperes, rel=1e-5)
    assert found.used is not None
    assert found.used > 1.0


def test_temperature_is_where_the_integrated_one_gets_to(rng: np.random.Generator) -> None:
    """A torque that repeats itself every 0.4 s, fast beside the winding's time constant."""
    torque = rng.uniform(-0.2, 0.2, (4, 2))
    found = heat.heating(torque, WINDING)
    ends = COOLING.resistance * WINDING.R * (torque[:, 0] / WINDING.kt) ** 2

    # Over a step of constant heat the rise decays towards that heat's own, exactly.
    decay = math.exp(-0.1 / COOLING.time)
    rise = 0.0
    for end in np.tile(ends, 5000).tolist():
        rise = end + (rise - end) * decay
    assert found.temperature is not None
    assert rise == pytest.approx(found.temperature[0] - COOLING.ambient, rel=0.01)


@pytest.mark.parametrize("part", [0.5, 1.0, 1.4])
def test_the_time_is_when_the_integrated_one_gets_there(part: float) -> None:
    from scipy.integrate import solve_ivp

    torque = np.array([[0.1, -0.12], [0.1, 0.12]])
    found = heat.heating(torque, WINDING)
    P = WINDING.R * (0.12 / WINDING.kt) ** 2
    goal = part * (COOLING.hottest - COOLING.ambient)

    def rate(t: float, rise: np.ndarray) -> np.ndarray:
        return (P * COOLING.resistance - rise) / COOLING.time

    def there(t: float, rise: np.ndarray) -> float:
        return float(rise[0]) - goal

    setattr(there, "terminal", True)  # noqa: B010
    run = solve_ivp(rate, (0.0, 1e4), [0.0], events=there, rtol=1e-9, atol=1e-9)
    assert found.reaches(part) == pytest.approx(run.t[-1], rel=1e-6)


def test_the_continuous_torque_is_the_largest_that_it_survives() -> None:
    most = WINDING.continuous
    assert most is not None
    just, more = (heat.heating(np.full((2, 2), part * most), WINDING) for part in (1.0, 1.001))
    assert just.continuous == pytest.approx(1.0, rel=1e-12)
    assert just.temperature == pytest.approx(COOLING.hottest, rel=1e-12)
    assert more.reaches(1.0) is not None
    assert just.reaches(1.0 + 1e-12) is None
    # It comes ever nearer to where it goes to, and is never there.
    assert just.used is not None
    assert just.reaches(just.used) is None


def test_the_heat_of_the_hotter_motor_counts() -> None:
    found = heat.heating(np.array([[0.1, -0.2]]), WINDING)
    other = heat.heating(np.array([[0.2, 0.1]]), WINDING)
    assert found.watts.tolist() == other.watts[::-1].tolist()
    assert found.used == other.used == found.watts[1] / COOLING.allowed


def test_a_clipped_motor_is_on_its_line() -> None:
    result = rollout.run(Scenario.load("q8bot-xl330", ["limits={}", "path.frequency=5"]))
    load = result.metrics["load"]
    assert load["saturated"]["A"] > 0.0
    # MuJoCo clips with the angle at a step's start, so the torque of a step that it leaves alone
    # may end beyond by what the spring gains in it.
    servo = result.scenario.servo
    assert servo.limit is not None
    beyond = servo.kp * 1e-3 * max(result.metrics["speed_peak"].values()) / servo.limit
    assert 1.0 - 1e-12 <= max(load["line"].values()) <= 1.0 + beyond


def test_without_load_a_motor_at_its_speed_is_on_the_line() -> None:
    speed = np.array([[40.0, -20.0], [0.0, 10.0]])
    torque = np.array([[0.0, -0.1], [0.2, 0.0]])
    assert heat.line_used(torque, speed, 0.4, 40.0) == pytest.approx([1.0, 0.75])


# runs


def test_a_leg_at_rest_at_89_percent_of_its_stall_does_not_survive() -> None:
    result = holding(1.425)
    servo = result.scenario.servo
    load = result.metrics["load"]
    assert servo.limit is not None
    assert load["torque_rms"]["A"] == pytest.approx(0.89 * servo.limit, rel=0.01)
    assert result.verdict == "fail"

    guard = next(each for each in result.measured.guards if not each.ok)
    assert guard.name == "heat"
    assert guard.value == load["survives"]
    assert guard.time == pytest.approx(23.3, abs=1.0)
    said = "guard heat: for good, this would give a winding more than 100 % of the heat that it"
    assert str(guard).startswith(said)


def test_a_leg_that_rests_at_half_of_that_survives() -> None:
    result = holding(0.5)
    load = result.metrics["load"]
    assert result.verdict == "not judged"
    assert load["survives"] == pytest.approx(max(load["continuous"].values()) ** 2, rel=1e-12)
    assert load["temperature"]["A"] == pytest.approx(25.0 + 34.0 * load["heat"]["A"], rel=1e-12)


def test_what_lasts_is_the_rest_not_the_step_before_it() -> None:
    scenario = Scenario.load("q8bot-xl330", [*AT_REST, "path.lift=0.01"])
    assert scenario.for_good == slice(100, 400)
    result = rollout.run(scenario)
    winding = scenario.servo.winding
    assert winding is not None
    torque = np.stack([result.record["torque_A"], result.record["torque_E"]], axis=-1)
    rest, moving = (
        heat.heating(torque[part], winding).watts for part in (slice(100, 400), scenario.window)
    )
    assert list(result.metrics["load"]["heat"].values()) == pytest.approx(rest, rel=1e-12)
    assert np.abs(moving / rest - 1.0).max() > 0.1
    periodic = Scenario.load("q8bot-xl330")
    assert periodic.for_good == periodic.window


def test_a_hot_day_is_no_day_for_a_servo_that_just_survives() -> None:
    assert holding(0.5, "servo.ambient=60").verdict == "fail"
    assert holding(0.5, "servo.ambient=60", "guards.heat=3").verdict == "not judged"


# edge


def test_a_servo_that_nobody_described_has_no_heat() -> None:
    load = rollout.run(Scenario.load("classic-ellipse", ["duration=0.8"])).metrics["load"]
    assert not {"heat", "temperature", "continuous", "survives", "line"} & load.keys()


def test_a_servo_without_a_cooling_has_watts_alone() -> None:
    settings = ["duration=0.8", "servo.kt=0.5", "servo.resistance=2.0"]
    result = rollout.run(Scenario.load("classic-ellipse", settings))
    load = result.metrics["load"]
    torque = result.record["torque_E"][result.scenario.window]
    assert load["heat"]["E"] == pytest.approx(8.0 * np.mean(torque**2), rel=1e-12)
    assert not {"temperature", "continuous", "survives"} & load.keys()
    assert "heat" not in [guard.name for guard in result.measured.guards]
    assert Winding(0.5, 2.0).continuous is None


# refusal


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"kt": 0.1}, r"kt needs resistance beside it \[ohm\]"),
        ({"resistance": 0.1}, r"resistance needs kt beside it \[N m/A\]"),
        (
            {"kt": 0.1, "resistance": 1.0, "thermal_time": 5.0},
            r"thermal_time needs thermal_resistance beside it \[K/W\]",
        ),
        (
            {"thermal_resistance": 1.0, "thermal_time": 5.0, "temperature_max": 80.0},
            "thermal_resistance needs kt beside it",
        ),
        ({"kt": 0.0, "resistance": 1.0}, r"kt must be in \[1e-06, 1e\+06\] N m/A, got 0.0"),
        ({"kt": 0.1, "resistance": math.nan}, "resistance must be in"),
        ({"ambient": -300.0}, r"ambient must be in \[-273.15, 1e\+06\] deg C, got -300.0"),
        (
            {
                **{"kt": 0.1, "resistance": 1.0, "thermal_resistance": 1.0},
                **{"thermal_time": 5.0, "temperature_max": 25.0},
            },
            r"temperature_max must be in \(25, 1e\+06\) deg C, got 25.0",
        ),
    ],
)
def test_an_incomplete_winding_is_refused(keys: dict[str, float], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Servo(**keys)


@pytest.mark.parametrize(
    ("key", "needs"),
    [
        ("heat.A", "servo.kt and servo.resistance"),
        ("temperature.E", "servo.thermal_resistance and what goes with it"),
        ("continuous.A", "servo.thermal_resistance and what goes with it"),
        ("survives", "servo.thermal_resistance and what goes with it"),
        ("line.E", "servo.speed"),
    ],
)
def test_a_limit_on_what_this_servo_does_not_tell_is_refused(key: str, needs: str) -> None:
    with pytest.raises(ConfigError, match=rf"limits\.load\.{key} needs {needs}: this servo has"):
        Scenario.load("classic-ellipse", [f"limits.load.{key}=1"])
    assert Scenario.load("q8bot-xl330", [f"limits.load.{key}=100"]).limits


def test_a_stored_run_without_the_heat_that_it_limits_is_refused(tmp_path: Path) -> None:
    holding(0.5, "limits.load.survives=1").write(tmp_path / "run")
    file = tmp_path / "run" / "metrics.json"
    assert stored.read(tmp_path / "run").metrics["load"]["survives"] < 1.0
    table = json.loads(file.read_text("utf-8"))
    del table["load"]["survives"]
    file.write_text(json.dumps(table), "utf-8")
    seal(file.parent)
    with pytest.raises(RunDirectoryError, match=r"load.survives is missing: run its scenario"):
        stored.read(tmp_path / "run")
