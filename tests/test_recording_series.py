"""The plots of a recording: every line is the record's; the load share and its gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded import LEG, Record, drawn, ellipse, read, standing, written

from fivebar_sim.control.servo import Servo
from fivebar_sim.metrics import ground, load
from fivebar_sim.recording import rrd

ANGLES = ["theta_A", "theta_B", "theta_E", "theta_D"]


def lines_of(tmp_path: Path, record: Record, **changes: object) -> dict[str, Record]:
    """Return the lines of every plot of a run, by entity and by name."""
    source = str(changes.pop("source", "classic-ellipse"))
    rrd.write(tmp_path / "a.rrd", [drawn(LEG, record, source, **changes)])
    moving, static = read(tmp_path / "a.rrd")
    drawn_lines = {}
    for entity, columns in static.items():
        if "SeriesLines:names" in columns and all(moving[entity]["Scalars:scalars"]):
            values = np.array(moving[entity]["Scalars:scalars"])
            drawn_lines[entity] = dict(zip(columns["SeriesLines:names"][0], values.T, strict=True))
    return drawn_lines


def check(drawn_lines: dict[str, Record], expected: dict[str, Record]) -> None:
    for entity, lines in expected.items():
        assert list(drawn_lines[entity]) == list(lines)
        for name, values in lines.items():
            np.testing.assert_array_equal(drawn_lines[entity][name], values, err_msg=name)


def test_scalars_are_the_record(tmp_path: Path) -> None:
    r = standing(ellipse(LEG, 300))
    drawn_lines = lines_of(tmp_path, r)
    error = np.hypot(r["foot_x"] - r["target_x"], r["foot_z"] - r["target_z"])
    expected = {
        "/tracking_error": {"error": 1e3 * error},
        "/torque": {"A": 1e3 * r["torque_A"], "E": 1e3 * r["torque_E"]},
        "/gap": {"gap": 1e6 * r["gap"]},
        "/angles": {name: np.degrees(r[name]) for name in [*ANGLES, "ctrl_A", "ctrl_E"]},
        "/ground_force": {"x": r["ground_x"], "z": r["ground_z"]},
        "/foot_height": {"foot": 1e3 * ground.height(LEG, r)},
    }
    check(drawn_lines, expected)
    assert drawn_lines.keys() - expected.keys() == {"/load_share"}


def test_torque_drive_has_its_commands_with_the_torques(tmp_path: Path) -> None:
    r = ellipse(LEG, 60)
    drawn_lines = lines_of(tmp_path, r, source="airhockey-pd", servo=Servo())
    expected = {
        "/torque/ctrl": {"ctrl_A": 1e3 * r["ctrl_A"], "ctrl_E": 1e3 * r["ctrl_E"]},
        "/angles": {name: np.degrees(r[name]) for name in ANGLES},
    }
    check(drawn_lines, expected)
    assert "/torque/limit" not in drawn_lines


@pytest.mark.parametrize("limit", [0.25, None])
def test_limits_of_the_servo_are_level_lines(tmp_path: Path, limit: float | None) -> None:
    drawn_lines = lines_of(tmp_path, ellipse(LEG, 60), servo=Servo(limit=limit))
    if limit is None:
        assert "/torque/limit" not in drawn_lines
    else:
        level = np.full(60, 1e3 * limit)
        check(drawn_lines, {"/torque/limit": {"limit": level, "-limit": -level}})


def test_load_share_is_that_of_a_plain_loop() -> None:
    torque = np.random.default_rng(3).standard_normal((60, 2))
    share, loaded = load.moving_share(torque, 4)
    assert loaded.all()
    for k in range(60):
        A, E = np.abs(torque[max(k - 4, 0) : k + 5]).sum(axis=0)
        np.testing.assert_allclose(share[k], A / (A + E), rtol=1e-13)  # rounding of the running sum


def test_share_has_a_gap_where_there_is_no_load(tmp_path: Path) -> None:
    record = ellipse(LEG, 400)
    largest = max(np.abs(record[column]).max() for column in ("torque_A", "torque_E"))
    for column in ("torque_A", "torque_E"):
        record[column][100:200] = 0.9 * load.TINY * largest
    moving, _ = read(written(tmp_path / "a.rrd", LEG, record))
    empty = [not row for row in moving["/load_share"]["Scalars:scalars"]]
    # the window of 50 ms reaches 25 rows to each side
    np.testing.assert_array_equal(np.flatnonzero(empty), np.arange(125, 175))
