"""Designs on arrays against the functions for a single leg, one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import design, dynamics, kinematics, workspace
from fivebar_sim.analysis import quality, singularity
from fivebar_sim.arrays import Array
from fivebar_sim.design import Task
from fivebar_sim.design.evaluation.motors import through
from fivebar_sim.dynamics.antagonism import price
from fivebar_sim.dynamics.heat import heating, line_used
from fivebar_sim.workspace.survey import survey

EVERY = """
samples = 16
leg = { preset = "classic", L6 = 0.01, bend = 0.3, tilt = 0.1, mass = [0.004, 0.006, 0.005, 0.003] }
servo = "hobby-9g"
objectives = [
    "torque_peak", "torque_rms", "heat", "energy", "balance", "antagonism", "mass", "size",
    "longest", "reflected_inertia", "force", "workspace_area", "condition",
]

[vary]
leg.L1 = [0.012, 0.045]
leg.L2 = [0.055, 0.07]
leg.L3 = { tie = "leg.L2", scale = 1.1, offset = -0.001 }
leg.L6 = { low = 0.0, high = 0.012, step = 0.006 }
leg.bend = [-0.2, 0.4]
leg.tilt = [-0.2, 0.2]
leg.mass.1 = [0.004, 0.008]
servo = { choice = ["hobby-9g", "xl330"] }
gear = [0.8, 1.5]
motion.swing.path.centre.1 = [-0.075, -0.07]

[motion.swing]
payload = 0.02
weight = 2.0
path = { kind = "ellipse", centre = [0.0, -0.072], radii = [0.01, 0.006], frequency = 2.0 }

[motion.push]
path = { kind = "gait", centre = [0.0, -0.075], stride = 0.02, lift = 0.01, frequency = 1.0 }
force = { kind = "stance", peak = [0.2, 1.0] }

[region.work]
kind = "box"
low = [-0.01, -0.08]
high = [0.01, -0.07]

[constraints]
singular = 0.3
line = 0.5
condition = 100.0
knees = -1.0
apart = -1.0
stops.A = [-7.0, 7.0]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "task.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    return design.load(write(tmp_path_factory.mktemp("task"), EVERY))


@pytest.fixture(scope="module")
def good(task: Task) -> design.Evaluated:
    """Six designs that keep to everything, of which some have an extension and some have none."""
    found = design.evaluate(task, task.sample(60, seed=1))
    kept = found.take(found.feasible)
    # The models differ where the foot has an extension.
    lengths = kept.values[:, task.names.index("leg.L6")]
    rows = [*np.flatnonzero(lengths == 0.0)[:3], *np.flatnonzero(lengths > 0.0)[:3]]
    assert len(rows) == 6
    return kept.take(np.array(rows))


def column(task: Task, found: design.Evaluated, name: str) -> Array:
    return found.objectives[:, task.objectives.index(name)]


def motions(task: Task, row: Array) -> list[dict[str, Array]]:
    """Return what one leg does in each motion, by the functions for one leg."""
    leg = task.leg_of(row)
    servo = through(task.servo(row), task.settings(row)["gear"])
    done = []
    for motion in task.motions_of(row):
        time = motion.times(task.samples)
        foot = motion.path.at(time)
        moving = kinematics.joint_motion(leg, *foot)
        force = None if motion.force is None else motion.force.at(time, motion.path)
        theta = moving.q[:, [0, 2]]
        omega = moving.q_dot[:, [0, 2]]
        model = dynamics.LegDynamics(leg, payload=motion.payload)
        alpha = moving.q_ddot[:, [0, 2]]
        torque = model.inverse(theta, omega, alpha, force, friction=servo.dry)
        done.append({"theta": theta, "omega": omega, "torque": torque, "foot": foot.position})
    return done


def test_objectives_are_those_of_single_legs(task: Task, good: design.Evaluated) -> None:
    for k, row in enumerate(good.values):
        swing, push = motions(task, row)
        leg = task.leg_of(row)
        servo = through(task.servo(row), task.settings(row)["gear"])
        assert servo.winding is not None
        assert servo.limit is not None
        tau = [swing["torque"], push["torque"]]
        mean = [np.mean(each**2, axis=0) for each in tau]
        squares = (2.0 * mean[0] + mean[1]) / 3.0
        watts = [heating(each, servo.winding).watts.sum() for each in tau]
        power = [
            np.maximum(m["torque"] * m["omega"], 0.0).mean(axis=0).sum() for m in (swing, push)
        ]
        impulse = (2.0 * np.abs(tau[0]).mean(axis=0) + np.abs(tau[1]).mean(axis=0)) / 3.0
        theta = np.concatenate([swing["theta"], push["theta"]])
        felt = dynamics.reflected_inertia(leg, theta)
        slopes = kinematics.jacobian(leg, theta)
        cover = task.covers_of(row)[0].region.points(task.samples)
        everywhere = np.concatenate([theta, kinematics.inverse(leg, cover)])
        expected = {
            "torque_peak": np.abs(np.concatenate(tau)).max(),
            "torque_rms": np.sqrt(squares.max()),
            "heat": (2.0 * watts[0] + watts[1]) / 3.0,
            "energy": (2.0 * power[0] * 0.5 + power[1] * 1.0) / 3.0,
            "balance": abs(2.0 * impulse[0] / impulse.sum() - 1.0),
            "mass": sum(link.mass for link in leg.links),
            "size": leg.size,
            "longest": max(leg.L1, leg.L2, np.hypot(*leg.foot_offset), leg.L3, leg.L4),
            "reflected_inertia": np.linalg.eigvalsh(felt).max(),
            "force": servo.limit / np.linalg.norm(slopes, axis=-2).max(),
            "condition": quality.condition(leg, everywhere).max(),
        }
        got = dict(zip(task.objectives, good.objectives[k], strict=True))
        for name, value in expected.items():
            assert got[name] == pytest.approx(value, rel=1e-9), name


def test_antagonism_is_the_price_of_a_single_leg(task: Task, good: design.Evaluated) -> None:
    """With one motion alone, since a price is of one."""
    alone = Task(**{**task.__dict__, "motions": task.motions[1:], "_fixed": {}})
    found = design.evaluate(alone, good.values)
    for row, got in zip(good.values, column(task, found, "antagonism"), strict=True):
        push = motions(task, row)[1]
        cost = price(task.leg_of(row), push["theta"], push["omega"], push["torque"])
        assert got == pytest.approx(cost.heat, rel=1e-9)


def test_area_is_that_of_the_workspace(task: Task, good: design.Evaluated) -> None:
    for row, got in zip(good.values[1::3], column(task, good, "workspace_area")[1::3], strict=True):
        # The survey is a grid: a per cent of the area lies on its edge.
        assert got == pytest.approx(survey(task.leg_of(row), 61).area, rel=0.02)


def test_measures_are_those_of_single_legs(task: Task, good: design.Evaluated) -> None:
    names = [each.name for each in design.limits(task)]
    for row, measures in zip(good.values, good.measures, strict=True):
        got = dict(zip(names, measures, strict=True))
        leg = task.leg_of(row)
        servo = through(task.servo(row), task.settings(row)["gear"])
        done = motions(task, row)
        cover = task.covers_of(row)[0].region.points(task.samples)
        foot = np.concatenate([*(m["foot"] for m in done), cover])
        if leg.L6 == 0.0:
            edge = workspace.distance(leg, foot, mode=leg.mode).min()
            assert got["reach"] == pytest.approx(edge, rel=1e-9)
        d = singularity.distances_at(leg, foot)
        signed = np.stack(d) * np.array([[leg.mode[0]], [leg.mode[1]], [leg.assembly]])
        sines = signed / np.array(singularity.shorter_links(leg))[:, None]
        assert got["singular"] == pytest.approx(sines.min(), rel=1e-9)
        assert servo.limit is not None
        assert servo.speed is not None
        used = [line_used(m["torque"], m["omega"], servo.limit, servo.speed) for m in done]
        assert got["line"] == pytest.approx(np.max(used), rel=1e-9)
        # Each motion, and the region, stands on its own ground: where its lowest point is.
        over = []
        for part in (*(m["foot"] for m in done), cover):
            p = kinematics.closed_points(leg, kinematics.inverse(leg, part))
            knees = min(p.B[:, 1].min(), p.D[:, 1].min()) - leg.radius
            over.append(knees - part[:, 1].min() + leg.foot_radius)
        assert got["knees"] == pytest.approx(min(over), rel=1e-9)


def test_result_is_the_same_in_any_company(task: Task) -> None:
    values = task.sample(24, seed=3)
    whole = design.evaluate(task, values)
    pair = design.evaluate(task, values, threads=2)
    alone = [design.evaluate(task, values[k : k + 1]) for k in range(len(values))]
    assert 0 < whole.feasible.sum() < len(values)
    for other in (pair, design.Evaluated.joined(alone)):
        assert whole.objectives.tobytes() == other.objectives.tobytes()
        assert whole.measures.tobytes() == other.measures.tobytes()
