"""Load sharing: symmetries, sums, a plain loop, the energy of a simulated leg, cases by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import load

H = 0.5
"""Timestep [s] of what is not simulated; its multiples are exact."""

ONE = [[1.0, 1.0]]
TWO = [[0.0, 0.0], [1.0, 1.0]]
SHARES = ("share_A", "thermal_share_A", "peak_ratio", "rms_ratio")

Window = tuple[Array, Array]
"""Torques (N, 2) and angles (N + 1, 2); whole numbers, so that sums are exact in any order."""


@st.composite
def windows(draw: st.DrawFn, least: int = 1) -> Window:
    rows = draw(st.integers(least, 12))
    whole = st.tuples(st.integers(-9, 9), st.integers(-9, 9))
    torque = draw(st.lists(whole, min_size=rows, max_size=rows))
    theta = draw(st.lists(whole, min_size=rows + 1, max_size=rows + 1))
    return np.array(torque, dtype=float), np.array(theta, dtype=float)


def leaves(measured: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, number or None) of a nested dictionary."""
    if isinstance(measured, dict):
        for key, value in measured.items():
            yield from leaves(value, f"{name}.{key}" if name else key)
    else:
        yield name, measured


def swapped(measured: dict[str, Any]) -> dict[str, Any]:
    """Return what the same window measures when A and E change places."""
    other = measured | {
        key: {"A": measured[key]["E"], "E": measured[key]["A"]}
        for key in ("torque_rms", "torque_peak", "work")
    }
    for key in ("share_A", "thermal_share_A"):
        other[key] = None if measured[key] is None else 1.0 - measured[key]
    return other


def same(found: Any, wanted: Any) -> None:
    """Assert equal keys, None in the same places, and numbers equal but for rounding."""
    one = dict(leaves(found))
    two = dict(leaves(wanted))
    assert one.keys() == two.keys()
    for key, value in one.items():
        assert type(value) in (float, type(None)), key
        near = None if two[key] is None else pytest.approx(two[key], rel=1e-14, abs=1e-15)
        assert value == near, key


# law


@given(windows(), st.integers(-900, 25), st.booleans())
def test_shares_have_no_unit(window: Window, power: int, mirrored: bool) -> None:
    torque, theta = window
    scale = 2.0**power * (-1.0 if mirrored else 1.0)
    once = load.measure(torque, theta, H)
    more = load.measure(scale * torque, theta, H)
    assert [more[key] for key in SHARES] == [once[key] for key in SHARES]
    assert more["opposing"].pop("energy") == abs(scale) * once["opposing"].pop("energy")
    assert more["opposing"] == once["opposing"]
    assert more["torque_rms"] == {motor: abs(scale) * once["torque_rms"][motor] for motor in "AE"}
    turn = "negative" if mirrored else "positive"
    for motor in "AE":
        assert more["work"][motor]["positive"] == scale * once["work"][motor][turn]


@given(windows())
def test_nothing_prefers_a_motor(window: Window) -> None:
    torque, theta = window
    same(load.measure(torque[:, ::-1], theta[:, ::-1], H), swapped(load.measure(*window, H)))
    same(load.measure(-torque, -theta, H), load.measure(*window, H))


@given(windows(least=2), st.data())
def test_work_adds_over_split_windows(window: Window, data: st.DataObject) -> None:
    torque, theta = window
    k = data.draw(st.integers(1, len(torque) - 1))
    parts = [load.measure(torque[:k], theta[: k + 1], H), load.measure(torque[k:], theta[k:], H)]
    whole = load.measure(torque, theta, H)
    for key, value in leaves(whole["work"]):
        assert value == sum(dict(leaves(part["work"]))[key] for part in parts)
    one, two, both = (each["opposing"] for each in (*parts, whole))
    assert both["energy"] == one["energy"] + two["energy"]
    steps = k * one["fraction"] + (len(torque) - k) * two["fraction"]
    assert len(torque) * both["fraction"] == pytest.approx(steps, abs=1e-12)


@given(windows(), st.data())
def test_stance_and_its_complement_make_the_whole(window: Window, data: st.DataObject) -> None:
    rows = len(window[0])
    stance = np.array(data.draw(st.lists(st.booleans(), min_size=rows, max_size=rows)))
    whole = load.measure(*window, H)
    parts = [load.measure(*window, H, stance=mask)["stance"] for mask in (stance, ~stance)]
    for key, value in leaves(whole["work"]):
        assert value == sum(dict(leaves(part["work"]))[key] or 0.0 for part in parts)
    firsts = [t for part in parts if (t := part["opposing"]["first"]) is not None]
    assert whole["opposing"]["first"] == min(firsts, default=None)
    assert len(firsts) < 2 or firsts[0] != firsts[1]
    same(load.measure(*window, H, stance=np.ones(rows, dtype=bool))["stance"], whole)


@given(windows(), st.integers(1, 9), st.data())
def test_phase_bins_are_stances(window: Window, bins: int, data: st.DataObject) -> None:
    rows = len(window[0])
    of = np.array(data.draw(st.lists(st.integers(0, bins - 1), min_size=rows, max_size=rows)))
    found = load.measure(*window, H, phase=(of + 0.5) / bins, bins=bins)["phase"]
    for i in range(bins):
        alone = load.measure(*window, H, stance=of == i)["stance"]
        same(found["share_A"][i], alone["share_A"])
        same({motor: found["torque_rms"][motor][i] for motor in "AE"}, alone["torque_rms"])
    assert len(found["share_A"]) == len(found["torque_rms"]["E"]) == bins


# oracle


@given(windows())
def test_a_plain_loop_measures_the_same(window: Window) -> None:
    torque, theta = window
    A, E = torque.T.tolist()
    turns = theta[1:] - theta[:-1]
    work = [(A[k] * float(a), E[k] * float(e)) for k, (a, e) in enumerate(turns)]
    against = [k for k, (a, e) in enumerate(work) if a * e < 0.0]

    def share(power: int) -> float | None:
        parts = [sum(abs(tau) ** power for tau in motor) for motor in (A, E)]
        return parts[0] / sum(parts) if sum(parts) else None

    rms = [math.sqrt(sum(tau**2 for tau in motor) / len(motor)) for motor in (A, E)]
    peak = [max(abs(tau) for tau in motor) for motor in (A, E)]
    gain = [sum(max(step[m], 0.0) for step in work) for m in (0, 1)]
    loss = [sum(min(step[m], 0.0) for step in work) for m in (0, 1)]
    wanted = {
        "torque_rms": dict(zip("AE", rms, strict=True)),
        "torque_peak": dict(zip("AE", peak, strict=True)),
        "share_A": share(1),
        "thermal_share_A": share(2),
        "peak_ratio": max(peak) / min(peak) if min(peak) else None,
        "rms_ratio": max(rms) / min(rms) if min(rms) else None,
        "work": {
            motor: {"positive": gain[m], "negative": loss[m], "net": gain[m] + loss[m]}
            for m, motor in enumerate("AE")
        },
        "opposing": {
            "fraction": len(against) / len(A),
            "first": H * against[0] if against else None,
            "energy": float(sum(min(abs(a), abs(e)) for a, e in (work[k] for k in against))),
        },
    }
    same(load.measure(torque, theta, H), wanted)


def test_work_is_the_energy_that_the_leg_gained() -> None:
    """Torques held over steps of 2 ms, the motion between by Runge-Kutta at 0.05 ms."""
    leg = FiveBar.load("extended")
    h = 2e-3
    fine = 40
    theta = [kinematics.home(leg)[::2]]
    rate = [np.zeros(2)]
    turn = 0.7 * np.arange(40)[:, None]
    torque = 4e-3 * np.cos(turn + np.array([0.0, np.pi + 0.4]))
    for tau in torque:
        start = leg, theta[-1], rate[-1]
        held = dynamics.simulate(*start, h / fine, fine, lambda t, q, w, tau=tau: tau)
        theta.append(held.theta[-1])
        rate.append(held.theta_dot[-1])
    energy = np.sum(dynamics.energy(leg, theta, rate), axis=0)
    gained = float(energy[-1] - energy[0])
    before = np.array(rate[:-1])
    after = np.array(rate[1:])
    A, E = load.measure(torque, theta, h)["work"].values()
    spent = A["positive"] - A["negative"] + E["positive"] - E["negative"]
    assert abs(gained) > 0.04 * spent
    # measured: 1e-15; sums of rates are off by 3 % (before or after the step) and 8e-5 (their mean)
    assert abs(A["net"] + E["net"] - gained) < 1e-12 * spent
    for wrong, off in ((before, 0.02), (after, 0.02), (0.5 * (before + after), 5e-5)):
        assert abs(h * np.sum(torque * wrong) - gained) > off * spent


def test_work_at_rest_is_what_the_foot_does_to_the_world() -> None:
    """Tau = -J^T F at the middle of each step: an error of order 2 in the step."""
    leg = FiveBar.load("classic")
    force = np.array([1.0, 4.0])
    off = []
    for rows in (50, 100):
        s = np.linspace(0.0, 1.0, 2 * rows + 1)
        foot = np.stack([0.02 - 0.04 * s, -0.08 + 0.01 * s**2], axis=-1)
        theta = kinematics.inverse(leg, foot)
        torque = dynamics.statics(leg, theta[1::2], force)
        work = load.measure(torque, theta[::2], H)["work"]
        off.append(work["A"]["net"] + work["E"]["net"] + float(force @ (foot[-1] - foot[0])))
    assert abs(off[1]) < 1e-7
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.01)


# edge


def test_one_motor_lifts_the_other() -> None:
    """A drives for two steps while E brakes in the second; in the third both drive."""
    torque = [[2.0, 0.0], [2.0, -1.0], [1.0, 1.0]]
    theta = [[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [3.0, 3.0]]
    found = load.measure(torque, theta, H, stance=[False, True, True])
    assert found["work"] == {
        "A": {"positive": 5.0, "negative": 0.0, "net": 5.0},
        "E": {"positive": 2.0, "negative": -1.0, "net": 1.0},
    }
    assert found["opposing"] == {"fraction": pytest.approx(1 / 3), "first": H, "energy": 1.0}
    assert found["stance"]["opposing"] == {"fraction": 0.5, "first": H, "energy": 1.0}
    assert found["share_A"] == 5 / 7
    assert found["thermal_share_A"] == 9 / 11
    assert found["peak_ratio"] == 2.0
    assert found["stance"]["share_A"] == 0.6


def test_idle_motors_share_nothing() -> None:
    found = load.measure(np.zeros((3, 2)), np.arange(8.0).reshape(4, 2), H)
    assert [found[key] for key in SHARES] == [None] * 4
    assert found["torque_peak"] == found["torque_rms"] == {"A": 0.0, "E": 0.0}
    assert found["opposing"] == {"fraction": 0.0, "first": None, "energy": 0.0}
    alone = load.measure([[3.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]], H)
    assert alone["share_A"] == alone["thermal_share_A"] == 1.0
    assert alone["peak_ratio"] is alone["rms_ratio"] is None


@pytest.mark.parametrize(("part", "defined"), [(0.9, False), (1.1, True)])
def test_rounding_is_no_load(part: float, defined: bool) -> None:
    small = part * load.TINY
    torque = [[1.0, 1.0], [small, -small]]
    theta = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]
    found = load.measure(torque, theta, H, stance=[False, True], phase=[0.0, 0.5], bins=2)
    assert (found["stance"]["share_A"] == 0.5) is defined
    assert (found["phase"]["share_A"][1] == 0.5) is defined
    assert (found["stance"]["rms_ratio"] == 1.0) is defined
    assert found["opposing"]["fraction"] == 0.5 * defined
    assert found["stance"]["torque_peak"]["A"] == small


def test_no_stance_has_no_numbers() -> None:
    found = load.measure(ONE, TWO, H, stance=[False], phase=[0.5])
    whole = load.measure(ONE, TWO, H)
    assert dict(leaves(found["stance"])) == dict.fromkeys(dict(leaves(whole)))
    assert found["phase"]["share_A"] == [None] * 4 + [0.5] + [None] * 3
    assert found["phase"]["torque_rms"]["E"] == [None] * 4 + [1.0] + [None] * 3


@pytest.mark.parametrize("bins", [1, 3, 8, 1000])
def test_phase_just_below_one_is_in_the_last_bin(bins: int) -> None:
    found = load.measure(ONE, TWO, H, phase=[math.nextafter(1.0, 0.0)], bins=bins)
    assert found["phase"]["share_A"] == [None] * (bins - 1) + [0.5]


# refusal


@pytest.mark.parametrize(
    ("message", "torque", "theta", "more"),
    [
        (r"torque must have shape \(N, 2\), got \(1, 3\)", [[1.0, 1.0, 1.0]], TWO, {}),
        (r"theta must have one row more .* shape \(2, 2\), got \(1, 2\)", ONE, ONE, {}),
        ("torque must have at least one row", np.zeros((0, 2)), ONE, {}),
        (r"torque must be in \[-1e\+09, 1e\+09\] N m, got nan at .*1\)", [[1, math.nan]], TWO, {}),
        (r"theta must be in .* rad, got inf at index \(0, 0\)", ONE, [[math.inf, 0], [0, 0]], {}),
        ("torque must be numbers", [["one", "two"]], TWO, {}),
        (r"timestep must be in \(0, 1e\+09\) s, got 0.0", ONE, TWO, {"timestep": 0.0}),
        (r"stance must be bools of shape \(1,\), got int64", ONE, TWO, {"stance": np.array([1])}),
        (r"stance must be bools of shape \(1,\): ", ONE, TWO, {"stance": [[True], [True] * 2]}),
        (r"phase must have shape \(1,\), got \(2,\)", ONE, TWO, {"phase": [0.0, 0.5]}),
        (r"phase must be in \[0, 1\), got 1.0 at index \(0,\)", ONE, TWO, {"phase": [1.0]}),
        (r"phase must be in \[0, 1\), got nan", ONE, TWO, {"phase": [math.nan]}),
        (r"bins must be a whole number in \[1, 1000\], got 0", ONE, TWO, {"phase": [0], "bins": 0}),
        (r"bins must be .*, got 2.5", ONE, TWO, {"phase": [0.0], "bins": 2.5}),
    ],
)  # fmt: skip
def test_refusal(message: str, torque: ArrayLike, theta: ArrayLike, more: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError, match=message):
        load.measure(torque, theta, **{"timestep": H, **more})


@given(windows(), st.integers(0, 4))
def test_moving_share_is_the_plain_sum_around_each_row(window: Window, half: int) -> None:
    torque, _ = window
    amount = np.abs(torque)
    if not amount.any():
        return

    share, loaded = load.moving_share(torque, half)
    around = [amount[max(k - half, 0) : k + half + 1].sum(axis=0) for k in range(len(torque))]

    # The torques are whole numbers: a window is loaded or exactly 0, and every sum is exact.
    assert [*loaded] == [part.any() for part in around]
    assert [*share] == [part[0] / part.sum() for part in around if part.any()]


def test_moving_share_leaves_out_what_is_nothing_beside_the_largest() -> None:
    share, loaded = load.moving_share(np.array([[0.0, 1.0], [1e-12, 0.0], [3.0, 1.0]]), 0)

    assert [*loaded] == [True, False, True]
    assert [*share] == [0.0, 0.75]


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_moving_share_knows_nothing_by_its_part_of_the_largest(size: float) -> None:
    rows = size * np.array([[1.0, 1.0], [0.5 * load.TINY, 0.0], [2.0 * load.TINY, 0.0]])
    share, loaded = load.moving_share(rows, 0)

    assert [*loaded] == [True, False, True]
    assert [*share] == [0.5, 1.0]


def test_moving_share_without_any_torque_is_of_no_row() -> None:
    share, loaded = load.moving_share(np.zeros((3, 2)), 1)

    assert share.shape == (0,)
    assert not loaded.any()
