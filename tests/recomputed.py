"""The metrics of a run directory, recomputed from its files alone: nothing of fivebar_sim is used.

Reads rollout.parquet, scenario.toml and the window of metrics.json. Points of the leg plane are
complex numbers x + i z, so that a link of direction psi is a factor exp(i psi).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import recomputed_energy
from recomputed_run import Array, Bools, Run, cycle_at, period

Found = dict[str, Any]

UNRECORDED = {"warnings"}
"""Metrics that no record can hold: MuJoCo counts its warnings itself."""

JUDGED = {"verdict", "limits", "guards", "provenance", "window"}
"""Tables of metrics.json that are no metrics."""

TINY = 1e-6
"""What counts as zero of the window's largest torque or work."""


def measured(run: Run) -> Found:
    """Return the metrics that metrics.json has, by dotted key."""
    kept = {k: v for k, v in run.metrics.items() if k not in JUDGED | UNRECORDED}
    return dict(_flat("", kept))


def _flat(prefix: str, value: Any) -> list[tuple[str, Any]]:
    if not isinstance(value, dict):
        return [(prefix, value)]
    return [pair for key in value for pair in _flat(f"{prefix}.{key}".lstrip("."), value[key])]


def recomputed(run: Run) -> Found:
    """Return the same metrics from the record."""
    return {
        **_errors(run),
        **_peaks(run),
        **_load(run),
        **_heat(run),
        **_beside_serial(run),
        **_ground(run),
        **_branch(run),
        **recomputed_energy.energies(run),
    }


def _errors(run: Run) -> Found:
    """Return foot tracking in the window, and the gap over the whole run."""
    r = run.record
    off = np.abs((r["foot_x"] - r["target_x"]) + 1j * (r["foot_z"] - r["target_z"]))[run.rows]
    return {
        "tracking.rms": np.linalg.norm(off) / math.sqrt(len(off)),
        "tracking.max": np.sort(off)[-1],
        "closure.rms": np.linalg.norm(r["gap"]) / math.sqrt(len(r["gap"])),
        "closure.max": np.sort(r["gap"])[-1],
    }


def _peaks(run: Run) -> Found:
    """Return the peaks of the window, of the whole run, and when those occur."""
    r = run.record
    columns = {"gap_peak": r["gap"]}
    for motor in "AE":
        columns[f"torque_peak.{motor}"] = r[f"torque_{motor}"]
        columns[f"speed_peak.{motor}"] = r[f"theta_dot_{motor}"]
        columns[f"power_peak.{motor}"] = r[f"torque_{motor}"] * r[f"theta_dot_{motor}"]
    if "ground_x" in r:
        columns |= {"ground_peak.x": r["ground_x"], "ground_peak.z": r["ground_z"]}

    found: Found = {}
    for key, column in columns.items():
        size = np.sqrt(column**2)
        most = np.flatnonzero(size == np.sort(size)[-1])[0]
        found[f"whole.{key}"] = size[most]
        found[f"whole.at.{key}"] = (most + 1) * run.h
        found[key] = np.sort(size[run.rows])[-1]
    for motor in "AE":
        found[f"load.torque_peak.{motor}"] = found[f"torque_peak.{motor}"]
    return found


def _load(run: Run) -> Found:
    """Return how the motors shared the load: of the window, in stance, and by phase."""
    turn = np.column_stack([run.record[f"theta_{m}"] - run.before(f"theta_{m}") for m in "AE"])
    torque = run.pair("torque")[run.rows]
    work = torque * turn[run.rows]
    every = np.ones(len(torque), dtype=bool)
    found = {f"load.{key}": value for key, value in _share(run, torque, work, every).items()}

    clips = _clips(run)[run.rows]
    found |= {f"load.saturated.{m}": np.mean(clips[:, k]) for k, m in enumerate("AE")}

    phase, stance = _cycle(run)
    if stance is not None:
        shares = _share(run, torque, work, stance[run.rows])
        found |= {f"load.stance.{key}": value for key, value in shares.items()}
    if phase is not None:
        found |= _by_phase(torque, phase[run.rows])
    return found


def _share(run: Run, torque: Array, work: Array, chosen: Bools) -> Found:
    """Return the shares of some steps of the window."""
    size = np.abs(torque)
    spent = np.abs(work)
    real = np.all(spent > TINY * spent.max(), axis=1)
    against = real & (np.prod(np.sign(work), axis=1) < 0.0) & chosen
    floor = TINY * size.max()
    A, E = size[chosen].T
    rms = [np.linalg.norm(each) / math.sqrt(len(each)) for each in (A, E)]
    peak = [float(np.sort(each)[-1]) for each in (A, E)]
    loaded = max(peak) > floor
    found: Found = {
        "torque_rms.A": rms[0],
        "torque_rms.E": rms[1],
        "torque_peak.A": peak[0],
        "torque_peak.E": peak[1],
        "share_A": A.sum() / (A.sum() + E.sum()) if loaded else None,
        "thermal_share_A": A @ A / (A @ A + E @ E) if loaded else None,
        "peak_ratio": max(peak) / min(peak) if min(peak) > floor else None,
        "rms_ratio": max(rms) / min(rms) if min(rms) > floor else None,
        "opposing.fraction": np.count_nonzero(against) / np.count_nonzero(chosen),
        "opposing.first": np.flatnonzero(against)[0] * run.h if against.any() else None,
        "opposing.energy": np.minimum(spent[:, 0], spent[:, 1])[against].sum(),
    }
    for k, motor in enumerate("AE"):
        each = work[chosen, k]
        found[f"work.{motor}.positive"] = each[each > 0.0].sum()
        found[f"work.{motor}.negative"] = each[each < 0.0].sum()
        found[f"work.{motor}.net"] = each.sum()
    return found


def _by_phase(torque: Array, phase: Array) -> Found:
    """Return share and RMS in eighths of the cycle."""
    floor = TINY * np.abs(torque).max()
    shares: list[Any] = []
    rms: dict[str, list[Any]] = {"A": [], "E": []}
    for eighth in range(8):
        A, E = np.abs(torque[(phase >= eighth / 8) & (phase < (eighth + 1) / 8)]).T
        loaded = len(A) and max(A.max(), E.max()) > floor
        shares.append(A.sum() / (A.sum() + E.sum()) if loaded else None)
        for motor, each in (("A", A), ("E", E)):
            rms[motor].append(math.sqrt(np.mean(each**2)) if len(each) else None)
    return {
        "load.phase.share_A": shares,
        "load.phase.torque_rms.A": rms["A"],
        "load.phase.torque_rms.E": rms["E"],
    }


def _clips(run: Run) -> Bools:
    """Return in which steps the torque limit clipped each motor, (N, 2)."""
    servo = run.scenario["servo"]
    u = run.pair("ctrl")
    if "limit" not in servo:
        return np.zeros(u.shape, dtype=bool)
    # the shipped controllers other than "servo" command torques
    if run.scenario["controller"]["name"] != "servo":
        return np.abs(u) > servo["limit"]
    theta = np.column_stack([run.before(f"theta_{m}") for m in "AE"])
    if run.scenario["sim"]["integrator"] == "discrete":
        theta = run.pair("theta")
    asked = servo["kp"] * (u - theta) - servo["kd"] * run.pair("theta_dot")
    return np.abs(asked) > servo["limit"]


def _heat(run: Run) -> Found:
    """Return the heat of the windings, as far as the servo's table tells of them."""
    servo = run.scenario["servo"]
    found: Found = {}
    if "speed" in servo:
        lost = servo["limit"] / servo["speed"]
        for m in "AE":
            both = run.record[f"torque_{m}"] + lost * run.record[f"theta_dot_{m}"]
            found[f"load.line.{m}"] = np.sort(np.abs(both[run.rows]))[-1] / servo["limit"]
    if "kt" not in servo:
        return found

    parts = []
    for m in "AE":
        current = run.record[f"torque_{m}"][_lasting(run)] / servo["kt"]
        watts = servo["resistance"] * (current @ current) / len(current)
        found[f"load.heat.{m}"] = watts
        if "thermal_resistance" in servo:
            warmer = watts * servo["thermal_resistance"]
            parts.append(warmer / (servo["temperature_max"] - servo["ambient"]))
            found[f"load.temperature.{m}"] = servo["ambient"] + warmer
            found[f"load.continuous.{m}"] = math.sqrt(parts[-1])
    if parts:
        found["load.survives"] = max(parts)
    return found


def _beside_serial(run: Run) -> Found:
    """Return heat and gear work as multiples of those of a serial leg in the same places."""
    leg = run.scenario["leg"]
    tau, omega = (run.pair(name)[run.rows] for name in ("torque", "theta_dot"))
    foot, (a, e) = _foot_and_columns(run)
    force = 1j * (tau[:, 1] * a - tau[:, 0] * e) / (np.conj(a) * e).imag
    moved = a * omega[:, 0] + e * omega[:, 1]

    L1 = leg["L1"]
    tibia = abs(leg["L2"] + leg["L6"] * np.exp(1j * leg["bend"]))
    far = np.abs(foot)
    if far.max() > L1 + tibia or far.min() < abs(L1 - tibia):
        return {"load.serial_heat": None, "load.serial_friction": None}
    bent = np.arccos((L1**2 + far**2 - tibia**2) / (2.0 * L1 * far))
    knee = L1 * foot / far * np.exp(1j * leg["mode"][0] * bent)
    hip_arm = 1j * foot
    knee_arm = 1j * (foot - knee)
    torques = [(np.conj(arm) * force).real for arm in (hip_arm, knee_arm)]
    area = (np.conj(hip_arm) * knee_arm).imag
    rates = [(np.conj(moved) * knee_arm).imag / area, (np.conj(hip_arm) * moved).imag / area]
    heat = sum(t @ t for t in torques)
    passed = sum(np.abs(t * w).sum() for t, w in zip(torques, rates, strict=True))
    return {
        "load.serial_heat": (tau**2).sum() / heat,
        "load.serial_friction": np.abs(tau * omega).sum() / passed,
    }


def _foot_and_columns(run: Run) -> tuple[Any, list[Any]]:
    """Return the foot x + 1j z, and how it moves with A and with E."""
    leg = run.scenario["leg"]
    A, E = (run.record[f"theta_{m}"][run.rows] for m in "AE")
    out = leg["L6"] / leg["L2"] * np.exp(1j * leg["bend"])
    half = 0.5 * leg["L5"] * np.exp(1j * leg["tilt"])
    AB = leg["L1"] * np.exp(1j * A)
    ED = leg["L4"] * np.exp(1j * E)
    d = half + ED - (AB - half)
    r = np.abs(d)
    along = (leg["L2"] ** 2 - leg["L3"] ** 2 + r**2) / (2.0 * r)
    BC = d / r * (along + 1j * leg["assembly"] * np.sqrt(leg["L2"] ** 2 - along**2))
    DC = BC - d
    foot = AB - half + BC + out * BC

    # C moves at right angles to BC as seen from B, and to DC as seen from D
    columns = []
    for b, e in ((1j * AB, 0.0 * ED), (0.0 * AB, 1j * ED)):
        p = (np.conj(BC) * b).real
        q = (np.conj(DC) * e).real
        area = (np.conj(BC) * DC).imag
        c = 1j * (q * BC - p * DC) / area
        columns.append(c + out * (c - b))
    return foot, columns


def _lasting(run: Run) -> slice:
    """Return the steps at rest after a single step of the foot, or those of the window."""
    path = run.scenario["path"]
    if path["kind"] != "step":
        return run.rows
    first = round((path["seconds"] + 0.5 * path["ramp"]) / run.h)
    return slice(first, None) if first < len(run.record["time"]) else run.rows


def _cycle(run: Run) -> tuple[Array | None, Bools | None]:
    """Return the phase in which each step begins, and whether the foot stands in it."""
    begun = np.maximum(run.record["time"] - run.h, 0.0)
    phase = None
    if period(run) is not None:
        # a step that begins at the edge of two eighths must not miss it by rounding
        phase = np.round(cycle_at(run, begun), 9) % 1.0
    stance = None
    if "ground_z" in run.record:
        stance = run.record["ground_z"] > 0.0
    elif run.scenario["path"]["kind"] == "gait":
        assert phase is not None
        stance = phase < run.scenario["path"]["duty"]
    return phase, stance


def _ground(run: Run) -> Found:
    """Return the metrics of the ground, where there is one."""
    r = run.record
    if "ground_z" not in r:
        return {}
    radius = run.scenario["leg"]["foot_radius"]
    down = r["ground_z"] > 0.0
    height = r["hip_z"] + r["foot_z"] - radius
    # the contact lies in the middle of the overlap
    arm = radius - 0.5 * np.maximum(-height, 0.0)
    rolled = 0.5 * (arm[1:] + arm[:-1]) * np.diff(r["theta_A"] + r["theta_B"])
    carried = np.diff(r["belt_x"]) if "belt_x" in r else 0.0
    slid = np.abs(np.diff(r["foot_x"]) + rolled - carried)
    slid = np.concatenate([[0.0], slid])
    flights = "".join("01"[int(stands)] for stands in down).split("1")
    return {
        "ground.force_max.x": np.abs(r["ground_x"]).max(),
        "ground.force_max.z": r["ground_z"].max(),
        "ground.stance_share": np.count_nonzero(down[run.rows]) / len(down[run.rows]),
        "ground.slip": slid[run.rows][down[run.rows]].sum(),
        "ground.foot_height_max": height.max(),
        "ground.foot_share": _part(r["ground_z"][run.rows].sum(), r["rail_end"][run.rows].sum()),
        "ground.rail_end_max": r["rail_end"].max(),
        "ground.flight_max": max(map(len, flights)) * run.h,
    }


def _part(one: float, other: float) -> float | None:
    """Return one amount as a part of both, None if there is nothing of either."""
    return float(one / (one + other)) if one + other > 0.0 else None


def _branch(run: Run) -> Found:
    """Return which way the leg was folded at the end, and how often that changed."""
    r = run.record
    leg = run.scenario["leg"]
    psi_2 = r["theta_A"] + r["theta_B"]
    E = 0.5 * leg["L5"] * np.exp(1j * leg["tilt"])
    B = -E + leg["L1"] * np.exp(1j * r["theta_A"])
    D = E + leg["L4"] * np.exp(1j * r["theta_E"])
    left = B + leg["L2"] * np.exp(1j * psi_2)
    right = D + leg["L3"] * np.exp(1j * (r["theta_E"] + r["theta_D"]))
    F = left + leg["L6"] * np.exp(1j * (psi_2 + leg["bend"]))
    np.testing.assert_allclose(np.abs(left - right), r["gap"], rtol=1e-6, atol=1e-15)

    # the angle from one line to the other tells the side
    folds = [(B + E) / (F + E), (D - E) / (right - E), (left - B) / (D - B)]
    signs = np.stack([np.sign(np.angle(fold)) for fold in folds], axis=1)
    own = [*leg["mode"], leg["assembly"]]
    changed = np.any(signs != np.vstack([own, signs[:-1]]), axis=1)
    return {
        "branch.working_mode": signs[-1, :2].tolist(),
        "branch.assembly": signs[-1, 2],
        "branch.flips": np.count_nonzero(changed),
        "branch.first_flip": r["time"][changed][0] if changed.any() else None,
    }
