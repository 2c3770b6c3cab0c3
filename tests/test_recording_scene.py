"""The leg of a recording: every link where, as long and as thick as the record and the leg say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from recorded import LEG, ellipse, read, standing, written

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array

SINGLE = float(np.finfo(np.float32).eps)


def turned(quaternions: list[Any], vector: tuple[float, float, float]) -> Array:
    """Return a vector turned by quaternions (x, y, z, w), as v + 2 u x (u x v + w v)."""
    quaternion = np.array(quaternions, dtype=np.float64).reshape(-1, 4)
    u = quaternion[:, :3]
    w = quaternion[:, 3:]
    return np.array(vector) + 2.0 * np.cross(u, np.cross(u, vector) + w * np.array(vector))


def test_links_are_where_the_record_says(tmp_path: Path) -> None:
    record = ellipse(LEG, 101)
    moving, static = read(written(tmp_path / "a.rrd", LEG, record))
    q = np.stack([record[f"theta_{joint}"] for joint in "ABED"], axis=-1)[::10]
    p = kinematics.chain_points(LEG, q)
    A, E = kinematics.bases(LEG)
    ends = {"L1": (A, p.B), "L2": (p.B, p.C_left), "L3": (p.D, p.C_right), "L4": (E, p.D)}
    for name, (inner, outer) in ends.items():
        pose = moving[f"/hip/{name}"]
        bar = static[f"/hip/{name}"]
        origin = np.array(pose["Transform3D:translation"])[:, 0]
        # a capsule lies along z of its own frame; that frame is turned within the link's
        along = turned(bar["Capsules3D:quaternions"][0], (0.0, 0.0, 1.0))
        local = along[0] * bar["Capsules3D:lengths"][0][0]
        tip = origin + turned(pose["Transform3D:quaternion"], tuple(local))
        for drawn, point in ((origin, inner), (tip, outer)):
            # positions of 0.1 m and unit quaternions are each rounded to single precision
            np.testing.assert_allclose(drawn[:, [0, 2]] - point, 0.0, atol=SINGLE)
            np.testing.assert_allclose(drawn[:, 1], 0.0, atol=SINGLE)
        across = turned(pose["Transform3D:quaternion"], (0.0, 1.0, 0.0))
        np.testing.assert_allclose(across, np.broadcast_to((0.0, 1.0, 0.0), across.shape), atol=0)


def test_foot_target_and_trail_are_where_the_record_says(tmp_path: Path) -> None:
    record = ellipse(LEG, 101)
    moving, static = read(written(tmp_path / "a.rrd", LEG, record))
    foot = np.stack([record["foot_x"], record["foot_z"]], axis=-1)[::10]
    target = np.stack([record["target_x"], record["target_z"]], axis=-1)
    L2 = moving["/hip/L2"]
    ball = static["/hip/L2/foot"]
    offset = tuple(ball["Ellipsoids3D:centers"][0][0])
    drawn = np.array(L2["Transform3D:translation"])[:, 0] + turned(
        L2["Transform3D:quaternion"], offset
    )
    np.testing.assert_allclose(drawn[:, [0, 2]], foot, rtol=0, atol=SINGLE)
    needle = np.array(moving["/hip/target"]["LineStrips3D:strips"])[:, 0]
    np.testing.assert_allclose(needle.mean(axis=1)[:, [0, 2]], target[::10], rtol=0, atol=SINGLE)
    path = np.array(static["/hip/target_path"]["LineStrips3D:strips"][0][0])
    np.testing.assert_array_equal(path[:, [0, 2]], target.astype(np.float32))
    trail = np.array(moving["/foot_trail/0"]["LineStrips3D:strips"])[:, 0]
    np.testing.assert_array_equal(trail[:, 1, [0, 2]], foot.astype(np.float32))
    np.testing.assert_array_equal(trail[1:, 0], trail[:-1, 1])


def test_links_are_as_long_and_thick_as_the_leg(tmp_path: Path) -> None:
    _, static = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 5)))
    lengths = {"L1": [LEG.L1], "L2": [LEG.L2, LEG.L6], "L3": [LEG.L3], "L4": [LEG.L4]}
    for name, length in (lengths | {"L5": [LEG.L5]}).items():
        drawn = static[f"/hip/{name}"]["Capsules3D:lengths"]
        np.testing.assert_array_equal(drawn[0], np.array(length, dtype=np.float32))
    for name in lengths:
        assert static[f"/hip/{name}"]["Capsules3D:radii"] == [[np.float32(LEG.radius)]]
    # the extension starts at C and ends at the foot
    L2 = static["/hip/L2"]
    foot = static["/hip/L2/foot"]
    start = np.array(L2["Capsules3D:translations"][0][1])
    along = turned(L2["Capsules3D:quaternions"][0][1], (0.0, 0.0, 1.0))[0]
    F = start + LEG.L6 * along - foot["Ellipsoids3D:centers"][0][0]
    np.testing.assert_allclose(F[[0, 2]], 0.0, atol=SINGLE * LEG.L2)
    assert foot["Ellipsoids3D:half_sizes"] == [[[np.float32(LEG.foot_radius)] * 3]]


def test_ground_is_where_the_record_says(tmp_path: Path) -> None:
    record = standing(ellipse(LEG, 401))
    moving, static = read(written(tmp_path / "a.rrd", LEG, record))
    rows = slice(None, None, 10)
    lift = record["hip_z"][::10]
    hip = np.array(moving["/hip"]["Transform3D:translation"])[:, 0]
    np.testing.assert_array_equal(hip[:, [0, 1]], 0.0)
    np.testing.assert_array_equal(hip[:, 2], lift.astype(np.float32))
    trail = np.array(moving["/foot_trail/0"]["LineStrips3D:strips"])[:, 0, 1]
    np.testing.assert_allclose(trail[:, 2], record["foot_z"][rows] + lift, rtol=0, atol=SINGLE)
    # one arrow where the foot is down, none elsewhere; all to one scale
    down = record["ground_z"][rows] > 0.0
    arrows = moving["/ground_force"]
    assert [len(row) for row in arrows["Arrows3D:vectors"]] == down.astype(int).tolist()
    vectors = np.array([row[0] for row in arrows["Arrows3D:vectors"] if row])
    force = np.stack([record["ground_x"], record["ground_z"]], axis=-1)[rows][down]
    scale = 0.5 * LEG.size / np.hypot(*force.T).max()
    np.testing.assert_allclose(vectors[:, [0, 2]], scale * force, rtol=2 * SINGLE, atol=SINGLE**2)
    origins = np.array([row[0] for row in arrows["Arrows3D:origins"] if row])
    contact = (record["foot_z"][rows] + lift - LEG.foot_radius)[down]
    np.testing.assert_allclose(origins[:, 2], contact, rtol=0, atol=SINGLE)
    floor = static["/floor"]
    (centre,) = floor["Boxes3D:centers"][0]
    (half,) = floor["Boxes3D:half_sizes"][0]
    assert centre[2] + half[2] == 0.0
    assert centre[0] - half[0] < trail[:, 0].min() < trail[:, 0].max() < centre[0] + half[0]


def test_stripes_run_with_the_belt_and_stay_on_the_floor(tmp_path: Path) -> None:
    record = standing(ellipse(LEG, 2001))
    moving, static = read(written(tmp_path / "a.rrd", LEG, record))
    (stripes,) = static["/belt"]["LineStrips3D:strips"]
    x = np.array(stripes)[:, 0, 0]
    (gap,) = np.unique(np.round(np.diff(x), 6))
    shift = np.array(moving["/belt"]["Transform3D:translation"])[:, 0, 0]
    turns = (shift - record["belt_x"][::10]) / np.diff(x).mean()
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-4)  # single precision of x and shift
    assert 0.0 <= shift.min() < shift.max() <= gap + 1e-6
    (centre,), (half,) = (
        static["/floor"][f"Boxes3D:{part}"][0] for part in ("centers", "half_sizes")
    )
    assert x.min() >= centre[0] - half[0] - 1e-6
    assert x.max() + gap <= centre[0] + half[0] + 1e-6


def test_in_the_air_there_is_no_ground(tmp_path: Path) -> None:
    moving, static = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 30)))
    names = set(moving) | set(static)
    assert not names & {"/floor", "/belt", "/ground_force", "/foot_height"}
    assert "/hip" not in moving
