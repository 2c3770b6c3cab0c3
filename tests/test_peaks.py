"""Peaks of window and whole run: what they are, when they occur, and how tables show both."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from judged import judged

from fivebar_sim.arrays import Array
from fivebar_sim.metrics import Limit, peaks
from fivebar_sim.metrics.catalogue import BY_KEY, EVERY, RUN, SHOWN, WINDOW, shown
from fivebar_sim.runs.side_by_side import Row, side_by_side

ROWS = 50
H = 1e-3
MEASURED = slice(20, 40)


def a_record(rng: np.random.Generator) -> dict[str, Array]:
    names = ("torque", "theta_dot")
    columns = {f"{name}_{m}": rng.uniform(-1.0, 1.0, ROWS) for name in names for m in "AE"}
    columns |= {"gap": rng.uniform(0.0, 1.0, ROWS), "ground_x": rng.uniform(-1.0, 1.0, ROWS)}
    columns |= {"ground_z": rng.uniform(0.0, 1.0, ROWS)}
    return {"time": H * np.arange(1.0, ROWS + 1), **columns}


# law


def test_a_spike_before_the_window_is_of_the_whole_run_alone(rng: np.random.Generator) -> None:
    record = a_record(rng)
    calm = peaks.measure(record, MEASURED)
    record["torque_A"][7] = -5.0
    record["theta_dot_A"][7] = 3.0
    record["theta_dot_E"][45] = -6.0
    record["torque_E"][45] = 2.0
    record["gap"][3] = 4.0
    record["ground_x"][9] = -7.0
    record["ground_z"][9] = 8.0
    assert peaks.measure(record, MEASURED) == calm
    whole = msgspec.to_builtins(peaks.measure_whole(record))
    at = whole.pop("at")
    assert whole == {
        "torque_peak": {"A": 5.0, "E": 2.0},
        "speed_peak": {"A": 3.0, "E": 6.0},
        "power_peak": {"A": 15.0, "E": 12.0},
        "gap_peak": 4.0,
        "ground_peak": {"x": 7.0, "z": 8.0},
    }
    assert at == {
        "torque_peak": {"A": 8 * H, "E": 46 * H},
        "speed_peak": {"A": 8 * H, "E": 46 * H},
        "power_peak": {"A": 8 * H, "E": 46 * H},
        "gap_peak": 4 * H,
        "ground_peak": {"x": 10 * H, "z": 10 * H},
    }


def test_peaks_are_those_of_a_plain_loop(rng: np.random.Generator) -> None:
    record = a_record(rng)
    found = peaks.measure(record, MEASURED)
    rows = range(20, 40)
    for motor in "AE":
        torque = record[f"torque_{motor}"]
        speed = record[f"theta_dot_{motor}"]
        assert getattr(found.torque_peak, motor) == max(abs(torque[k]) for k in rows)
        assert getattr(found.speed_peak, motor) == max(abs(speed[k]) for k in rows)
        assert getattr(found.power_peak, motor) == max(abs(torque[k] * speed[k]) for k in rows)
    del record["ground_x"], record["ground_z"]
    assert peaks.measure(record, MEASURED).ground_peak is msgspec.UNSET


def test_keys_of_the_catalogue_lead_to_each_other() -> None:
    for metric in EVERY:
        assert metric.window in (WINDOW, RUN)
        assert SHOWN[metric.key][0].endswith(" (run)") == (metric.window == RUN)
        if metric.whole:
            whole = BY_KEY[metric.whole]
            assert (metric.window, whole.window) == (WINDOW, RUN)
            assert (metric.label, metric.scale, metric.unit) == (
                (whole.label, whole.scale, whole.unit)
            )
            assert whole.at.startswith("whole.at.")
        if metric.same_as:
            assert metric.tolerance is None
            assert BY_KEY[metric.same_as].window == metric.window


# the table


VALUES: dict[str, float | None] = {
    "load.torque_peak.A": 0.1791,
    "torque_peak.A": 0.1791,
    "whole.torque_peak.A": 1.1283,
    "whole.at.torque_peak.A": 0.111,
    "power_peak.E": 0.002,
    "whole.power_peak.E": 9.5,
    "whole.at.power_peak.E": 0.107,
    "energy.imbalance": 2e-6,
    "load.saturated.A": 0.0,
}


def table(*limits: tuple[str, float]) -> list[Row]:
    metrics = judged(VALUES).table
    found = {key: Limit(key, -math.inf, high, 0.0, high > 1.0) for key, high in limits}
    return list(side_by_side(metrics, found))


def named(rows: list[Row], label: str) -> list[Row]:
    return [row for row in rows if row.label == label]


def test_the_whole_runs_peak_stands_beside_the_windows_with_its_time() -> None:
    rows = table()
    assert named(rows, "torque A peak") == [
        Row("torque A peak", "179.1 mN m", "1.128 N m at 0.111 s", "", True)
    ]
    # another unit than the window's is written out
    assert named(rows, "power E peak") == [
        Row("power E peak", "2 mW", "9.5 W at 0.107 s", "", True)
    ]
    assert named(rows, "energy imbalance") == [Row("energy imbalance", "", "0.0002 %", "", True)]
    assert not named(rows, "ground force z")  # no ground
    assert not named(rows, "motor A saturated")
    assert not named(rows, "work A net")


@pytest.mark.parametrize(
    ("limits", "wanted"),
    [
        ([("load.torque_peak.A", 2.0)], [("<= 2 N m", True)]),
        ([("whole.torque_peak.A", 1.0)], [("run <= 1 N m", False)]),
        (
            [("whole.torque_peak.A", 1.0), ("load.torque_peak.A", 2.0)],
            [("<= 2 N m", True), ("<= 1 N m", False)],
        ),
        (
            [("torque_peak.A", 2.0)],  # the same number under another key: a row of its own
            [("", True), ("<= 2 N m", True)],
        ),
    ],
)
def test_a_limit_says_which_of_the_two_it_is_on(
    limits: list[tuple[str, float]], wanted: list[tuple[str, bool]]
) -> None:
    rows = named(table(*limits), "torque A peak")
    assert [(row.limit, row.ok) for row in rows] == wanted
    assert rows[0].window == "179.1 mN m"
    if len(limits) == 2:
        assert (rows[1].window, rows[1].run) == ("", "1.128 N m at 0.111 s")


def test_small_powers_and_speeds_get_smaller_units() -> None:
    assert shown("power_peak.A", 3e-3) == "3 mW"
    assert shown("speed_peak.A", 2e-3) == "2 mrad/s"
