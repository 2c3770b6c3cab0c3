"""Heat: copper losses, temperatures against an integrated model, and servos that do not survive."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fivebar_sim.control.servo import Servo
from fivebar_sim.dynamics import heat
from fivebar_sim.dynamics.heat import Cooling, Winding
from fivebar_sim.errors import ArgumentError

COOLING = Cooling(resistance=34.0, time=92.0, hottest=70.0, ambient=20.0)
WINDING = Winding(kt=0.15, R=3.4, cooling=COOLING)

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


def test_the_heat_of_the_hotter_motor_counts() -> None:
    found = heat.heating(np.array([[0.1, -0.2]]), WINDING)
    other = heat.heating(np.array([[0.2, 0.1]]), WINDING)
    assert found.watts.tolist() == other.watts[::-1].tolist()
    assert found.used == other.used == found.watts[1] / COOLING.allowed


def test_without_load_a_motor_at_its_speed_is_on_the_line() -> None:
    speed = np.array([[40.0, -20.0], [0.0, 10.0]])
    torque = np.array([[0.0, -0.1], [0.2, 0.0]])
    assert heat.line_used(torque, speed, 0.4, 40.0) == pytest.approx([1.0, 0.75])


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
