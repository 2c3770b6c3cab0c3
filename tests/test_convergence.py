"""Convergence: known series, and the same experiment in finer steps."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from fivebar_sim.control import Feedback
from fivebar_sim.errors import ConfigError
from fivebar_sim.runs.extrapolation import Convergence, converge, holds
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.refined import refined


def series(limit: float, error: float, order: float, runs: int = 3) -> list[float]:
    """Return limit + error h^order at h = 1, 1/2, ..."""
    return [limit + error * 0.5 ** (order * n) for n in range(runs)]


# law


@pytest.mark.parametrize("order", [0.6, 1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("runs", [3, 5])
@pytest.mark.parametrize(("limit", "error"), [(2.0, 0.1), (-3.0, 0.5), (1e-3, -2e-4)])
def test_power_of_the_timestep_is_found(
    order: float, runs: int, limit: float, error: float
) -> None:
    found = converge(series(limit, error, order, runs))
    assert found.value == limit + error
    assert found.limit == pytest.approx(limit, rel=1e-9)
    assert found.order == pytest.approx(order, rel=1e-9)
    assert found.error == pytest.approx(abs(error / limit), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ([1.0, 1.1, 1.2], 0.2 / 1.2),  # as far again with every halving
        ([1.0, 1.1, 1.3], 0.3 / 1.3),  # farther and farther
        ([1.0, 1.1, 1.02], 0.1 / 1.02),  # to and fro
        ([1.0, 1.0, 1.3], 0.3 / 1.3),  # nothing changed, then something
        (series(2.0, 0.1, 0.4), None),  # too slowly to say to what
    ],
)
def test_what_does_not_converge_has_no_limit(values: list[float], error: float | None) -> None:
    found = converge(values)
    assert (found.limit, found.order) == (None, None)
    assert found.error == pytest.approx(error or (values[0] - values[2]) / values[2])


def test_what_no_longer_changes_is_its_limit() -> None:
    assert converge([3.0, 3.0, 3.0]) == Convergence(3.0, 3.0, None, 0.0)
    assert converge([0.0, 0.0, 0.0]) == Convergence(0.0, 0.0, None, 0.0)
    assert converge([4.0, 3.0, 3.0]) == Convergence(4.0, 3.0, None, 1.0 / 3.0)
    assert converge([1.5, 1.0, 1.25], tolerance=0.5) == Convergence(1.5, 1.25, None, 0.2)
    assert converge([1.5, 1.0, 1.25], tolerance=0.4).limit is None


def test_undefined_values_and_limits_of_zero() -> None:
    assert converge([None, None, None]) == Convergence(None, None, None, 0.0)
    assert converge([1.0, None, 1.0]) == Convergence(1.0, None, None, None)
    vanishing = converge([4.0, 2.0, 1.0])
    assert vanishing == Convergence(4.0, 0.0, 1.0, None)
    # Infinitely wrong as a part of nothing, and yet next to nothing.
    assert not holds(vanishing, bar=1e9, tolerance=3.9)
    assert holds(vanishing, bar=0.0, tolerance=4.0)
    assert not holds(converge([1.0, None, 1.0]), bar=1e9, tolerance=1e9)


def test_bar_is_met_by_the_error_at_the_coarsest_step() -> None:
    found = converge(series(1.0, 0.03, 1.0))
    assert holds(found, bar=0.0301, tolerance=0.0)
    assert not holds(found, bar=0.0299, tolerance=0.029)
    assert holds(found, bar=0.0, tolerance=0.0301)
    # Without a limit the range counts, and no tolerance of a distance from it.
    spread = converge([1.0, 1.1, 1.02])
    assert holds(spread, bar=0.099, tolerance=0.0)
    assert not holds(spread, bar=0.097, tolerance=1.0)


# the same experiment


@pytest.mark.parametrize("rate", [None, 50.0, 333.3333, 500.0, 1000.0, 1e-9])
@pytest.mark.parametrize("delay", [0.0, 0.002, 0.02, 0.035])
@pytest.mark.parametrize("parts", [2, 4])
def test_commands_act_at_the_same_times(rate: float | None, delay: float, parts: int) -> None:
    """333.3333 Hz are commands every 3 ms in steps of 1 ms, and must be so in steps of 0.5 ms."""
    settings = [f"servo.delay={delay}", "duration=0.8"]
    coarse = Scenario.load("classic-ellipse", settings)
    servo = msgspec.structs.replace(coarse.servo, rate=rate)
    coarse = msgspec.structs.replace(coarse, servo=servo)
    fine = refined(coarse, parts, "discrete")
    h = coarse.sim.timestep
    assert fine.sim.timestep == h / parts
    assert fine.steps == parts * coarse.steps
    acting = coarse.servo.latched(coarse.steps, h)
    # Of `parts` fine steps the first belongs to the coarse one's start; -1 is before any command.
    finely = fine.servo.latched(fine.steps, h / parts)[::parts]
    np.testing.assert_array_equal(finely, np.where(acting < 0, -1, parts * acting))


def test_sensors_controllers_and_windows_keep_their_times() -> None:
    coarse = Scenario.load("classic-pd-sensors", ["sensors.delay=0.0016"])
    fine = refined(coarse, 4, "implicitfast")
    assert fine.sensors == coarse.sensors
    assert fine.sim.seed == coarse.sim.seed
    assert fine.sim.integrator == "implicitfast"
    assert isinstance(fine.controller, Feedback)
    assert fine.controller == coarse.controller
    assert fine.command == 4 * coarse.command
    assert fine.window == slice(4 * coarse.window.start, 4 * coarse.window.stop)


def test_at_h_it_is_the_scenario_itself() -> None:
    for name in ("q8bot-xl330", "classic-pd-sensors"):
        scenario = Scenario.load(name)
        assert refined(scenario, 1, scenario.sim.integrator) == scenario
    # 1.5 ms are one step and a half of 1 ms: what the servo gets is right at every timestep.
    hobby = Scenario.load("hobby-servo-circle")
    assert refined(hobby, 4, "discrete").servo == hobby.servo


def test_too_long_a_run_is_refused() -> None:
    with pytest.raises(ConfigError, match="a run may have 5000000 steps, got 6000000"):
        refined(Scenario.load("classic-ellipse"), 1500, "discrete")
