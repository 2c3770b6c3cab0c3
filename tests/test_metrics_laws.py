"""What a run is judged by, of made-up records: windows, shares, branches, paths lost, limits."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from fivebar_sim import kinematics, metrics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import branch, catalogue, energy, ground, guards, load
from fivebar_sim.paths import Gait
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import measure

LEG = FiveBar.load("classic")
ROWS = 1000
H = 1e-3
START = np.array([-2.0, -1.0])
ELLIPSE = Scenario.load("classic-ellipse", ["limits={}", "duration=1.0", "path.ramp=0.25"])
GAIT = "path={kind='gait', centre=[0, -0.07], stride=0.02, lift=0.01, duty=0.7, frequency=3}"
STEPS = Scenario.load("classic-ellipse", ["limits={}", "duration=1.0", GAIT, "path.ramp=0.25"])
ONCE = Scenario.load(
    "classic-ellipse",
    [
        "limits={}",
        "duration=1.0",
        "path={kind='step', start=[0, -0.07], stop=[0.01, -0.07], lift=0.005, seconds=0.5}",
    ],
)
WORDS = ("working_mode", "assembly", "flips", "first_flip")


def a_record(rng: np.random.Generator, rows: int = ROWS) -> dict[str, Array]:
    """Return a record of a leg about its rest pose, and of random torques and tracking errors."""
    q = kinematics.home(LEG) + 0.01 * rng.standard_normal((rows, 4))
    foot, target, torque = rng.standard_normal((3, rows, 2))
    columns = dict(zip(metrics.JOINT_COLUMNS, q.T, strict=True))
    for name, pair in (("foot", foot), ("target", target)):
        columns |= {f"{name}_x": pair[:, 0], f"{name}_z": pair[:, 1]}
    columns |= {"torque_A": torque[:, 0], "torque_E": torque[:, 1]}
    columns |= {f"theta_dot_{joint}": rng.standard_normal(rows) for joint in "ABED"}
    return {"time": H * np.arange(1.0, rows + 1), "gap": rng.uniform(0.0, 1.0, rows), **columns}


def on_floor(record: dict[str, Array], down: Array) -> dict[str, Array]:
    """Return a record of a leg on a rail that is carried in some steps, by 5 N."""
    still = np.zeros(len(down))
    lifted = {"hip_z": 0.07 + still, "hip_dot_z": 0.1 + still}
    carried = {"ground_x": 0.1 * down, "ground_z": 5.0 * down, "rail_end": still}
    return {**record, **lifted, **carried}


def besides(record: dict[str, Array], saturated: Bools | None = None) -> measure.Unrecorded:
    """Return what a run did besides: its constraints are as random as its record."""
    start = np.array([0.1, START[0], 1.5, START[1], -1.5])
    size = 5 if "hip_z" in record else 4
    constraint = np.random.default_rng(3).standard_normal((ROWS, size))
    return measure.Unrecorded(
        steps=energy.Steps(start[-size:], constraint, np.zeros((ROWS, 0))),
        saturated=np.zeros((ROWS, 2), dtype=bool) if saturated is None else saturated,
        unsolved=np.arange(ROWS) == 700,
        warnings=3,
        ranges={"A": (-6.0, 6.0)},
        trunk=-0.006,
    )


def measured(
    scenario: Scenario, record: dict[str, Array], saturated: Bools | None = None
) -> dict[str, Any]:
    return measure.measure(scenario, record, besides(record, saturated)).table


def motors(record: dict[str, Array], name: str) -> Array:
    return np.stack([record[f"{name}_A"], record[f"{name}_E"]], axis=-1)


# law


def test_tracking_is_of_the_window_and_closure_of_the_whole_run(rng: np.random.Generator) -> None:
    record = a_record(rng)
    window = ELLIPSE.window
    assert (window.start, window.stop) == (250, 750)  # a ramp, and one period of 2 Hz
    found = measured(ELLIPSE, record)
    off = [(record[f"foot_{x}"] - record[f"target_{x}"])[window] for x in "xz"]
    assert found["tracking"]["rms"] == pytest.approx(math.sqrt(np.mean(off[0] ** 2 + off[1] ** 2)))
    assert found["tracking"]["max"] == pytest.approx(np.hypot(*off).max(), rel=1e-15)
    gap = record["gap"]
    assert found["closure"] == {
        "rms": pytest.approx(np.linalg.norm(gap) / math.sqrt(ROWS)), "max": gap.max()
    }  # fmt: skip
    assert found["warnings"] == 3
    assert "ground" not in found
    for name in ("foot_x", "foot_z", "target_x", "target_z"):  # outside the window nothing counts
        record[name] = np.where(
            (record["time"] > 0.25) & (record["time"] < 0.7505), record[name], 9
        )
    assert measured(ELLIPSE, record)["tracking"] == found["tracking"]


def test_a_row_may_ask_the_leg_that_ran(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [
        row._replace(function=lambda leg, record, window: leg.size)
        for row in catalogue.MEASURED
        if row.key == "closure.max"
    ]
    monkeypatch.setattr(catalogue, "MEASURED", (*catalogue.MEASURED, *rows))

    assert measured(ELLIPSE, a_record(rng))["closure"]["max"] == ELLIPSE.leg.size


def test_load_is_that_of_the_windows_torques_over_the_turns_of_their_steps(
    rng: np.random.Generator,
) -> None:
    record = a_record(rng)
    torque = motors(record, "torque")
    theta = motors(record, "theta")
    saturated = rng.random((ROWS, 2)) < [0.2, 0.6]
    for scenario, start in ((ELLIPSE, theta[249]), (ONCE, START)):  # before the window's first step
        window = scenario.window
        found = measured(scenario, record, saturated)["load"]
        before = np.concatenate([start[None], theta[window.start : window.stop - 1]])
        work = torque[window] * (theta[window] - before)
        for k, motor in enumerate("AE"):
            assert found["work"][motor]["net"] == pytest.approx(work[:, k].sum())
            assert found["saturated"][motor] == pytest.approx(saturated[window, k].mean())
            assert found["torque_peak"][motor] == np.abs(torque[window, k]).max()
        assert 0.15 < found["saturated"]["A"] < 0.25 < 0.5 < found["saturated"]["E"]
    assert ONCE.window.start == 0


def test_phase_and_stance_are_those_of_when_the_steps_began(rng: np.random.Generator) -> None:
    record = a_record(rng)
    torque = motors(record, "torque")
    theta = motors(record, "theta")
    for scenario in (ELLIPSE, STEPS, ONCE):
        window = scenario.window
        path = scenario.path
        began = H * np.arange(float(window.start), window.stop)
        turned = np.concatenate([START[None], theta])[window.start : window.stop + 1]
        stance = path.in_stance(began) if isinstance(path, Gait) else None
        phase = None if path.period is None else np.round(path.cycle(began), 9) % 1.0
        wanted = load.measure(torque[window], turned, H, stance=stance, phase=phase)
        found = measured(scenario, record)["load"]
        assert found.pop("saturated") == {"A": 0.0, "E": 0.0}
        assert {key: found[key] for key in wanted} == wanted
        assert ("stance" in found, "phase" in found) == (scenario is STEPS, scenario is not ONCE)


def test_a_step_that_begins_at_the_edge_of_two_bins_is_of_the_later_one(
    rng: np.random.Generator,
) -> None:
    """Whole milliseconds in whole numbers: rounding of the phase must not decide."""
    settings = ["limits={}", "duration=1.0", "path.ramp=0.2", "path.frequency=5"]
    scenario = Scenario.load("classic-ellipse", settings)
    record = a_record(rng)
    rows = np.arange(scenario.window.start, scenario.window.stop)
    bins = 5 * (rows - 100) % 1000 * 8 // 1000  # half a ramp late
    torque = record["torque_A"][rows]
    wanted = [np.sqrt(np.mean(torque[bins == k] ** 2)) for k in range(8)]
    found = measured(scenario, record)["load"]["phase"]["torque_rms"]["A"]
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_ground_says_when_the_foot_stood(rng: np.random.Generator) -> None:
    """Where there is a ground its force decides, not the gait's plan."""
    down = (np.arange(ROWS) // 50) % 3 == 0  # the first 50 ms of every 150
    record = on_floor(a_record(rng), down)
    for scenario in (STEPS, ELLIPSE):
        found = measured(scenario, record)
        window = scenario.window
        whole = msgspec.to_builtins(ground.measure(scenario.leg, record, window))
        assert found["ground"] == {**whole, "foot_share": 1.0, "rail_end_max": 0.0}
        torque = motors(record, "torque")[window][down[window]]
        rms = np.sqrt(np.mean(torque**2, axis=0))
        for motor, value in zip("AE", rms.tolist(), strict=True):
            assert found["load"]["stance"]["torque_rms"][motor] == pytest.approx(value)


@pytest.mark.parametrize("scene", ["air", "payload", "rail"])
def test_energy_and_guards_are_those_of_the_whole_run(rng: np.random.Generator, scene: str) -> None:
    """Of the leg with what it carries: the trunk on a rail, the mass at the foot of a payload."""
    scenes = {"air": "kind='air'", "payload": "kind='payload', mass=0.3", "rail": "kind='rail'"}
    mine = {"air": (0.0, 0.0), "payload": (0.3, 0.0), "rail": (0.0, 0.5)}[scene]
    scenario = Scenario.load(
        "classic-ellipse", ["limits={}", "duration=1.0", f"scene={{{scenes[scene]}}}"]
    )
    record = a_record(rng)
    if scene == "rail":
        record = on_floor(record, (np.arange(ROWS) % 2).astype(float))
    saturated = rng.random((ROWS, 2)) < 0.9
    found = measured(scenario, record, saturated)
    more = besides(record, saturated)
    works = energy.balance(energy.Body(LEG, *mine), record, more.steps)
    assert found["energy"] == msgspec.to_builtins(energy.measure(works))
    checked = guards.Evidence(
        scenario.guards,
        LEG,
        record,
        branch.measure(LEG, record),
        saturated,
        works,
        more.unsolved,
        command=1,
        ranges=more.ranges,
        trunk=more.trunk,
    )
    judged = guards.judge(checked)
    assert msgspec.to_builtins(judged) == found["guards"]
    passed = {guard["name"]: guard["ok"] for guard in found["guards"]}
    assert passed["branch"]
    assert not any(passed[name] for name in ("loop", "torque", "energy", "solver"))


def test_flips_are_counted_from_the_legs_own_branch(rng: np.random.Generator) -> None:
    record = a_record(rng)
    found = measured(ELLIPSE, record)["branch"]
    assert [found[word] for word in WORDS] == [[-1, 1], -1, 0, None]
    other = kinematics.home(FiveBar.load("airhockey"))  # the mirror image: all three signs change
    for rows, flips, first in (
        ([700], 2, 0.701),
        ([300, 301], 2, 0.301),
        ([300, 700], 4, 0.301),
        ([0], 2, 0.001),
        ([999], 1, 1.0),
        (range(ROWS), 1, 0.001),
    ):
        spoilt = {name: column.copy() for name, column in record.items()}
        for name, angle in zip(metrics.JOINT_COLUMNS, other, strict=True):
            spoilt[name][list(rows)] = angle
        found = measured(ELLIPSE, spoilt)["branch"]
        assert (found["flips"], found["first_flip"]) == (flips, pytest.approx(first))
        last = ROWS - 1 in rows
        assert (found["working_mode"], found["assembly"]) == (
            ([1, -1], 1) if last else ([-1, 1], -1)
        )
    assert all(type(each) is int for each in (*found["working_mode"], found["assembly"]))


@pytest.mark.parametrize("sign", ["A", "E", "C"])
def test_each_sign_of_the_branch_flips_alone(rng: np.random.Generator, sign: str) -> None:
    mode, assembly = {"A": ((1, 1), -1), "E": ((-1, -1), -1), "C": ((-1, 1), 1)}[sign]
    other = FiveBar(LEG.L1, LEG.L2, LEG.L3, LEG.L4, LEG.L5, mode=mode, assembly=assembly)
    record = a_record(rng)
    for name, angle in zip(metrics.JOINT_COLUMNS, kinematics.home(other), strict=True):
        record[name][400:] = angle
    found = measured(ELLIPSE, record)["branch"]
    assert [found[word] for word in WORDS] == [list(mode), assembly, 1, pytest.approx(0.401)]


# edge


def off_by(errors: list[float]) -> dict[str, Array]:
    """Return the record of a foot that is so many of the leg's sizes off, 3 to 4 in x and z."""
    off = LEG.size * np.array(errors)
    time = np.arange(1.0, len(errors) + 1)
    columns = {"foot_x": 1.0 + 0.6 * off, "foot_z": 2.0 - 0.8 * off}
    still = np.ones(len(errors))
    return {"time": time, "target_x": still, "target_z": 2.0 * still, **columns}


def test_path_is_lost_at_the_legs_size_and_left_at_a_tenth_of_it() -> None:
    for errors, lost, left in (
        ([0.0, 0.0, 0.05, 0.2, 0.9], None, 3.0),
        ([0.0, 0.09, 0.2, 1.1, 0.0, 2.0], 4.0, 2.0),
        ([1.1, 0.0], 1.0, 0.0),
        ([0.99, 0.5], None, 0.0),
        ([0.11, 0.099, 0.3], None, 2.0),
    ):
        record = off_by(errors)
        assert metrics.lost_path(LEG, record) == lost
        by = lost if lost is not None else float(len(errors))
        assert metrics.left_path(LEG, record, by) == left
    zero = np.zeros(2)
    edge = np.array([LEG.size, 0.1 * LEG.size])
    record = {"time": edge, "foot_x": edge, "foot_z": zero, "target_x": zero, "target_z": zero}
    assert metrics.lost_path(LEG, record) is None  # on the edge to the last bit
    assert metrics.left_path(LEG, record, 1.0) == edge[1]
    record = off_by([0.0, 0.0, 0.0])
    assert [metrics.left_path(LEG, record, by) for by in (0.5, 1.0, 2.5)] == [0.0, 1.0, 2.0]


def test_limits_are_kept_from_end_to_end_and_never_by_what_is_undefined() -> None:
    found = {"load": {"work": {"A": {"net": -2.0}}, "share_A": None}, "warnings": 0}
    assert metrics.look_up(found, "load.work.A.net") == -2.0
    assert metrics.look_up(found, "warnings") == 0
    limits = {
        "load.work.A.net": (-2.0, 5.0),
        "warnings": (-math.inf, 0.0),
        "load.share_A": (-math.inf, math.inf),
    }
    judged = metrics.judge(found, limits)
    assert judged == [
        ("load.work.A.net", -2.0, 5.0, -2.0, True),
        ("warnings", -math.inf, 0.0, 0, True),
        ("load.share_A", -math.inf, math.inf, None, False),
    ]
    for low, high, ok in ((-2.5, -2.0, True), (-1.9, 5.0, False), (-5.0, -2.1, False)):
        (limit,) = metrics.judge(found, {"load.work.A.net": (low, high)})
        assert limit.ok is ok


# refusal


@pytest.mark.parametrize(
    ("phase", "message"),
    [
        ([0.5, 1.0], r"phase must be in \[0, 1\), got 1\.0 at index \(1,\)$"),
        ([-1e-9, 0.5], r"phase must be in \[0, 1\), got -1e-09 at index \(0,\)$"),
        (["one", "two"], "phase must be numbers: "),
    ],
)
def test_one_bad_phase_of_many_is_refused(phase: list[Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        load.measure(np.ones((2, 2)), np.ones((3, 2)), H, phase=phase)


def test_largest_torque_is_legal_and_the_float_after_it_is_not() -> None:
    most = load.LARGEST
    still = np.zeros((2, 2))
    assert load.measure([[most, -most]], still, H)["torque_peak"] == {"A": most, "E": most}
    with pytest.raises(ArgumentError, match=r"torque must be in \[-1e\+09, 1e\+09\] N m, got"):
        load.measure([[0.0, np.nextafter(most, np.inf)]], still, H)
