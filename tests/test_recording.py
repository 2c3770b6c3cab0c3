"""The recording read back without a viewer: exact times and scalars, layout, size, errors."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from recorded import COAXIAL, LEG, digest, drawn, ellipse, read, standing, written
from rerun.chunk import RrdReader

from fivebar_sim.recording import rrd


def test_times_are_exact_and_nothing_else_is_a_timeline(tmp_path: Path) -> None:
    # of the first 1,100 multiples of 1 ms the 1025th and others are 1 ns low if truncated
    moving, _ = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 1100)))
    step = np.arange(1, 1101)
    for entity in ("/tracking_error", "/torque", "/load_share", "/gap", "/angles"):
        np.testing.assert_array_equal(moving[entity]["sim_time"], 1_000_000 * step)
        np.testing.assert_array_equal(moving[entity]["step"], step)
    names = {name for columns in moving.values() for name in columns if ":" not in name}
    assert names == {"sim_time", "step"}


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
    for entity in ("/hip/L1", "/hip/L3", "/hip/target", "/foot_trail/0"):
        assert moving[entity]["step"] == [row + 1 for row in rows]
        nanoseconds = [round(1e9 * timestep) * (row + 1) for row in rows]
        assert moving[entity]["sim_time"] == nanoseconds


def layout_of(path: Path) -> tuple[list[str], list[str], dict[str, Any]]:
    """Return origins and contents of a layout's views, and the visible ranges by entity."""
    reader = RrdReader(path)
    (layout,) = reader.blueprints()
    origins: list[str] = []
    contents: list[str] = []
    ranges: dict[str, Any] = {}
    for chunk in reader.stream(store=layout):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            origins += batch["ViewBlueprint:space_origin"].to_pylist()[0]
        if "ViewContents:query" in batch.schema.names:
            contents += batch["ViewContents:query"].to_pylist()[0]
        if "VisibleTimeRanges:ranges" in batch.schema.names:
            entity = chunk.entity_path.split("/overrides")[1].removesuffix("/visualizers")
            ((ranges[entity],),) = batch["VisibleTimeRanges:ranges"].to_pylist()
    return origins, contents, dict(sorted(ranges.items()))


def test_layout_and_identity_come_with_the_file(tmp_path: Path) -> None:
    path = written(tmp_path / "a.rrd", LEG, ellipse(LEG, 50))
    reader = RrdReader(path)
    (data,) = reader.recordings()
    (layout,) = reader.blueprints()
    assert (data.application_id, data.recording_id) == ("fivebar", "round and round")
    assert layout.application_id == "fivebar"
    moving, static = read(path)
    origins, contents, trails = layout_of(path)
    assert sorted(origins) == ["/"] * 6 + ["summary"]
    plots = ("angles", "gap", "load_share", "torque", "tracking_error")
    assert sorted(contents) == sorted(
        ["$origin/**", *(f"/{plot}/**" for plot in plots), "$origin/**"]
    )
    assert {f"/{plot}" for plot in (*plots, "summary")} < static.keys()
    # each band of the trail goes on where the one before ends, from the foot backwards
    assert list(trails) == [f"/foot_trail/{k}" for k in range(6)]
    ends = [(-band["range"]["start"], -band["range"]["end"]) for band in trails.values()]
    assert ends == [(100_000_000 * (k + 1), 100_000_000 * k) for k in range(6)]
    assert {band["timeline"] for band in trails.values()} == {"sim_time"}
    assert static["/"]["ViewCoordinates:xyz"] == [[[3, 5, 1]]]  # right, forward, up
    # no time of writing: what a record gives is the same whenever it is drawn
    assert static["/__properties"] == {"RecordingInfo:name": [["round and round"]]}
    assert len(reader.store().schema().entity_paths()) > len(moving)  # the footer is there


def test_leg_is_a_property_whatever_was_written_before(tmp_path: Path) -> None:
    for leg in (COAXIAL, LEG):  # L5 an int, then a float
        _, static = read(written(tmp_path / "a.rrd", leg, ellipse(leg, 5)))
        (text,) = static["/__properties/leg"]["json"][0]
        assert json.loads(text) == json.loads(json.dumps(asdict(leg)))


@pytest.mark.parametrize("ground", [False, True])
def test_ten_seconds_fit_in_four_megabytes(tmp_path: Path, ground: bool) -> None:
    record = ellipse(LEG, 10_000)
    path = written(tmp_path / "a.rrd", LEG, standing(record) if ground else record)
    assert path.stat().st_size <= 400 * 10_000


def test_equal_runs_have_equal_content(tmp_path: Path) -> None:
    record = ellipse(LEG, 50)
    first, second = (digest(written(tmp_path / name, LEG, record)) for name in ("a.rrd", "b.rrd"))
    assert first == second
    record["gap"][7] = np.nextafter(record["gap"][7], 1.0)
    assert digest(written(tmp_path / "c.rrd", LEG, record)) != first


def test_several_runs_lie_over_each_other(tmp_path: Path) -> None:
    runs = [drawn(LEG, ellipse(LEG, 40)), drawn(COAXIAL, standing(ellipse(COAXIAL, 60, 0.002)))]
    rrd.write(tmp_path / "a.rrd", runs, ["one", "two"])
    moving, static = read(tmp_path / "a.rrd")
    for k, (run, label) in enumerate(zip(runs, ("one", "two"), strict=True), start=1):
        rrd.write(tmp_path / "own.rrd", [run])
        own, still = read(tmp_path / "own.rrd")
        for entity, columns in own.items():
            if entity not in ("/ground_force", "/belt"):  # made for the room of all runs
                assert moving[f"/run_{k}{entity}"] == columns
        assert static[f"/run_{k}/torque"]["SeriesLines:names"] == [[f"{label}: A", f"{label}: E"]]
        assert static[f"/run_{k}/hip/L2/foot"]["Ellipsoids3D:labels"] == [[label]]
        colours = f"/run_{k}/hip/L1", "Capsules3D:colors"
        assert static[colours[0]][colours[1]] != still["/hip/L1"]["Capsules3D:colors"]
    assert (
        static["/run_1/hip/L1"]["Capsules3D:colors"] != static["/run_2/hip/L1"]["Capsules3D:colors"]
    )
    _, contents, trails = layout_of(tmp_path / "a.rrd")
    assert {"/run_1/torque/**", "/run_2/torque/**", "/run_2/foot_height/**"} < set(contents)
    assert {"/run_1/foot_trail/0", "/run_2/foot_trail/5"} < set(trails)
    (text,) = static["/summary"]["TextDocument:text"][0]
    assert "## one: FAIL" in text
    assert "| metric | one | two |" in text


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
    with pytest.raises(rrd.RerunDisabledError, match="got 'off'"):
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
