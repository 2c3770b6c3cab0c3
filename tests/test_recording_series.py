"""The plots and the text of a recording: the load share, its gaps, the metrics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from recorded import LEG, METRICS, ellipse, read, written

from fivebar_sim.recording_series import SHARE_FLOOR, load_share, summary


def test_load_share_is_that_of_a_plain_loop() -> None:
    torque = np.random.default_rng(3).standard_normal((60, 2))
    share, loaded = load_share(torque, 4)
    assert loaded.all()
    for k in range(60):
        A, E = np.abs(torque[max(k - 4, 0) : k + 5]).sum(axis=0)
        np.testing.assert_allclose(share[k], A / (A + E), rtol=1e-13)  # rounding of the running sum


def test_share_has_a_gap_where_there_is_no_load(tmp_path: Path) -> None:
    record = ellipse(LEG, 400)
    for column in ("torque_A", "torque_E"):
        record[column][100:200] = 0.9 * SHARE_FLOOR
    moving, _ = read(written(tmp_path / "a.rrd", LEG, record))
    empty = [not row for row in moving["/load_share"]["Scalars:scalars"]]
    # the window of 50 ms reaches 25 rows to each side
    np.testing.assert_array_equal(np.flatnonzero(empty), np.arange(125, 175))


def test_summary_shows_plain_numbers_and_the_provenance_last(tmp_path: Path) -> None:
    lines = summary(METRICS, "trot").splitlines()
    assert lines == [
        "# trot",
        "",
        "**PASS**",
        "",
        "| metric (SI) | value |",
        "|:--|--:|",
        "| tracking.rms | 1.2346e-07 |",
        "| tracking.max | 3e-07 |",
        "| branch.working_mode | -1, 1 |",
        "| branch.flips | 0 |",
        "| warnings | none |",
        "",
        "*versions.mujoco 3.17, seed 0*",
    ]
    assert "| a \\| b |" in summary({"note": "a | b\n"}, "trot")
    _, static = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 5)))
    assert static["/summary"]["TextDocument:text"] == [[summary(METRICS, "round and round")]]
