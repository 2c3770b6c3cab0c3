"""The recording read back without a viewer: exact times and scalars, layout, size, errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from recorded import COAXIAL, LEG, ellipse, read, written
from rerun.chunk import RrdReader

from fivebar_sim import recording
from fivebar_sim.errors import FiveBarError


def test_times_are_exact_and_nothing_else_is_a_timeline(tmp_path: Path) -> None:
    # of the first 1,100 multiples of 1 ms the 1025th and others are 1 ns low if truncated
    moving, _ = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 1100)))
    step = np.arange(1, 1101)
    for entity in ("/tracking_error", "/torque", "/load_share", "/gap", "/angles"):
        np.testing.assert_array_equal(moving[entity]["sim_time"], 1_000_000 * step)
        np.testing.assert_array_equal(moving[entity]["step"], step)
    names = {name for columns in moving.values() for name in columns if ":" not in name}
    assert names == {"sim_time", "step"}


def test_scalars_are_the_record(tmp_path: Path) -> None:
    r = ellipse(LEG, 300)
    moving, static = read(written(tmp_path / "a.rrd", LEG, r))
    angles = ["theta_A", "theta_B", "theta_E", "theta_D", "ctrl_A", "ctrl_E"]
    expected = {
        "/tracking_error": {
            "error": 1e3 * np.hypot(r["foot_x"] - r["target_x"], r["foot_z"] - r["target_z"])
        },
        "/torque": {"A": 1e3 * r["torque_A"], "E": 1e3 * r["torque_E"]},
        "/gap": {"gap": 1e6 * r["gap"]},
        "/angles": {name: np.degrees(r[name]) for name in angles},
    }
    for entity, lines in expected.items():
        assert static[entity]["SeriesLines:names"] == [list(lines)]
        scalars = np.array(moving[entity]["Scalars:scalars"])
        np.testing.assert_array_equal(scalars, np.stack(list(lines.values()), axis=-1))


@pytest.mark.parametrize(
    ("steps", "timestep", "rows"),
    [
        (25, 0.001, [0, 10, 20, 24]),
        (21, 0.001, [0, 10, 20]),
        (1, 0.001, [0]),
        (90, 0.00025, [0, 40, 80, 89]),
        (3, 0.02, [0, 1, 2]),
    ],
)
def test_poses_are_thinned_and_end_with_the_last(
    tmp_path: Path, steps: int, timestep: float, rows: list[int]
) -> None:
    moving, _ = read(written(tmp_path / "a.rrd", COAXIAL, ellipse(COAXIAL, steps, timestep)))
    for entity in ("/hip/L1", "/hip/L3", "/hip/target", "/hip/foot_trail"):
        assert moving[entity]["step"] == [row + 1 for row in rows]
        nanoseconds = [round(1e9 * timestep) * (row + 1) for row in rows]
        assert moving[entity]["sim_time"] == nanoseconds


def test_layout_and_identity_come_with_the_file(tmp_path: Path) -> None:
    path = written(tmp_path / "a.rrd", LEG, ellipse(LEG, 50))
    reader = RrdReader(path)
    (data,), (layout,) = reader.recordings(), reader.blueprints()
    assert (data.application_id, data.recording_id) == ("fivebar", "round and round")
    assert layout.application_id == "fivebar"
    moving, static = read(path)
    views: list[str] = []
    trail = None
    for chunk in reader.stream(store=layout):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            views += batch["ViewBlueprint:space_origin"].to_pylist()[0]
        if chunk.entity_path.endswith("/overrides/hip/foot_trail/visualizers"):
            ((trail,),) = batch["VisibleTimeRanges:ranges"].to_pylist()
    shown = ["/", "angles", "gap", "load_share", "summary", "torque", "tracking_error"]
    assert sorted(views) == shown
    assert trail == {"timeline": "sim_time", "range": {"start": -500_000_000, "end": 0}}
    assert {f"/{view}" for view in shown[1:]} < static.keys()
    assert static["/"]["ViewCoordinates:xyz"] == [[[3, 5, 1]]]  # right, forward, up
    # no time of writing: what a record gives is the same whenever it is drawn
    assert static["/__properties"] == {"RecordingInfo:name": [["round and round"]]}
    assert len(reader.store().schema().entity_paths()) > len(moving)  # the footer is there


def test_leg_is_a_property_whatever_was_written_before(tmp_path: Path) -> None:
    for leg in (COAXIAL, LEG):  # L5 an int, then a float
        _, static = read(written(tmp_path / "a.rrd", leg, ellipse(leg, 5)))
        (text,) = static["/__properties/leg"]["json"][0]
        assert json.loads(text) == json.loads(json.dumps(asdict(leg)))


def test_ten_seconds_fit_in_four_megabytes(tmp_path: Path) -> None:
    path = written(tmp_path / "a.rrd", LEG, ellipse(LEG, 10_000))
    assert path.stat().st_size <= 400 * 10_000


def test_rerun_is_imported_only_to_write() -> None:
    code = "import sys, fivebar_sim.recording; print('rerun' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_mistakes_raise_and_leave_rerun_as_it_was(tmp_path: Path) -> None:
    record = ellipse(LEG, 50)
    record["gap"] = record["gap"][:-1]
    with pytest.raises(ValueError, match="length"):
        written(tmp_path / "a.rrd", LEG, record)
    assert not (tmp_path / "a.rrd").exists()
    written(tmp_path / "a.rrd", LEG, ellipse(LEG, 50))
    assert not rr.strict_mode()


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts threads as Linux does")
def test_writing_leaves_no_thread_behind(tmp_path: Path) -> None:
    record = ellipse(LEG, 50)
    threads = []
    for _ in range(4):
        written(tmp_path / "a.rrd", LEG, record)
        threads.append(len(list(Path("/proc/self/task").iterdir())))
    assert threads[1:] == threads[:1] * 3


def test_two_at_a_time_stay_apart(tmp_path: Path) -> None:
    record = ellipse(LEG, 1000)

    def gaps(rows: int) -> list[float]:
        part = {column: values[:rows] for column, values in record.items()}
        moving, _ = read(written(tmp_path / f"{rows}.rrd", LEG, part))
        return [gap for (gap,) in moving["/gap"]["Scalars:scalars"]]

    with ThreadPoolExecutor(2) as pool:
        for rows, drawn in zip((1000, 900, 800), pool.map(gaps, (1000, 900, 800)), strict=True):
            np.testing.assert_array_equal(drawn, 1e6 * record["gap"][:rows])
    assert not rr.strict_mode()


def test_rerun_switched_off_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(recording.RerunDisabledError, match="got 'off'"):
        written(tmp_path / "a.rrd", LEG, ellipse(LEG, 5))


def test_unwritable_file_is_an_os_error(tmp_path: Path) -> None:
    record = ellipse(LEG, 50)
    with pytest.raises(FileNotFoundError):
        written(tmp_path / "nowhere" / "a.rrd", LEG, record)
    with pytest.raises(IsADirectoryError):
        written(tmp_path, LEG, record)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="only Linux has a disk always full")
def test_full_disk_is_an_os_error() -> None:
    with pytest.raises(OSError, match="No space left"):
        written(Path("/dev/full"), LEG, ellipse(LEG, 50))


def test_viewer_is_the_binary_and_binds_the_loopback(tmp_path: Path) -> None:
    command = recording.viewer_command(tmp_path / "a.rrd")
    assert command[-1] == str((tmp_path / "a.rrd").resolve())
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    shown = subprocess.run([command[0], "--help"], capture_output=True, text=True, check=True)
    for flag in (word for word in command if word.startswith("--")):
        assert flag in shown.stdout


def test_missing_viewer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(recording.ViewerMissingError, match="rerun_cli") as caught:
        recording.viewer_command(Path("a.rrd"))
    assert isinstance(caught.value, FiveBarError)
    assert isinstance(caught.value, FileNotFoundError)
