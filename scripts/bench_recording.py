"""./.venv/bin/python scripts/bench_recording.py: recordings by columns against row by row.

Prints the time and size of the recording of a 10 s run at 1 ms, and of the same data logged row by
row (`rr.log`) into a file; then the time of the recording of a 60 s run. Imports aside.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
import rerun as rr

from fivebar_sim import rollout
from fivebar_sim.recording import leg as scene
from fivebar_sim.recording import rrd
from fivebar_sim.recording.foot import TRAIL
from fivebar_sim.recording.plots import series
from fivebar_sim.recording.poses import drawn_motion, drawn_rows
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario


def by_columns(path: Path, result: Result) -> float:
    """Return the seconds that the recording takes, the best of three."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        rrd.write(path, [result])
        taken.append(time.perf_counter() - start)
    return min(taken)


def row_by_row(path: Path, result: Result) -> float:
    """Return the seconds that the same poses and scalars take with one call a row."""
    leg = result.scenario.leg
    record = result.record
    stamps = record["time"]
    drawn = set(drawn_rows(record["time"]).tolist())
    moved = drawn_motion(record, np.arange(len(stamps)))
    frames = scene.link_frames(leg, moved.q)
    foot = scene.in_space(moved.world_foot)
    target = scene.in_space(moved.target)
    plots = [(plot, np.cumsum(plot.shown) - 1) for plot in series(result.scenario, record)]
    start = time.perf_counter()
    stream = rr.RecordingStream("fivebar-rows", recording_id="rows")
    stream.save(path)

    for k, t in enumerate(stamps):
        stream.set_time("sim_time", duration=float(t))
        stream.set_time("step", sequence=k + 1)
        for plot, row in plots:
            if plot.shown[k]:
                stream.log(plot.path, rr.Scalars(plot.values[row[k]]))
        if k in drawn:
            for name, (origin, angle) in frames.items():
                pose = rr.Transform3D(
                    translation=scene.in_space(origin[k]),
                    quaternion=rr.Quaternion(xyzw=scene.turn(angle[k])),
                )
                stream.log(f"hip/{name}", pose)
            for entity, end in (("hip/target", target), *((b.entity, foot) for b in TRAIL)):
                stream.log(entity, rr.LineStrips3D([np.stack([end[max(k - 10, 0)], end[k]])]))

    stream.disconnect()
    return time.perf_counter() - start


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.rrd"
        short = rollout.run(Scenario.load("classic-ellipse", ["duration=10.0"]))
        rrd.write(path, [short])  # the imports
        columns = by_columns(path, short)
        size = path.stat().st_size
        rows = row_by_row(path.with_name("rows.rrd"), short)
        rows_size = path.with_name("rows.rrd").stat().st_size
        long = rollout.run(Scenario.load("classic-ellipse", ["duration=60.0"]))
        minute = by_columns(path, long)
        print(f"10 s run: {columns:.3f} s, {size / 1e6:.2f} MB (bar: 4 MB)")
        print(f"row by row: {rows:.2f} s, {rows_size / 1e6:.2f} MB")
        print(f"ratio {rows / columns:.0f} (bar: 30)")
        print(f"60 s run: {minute:.3f} s (bar: 1 s), {path.stat().st_size / 1e6:.1f} MB")
