"""The recording of `fivebar compare`: both legs where the run's record and the log say."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from logged_runs import SENSORS, log_of, ran
from recorded import read

from fivebar_sim import kinematics
from fivebar_sim.errors import ConfigError
from fivebar_sim.overlay import page, recording
from fivebar_sim.overlay.compare import Compared, compare
from fivebar_sim.recording.poses import drawn_rows

SINGLE = float(np.finfo(np.float32).eps)


@functools.cache
def compared() -> Compared:
    """Return a log that is 4 ms late and misses an angle over its run."""
    log = log_of(ran(), *SENSORS, "sensors.delay=0.004")
    theta = log.channels["theta_E"].copy()
    theta[100] = np.nan
    return compare(ran().scenario, log._replace(channels=log.channels | {"theta_E": theta}))


def test_both_legs_move_and_are_plotted_on_one_clock(tmp_path: Path) -> None:
    found = compared()
    recording.write(found, tmp_path / "both.rrd")
    moving, static = read(tmp_path / "both.rrd")

    # The logged leg: the scenario's links at the log's angles, its delay taken out.
    time, theta = found.log.complete("theta_A", "theta_E")
    trail = moving["/log/foot_trail/0"]
    feet = np.array(trail["LineStrips3D:strips"])[:, 0, 1, ::2]
    at = 1e-9 * np.array(trail["sim_time"])
    own = np.abs(found.clock.of_run(time)[:, None] - at).argmin(axis=0)
    np.testing.assert_allclose(found.clock.of_run(time)[own], at, atol=1e-9)
    wanted = kinematics.forward(found.scenario.leg, theta[own])
    np.testing.assert_allclose(feet, wanted, atol=SINGLE)
    assert np.diff(at).min() > 0.005
    assert at[-1] > 0.98 * found.record["time"][-1]
    # The foot hangs on L2, which is where its frame says.
    L1 = moving["/log/hip/L1"]["Transform3D:quaternion"]
    turned = 2.0 * np.arctan2(-np.array(L1)[:, 0, 1], np.array(L1)[:, 0, 3])
    np.testing.assert_allclose(np.cos(turned), np.cos(theta[own, 0]), atol=4.0 * SINGLE)

    ran_feet = np.array(moving["/run/foot_trail/0"]["LineStrips3D:strips"])[:, 0, 1, ::2]
    rows = drawn_rows(found.record["time"])
    np.testing.assert_array_equal(ran_feet[:, 0], found.record["foot_x"][rows].astype(np.float32))
    for leg, count in (("run", len(ran_feet)), ("log", len(feet))):
        assert len(static[f"/{leg}/hip/target_path"]["LineStrips3D:strips"][0][0]) == count

    for kind in ("theta", "torque", "current"):
        lines = [
            np.array([row for row in moving[f"/{place}"]["Scalars:scalars"] if row])
            for place in (f"log/{kind}", f"run/{kind}", f"run/apart_{kind}")
        ]
        np.testing.assert_allclose(lines[0] - lines[1], lines[2], atol=1e-9)
        count = len(found.time) - (kind == "theta")
        assert lines[0].shape == (count, 2)


def test_page_links_the_recording() -> None:
    link = page.link_to(Path("runs/of both.rrd"), Path("pages/overlay.html"))
    assert '<a href="../runs/of%20both.rrd">of both.rrd</a>' in link
    assert link in page.page(compared(), [], [], link)


def test_recordings_end_in_rrd(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"both\.txt: a recording must end in \.rrd"):
        recording.write(compared(), tmp_path / "both.txt")
