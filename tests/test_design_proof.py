"""Designs in MuJoCo, and built a little off: what was predicted of them holds."""

from __future__ import annotations

import dataclasses
from importlib.util import find_spec

import numpy as np
import pytest

from fivebar_sim import design
from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.proof.scenarios import cases
from fivebar_sim.design.proof.table import Proof, prove, spearman
from fivebar_sim.design.robust.built import built
from fivebar_sim.design.robust.sensitivity import sensitivities
from fivebar_sim.design.robust.tolerance import tolerance_yield
from fivebar_sim.design.task.options import Constraints
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ArgumentError
from fivebar_sim.workers.here import Here

DESIGNS = np.array([[0.050, 0.063], [0.044, 0.067], [0.040, 0.070], [0.035, 0.072]])


@pytest.fixture(scope="module")
def task() -> Task:
    return design.load("classic-lengths")


@pytest.fixture(scope="module")
def proof(task: Task) -> Proof:
    return prove(task, DESIGNS)


def test_mujoco_measures_what_the_closed_form_predicts(proof: Proof) -> None:
    """Gear friction flips within a step, which shakes the soft servo by 0.4 % of the peak."""
    assert set(proof.measured) == {"torque_peak", "torque_rms", "heat", "energy", "balance"}
    for key in ("torque_peak", "torque_rms", "heat", "energy"):
        assert proof.worst[key] < 0.006, key
        assert proof.rank[key] == 1.0, key
    assert all(run.error == "" and run.guards == () for run in proof.runs)


def test_rows_have_both(task: Task, proof: Proof) -> None:
    rows = proof.rows(task)
    assert [row["design"] for row in rows] == [0, 1, 2, 3]
    assert (rows[1]["leg.L1"], rows[1]["leg.L4"]) == (0.044, 0.044)
    assert rows[1]["heat.predicted"] == proof.predicted["heat"][1]
    assert rows[1]["heat.simulated"] == proof.measured["heat"][1]
    assert rows[1]["error"] is None


def test_setpoints_come_at_every_step_to_the_servo_of_the_design(task: Task) -> None:
    (case,) = cases(task, DESIGNS[0])
    servo = case.scenario.servo
    assert (servo.rate, servo.delay, servo.resolution) == (None, 0.0, 0.0)
    assert servo.friction == task.servos[0].friction
    assert servo.dry > 0.0
    assert case.scenario.leg == task.leg_of(DESIGNS[0])
    period = case.scenario.path.period
    assert period is not None
    assert case.seconds == period
    assert case.scenario.duration == pytest.approx(case.scenario.path.ramp + 2.0 * period)


def test_design_that_cannot_be_planned_is_told_why(task: Task) -> None:
    class Half(Here):
        """The second design cannot follow its path: its links are half as long."""

    values = np.array([[0.050, 0.063], [0.020, 0.045]])
    found = prove(task, values, Half())
    assert found.runs[0].error == ""
    assert "path out of reach" in found.runs[1].error
    assert np.isnan(found.measured["heat"][1])
    assert found.rows(task)[1]["heat.simulated"] is None


def test_spearman_ranks_with_ties_and_without_gaps(rng: np.random.Generator) -> None:
    one = rng.normal(size=40)
    assert spearman(one, one**3) == pytest.approx(1.0)
    assert spearman(one, -one) == pytest.approx(-1.0)
    # Without ties it is 1 - 6 sum d^2 / (n (n^2 - 1)).
    other = rng.permutation(one)
    d = np.argsort(np.argsort(one)) - np.argsort(np.argsort(other))
    assert spearman(one, other) == pytest.approx(1.0 - 6.0 * float(d @ d) / (40.0 * (1600.0 - 1.0)))
    # Ranks 1, 2.5, 2.5, 4 against 1, 2, 3, 4: 4.5 / sqrt(4.5 * 5).
    tied = np.array([3.0, 5.0, 5.0, 9.0])
    assert spearman(tied, np.arange(4.0)) == pytest.approx(np.sqrt(0.9))
    assert spearman(np.append(one, np.nan), np.append(other, 1.0)) == spearman(one, other)
    assert np.isnan(spearman(one, np.ones(40)))
    assert np.isnan(spearman(one[:1], one[:1]))


def test_built_leg_without_an_error_is_the_design(task: Task) -> None:
    row = DESIGNS[1]
    own = built(task, row)
    low, high = own.bounds
    exact = evaluate(own, 0.5 * (low + high)[None]).objectives
    # The middle of each range is the length but for its rounding.
    np.testing.assert_allclose(exact, evaluate(task, row[None]).objectives, rtol=1e-9)
    assert own.names == ("leg.L1", "leg.L2", "leg.L3", "leg.L4", "leg.L5", "leg.tilt")
    assert high[0] - low[0] == pytest.approx(4e-4)
    with pytest.raises(ArgumentError, match=r"tolerance must be in \(0, 0\.015\) m, got 0\.02"):
        built(task, row, 0.02)


def reach_of(task: Task, row: Array) -> float:
    return float(evaluate(task, row[None]).measures[0, 1])


def test_yield_falls_where_a_limit_is_near(task: Task) -> None:
    row = DESIGNS[1]
    safe = tolerance_yield(task, row, drawn=512)
    assert (safe.share, safe.broken) == (1.0, {})
    assert safe.spread["torque_peak"][0] < 0.0 < safe.spread["torque_peak"][1] < 0.02

    # On the limit itself, of both sides alike, half of the built sides are wrong: two in four legs
    # have one of these, and one has two.
    tight = dataclasses.replace(task, constraints=Constraints(reach=reach_of(task, row)))
    found = tolerance_yield(tight, row, drawn=2048)
    assert found.share == pytest.approx(0.25, abs=0.03)
    assert list(found.broken) == ["reach"]
    assert found.broken["reach"] == 1.0 - found.share
    assert found == tolerance_yield(tight, row, drawn=2048)
    assert tolerance_yield(tight, row, 1e-5, drawn=512, seed=1).share != found.share


# SALib imports pandas: seconds.
@pytest.mark.long
@pytest.mark.skipif(find_spec("SALib") is None, reason="SALib is not installed")
def test_sensitivities_are_those_of_a_formula(task: Task) -> None:
    """Four links of one section: each causes a quarter of the mass's scatter, L5 and tilt none."""
    peak, mass = sensitivities(task, DESIGNS[1], drawn=128)
    for name in ("L1", "L2", "L3", "L4"):
        assert mass.total[name] == pytest.approx(0.25, abs=0.02)
        assert mass.first[name] == pytest.approx(0.25, abs=0.04)
    assert mass.total["L5"] == mass.total["tilt"] == 0.0
    # Four even errors of +-0.2 mm: rho pi r^2 2e-4 sqrt(4 / 3) of the mass.
    scatter = 1200.0 * np.pi * 0.004**2 * 2e-4 * np.sqrt(4.0 / 3.0)
    nominal = evaluate(task, DESIGNS[1][None]).objectives[0, 1]
    assert mass.spread == pytest.approx(scatter / nominal, rel=0.03)
    assert sum(peak.total.values()) == pytest.approx(1.0, abs=0.15)
    assert peak.worst in ("L1", "L2", "L3", "L4")
