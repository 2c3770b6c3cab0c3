"""Design tasks as files: what can vary, and what is refused in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from fivebar_sim import FiveBar, design
from fivebar_sim.design.evaluation.objectives import CATALOGUE
from fivebar_sim.design.task.motions import AFFINE, sampled
from fivebar_sim.design.task.variables import Variable
from fivebar_sim.errors import ConfigError, FiveBarError
from fivebar_sim.files import resources

PLAIN = """
leg = "classic"
objectives = ["torque_peak"]
vary.leg.L1 = [0.03, 0.05]

[motion.walk.path]
kind = "circle"
centre = [0.0, -0.075]
radius = 0.01
frequency = 2.0
"""


def load(folder: Path, text: str) -> design.Task:
    path = folder / "task.toml"
    path.write_text(text, encoding="utf-8")
    return design.load(path)


@pytest.mark.parametrize("name", resources.shipped("designs"))
def test_shipped_task_has_a_feasible_design(name: str) -> None:
    task = design.load(name)
    assert design.evaluate(task, task.sample(2000)).feasible.any()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("leg.L1 =", "leg.radus =", r"unknown key 'leg.radus'; .*\(did you mean 'leg.radius'\?\)"),
        (
            "[0.03, 0.05]",
            "[0.05, 0.03]",
            r"low below high, got \[0.05, 0.03\]: the wrong way round",
        ),
        ("[0.03, 0.05]", "[0.03, 5.0]", r"leg.L1 = 5: .*L1 must be in \[0.001, 3\] m"),
        (
            "[0.03, 0.05]",
            "0.03",
            r"leg.L1 must be \[low, high\], the key it is tied to, or a table",
        ),
        (
            "[0.03, 0.05]",
            "{ low = 0.03, hihg = 0.05 }",
            r"unknown key 'hihg'; .*did you mean 'high'",
        ),
        ("[0.03, 0.05]", '"leg.L2"', r"leg.L1 is tied to unknown variable 'leg.L2'"),
        ("[0.03, 0.05]", "{ choice = [] }", "leg.L1.choice must be an array of values"),
        ('"torque_peak"', '"torque_peek"', r"unknown objective 'torque_peek'.*'torque_peak'"),
        ('"torque_peak"', '"heat"', "the objective 'heat' needs servo.kt and servo.resistance"),
        ('"torque_peak"', '"force"', "the objective 'force' needs servo.limit"),
        ("frequency = 2.0", "", "path.frequency is missing"),
        (
            "frequency = 2.0",
            "frequency = 2.0\n[constraint]",
            r"unknown key 'constraint'.*did you mean",
        ),
        ("frequency = 2.0", "frequency = 2.0\n[constraints]\nreech = 1", "'reech'.*'reach'"),
        (
            "frequency = 2.0",
            'frequency = 2.0\n[search]\nmethod = "nsga4"',
            "must be one of 'nsga2'",
        ),
        ("frequency = 2.0", "frequency = 2.0\n[constraints.most]\nmas = 1", "'mas'.*'mass'"),
        ('leg = "classic"', 'leg = "clasic"', "unknown leg preset 'clasic'.*'classic'"),
        ('leg = "classic"', "samples = 1", r"samples must be an integer in \[2, 10000\], got 1"),
        ('leg = "classic"', "gear = 0.0", r"gear must be in \(0, inf\), got 0.0"),
    ],
)
def test_bad_task_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in PLAIN
    with pytest.raises(ConfigError, match=message) as caught:
        load(tmp_path, PLAIN.replace(old, new))
    assert "\n" not in str(caught.value)
    assert "task.toml" in str(caught.value)


def test_foot_that_jumps_is_refused(tmp_path: Path) -> None:
    """Its rates are 0 between the jumps: the closed form would find no torque at all."""
    (tmp_path / "foot.csv").write_text("time_s,x_mm,z_mm\n0,9,-75\n1,0,-70\n2,-9,-75\n", "utf-8")
    for kind in ("linear", "hold"):
        path = f'kind = "csv"\nfile = "foot.csv"\nperiodic = true\ninterpolation = "{kind}"\n'
        text = PLAIN[: PLAIN.index("kind =")] + path
        if kind == "linear":
            assert load(tmp_path, text).motions
            continue
        with pytest.raises(ConfigError, match=r'motion.walk: path.interpolation must be "cubic"'):
            load(tmp_path, text)


def test_region_alone_has_no_torque(tmp_path: Path) -> None:
    text = PLAIN.split("[motion")[0]
    with pytest.raises(ConfigError, match=r"needs a \[motion.NAME\] or a \[region.NAME\]"):
        load(tmp_path, text)
    region = '\n[region.work]\nkind = "box"\nlow = [-0.01, -0.08]\nhigh = [0.01, -0.07]\n'
    with pytest.raises(ConfigError, match=r"'torque_peak' needs a \[motion.NAME\]: a region says"):
        load(tmp_path, text + region)
    task = load(tmp_path, text.replace("torque_peak", "condition") + region)
    assert design.evaluate(task, task.sample(5)).feasible.all()
    with pytest.raises(ConfigError, match="unknown kind 'disc'; known: box, half-disc"):
        load(tmp_path, text + region.replace('"box"', '"disc"'))


def test_preset_is_the_leg_that_was_evaluated(tmp_path: Path) -> None:
    """Every way to vary: a tie, a choice of modes, steps, a number in an array, a servo's rotor."""
    text = PLAIN.replace(
        "vary.leg.L1 = [0.03, 0.05]",
        """
gear = 2.0
[vary]
leg.L1 = { low = 0.03, high = 0.05, step = 0.004 }
leg.L4 = { tie = "leg.L1", scale = 2.0, offset = -0.04 }
leg.mode = { choice = [[-1, 1], [1, -1], [-1, -1]] }
leg.gravity.1 = [-9.81, -1.62]
servo = { choice = ["xl330", "hobby-9g"] }
""",
    )
    task = load(tmp_path, text)
    values = task.sample(40, seed=2)
    legs = task.legs(values)
    for k, row in enumerate(values):
        path = tmp_path / "leg.toml"
        path.write_text(task.preset(row), encoding="utf-8")
        leg = FiveBar.load(path)
        settings = task.settings(row)
        assert settings["leg.L4"] == pytest.approx(2.0 * settings["leg.L1"] - 0.04)
        assert round((settings["leg.L1"] - 0.03) / 0.004, 9) in range(6)
        assert leg.mode == settings["leg.mode"]
        assert tomllib.loads(task.preset(row))["gravity"][1] == settings["leg.gravity.1"]
        servo = task.servo(row)
        assert servo.armature is not None
        assert leg.armature == pytest.approx(4.0 * servo.armature)
        assert (leg.L1, leg.L4, leg.armature) == pytest.approx(
            (legs.L1[k, 0], legs.L4[k, 0], legs.armature[k, 0]), rel=1e-15
        )
        assert leg.mode == (legs.mode[0][k, 0], legs.mode[1][k, 0])
        assert leg.gravity[1] == legs.gravity[1][k, 0]
    assert {task.settings(row)["servo"] for row in values} == {"xl330", "hobby-9g"}
    assert len({task.settings(row)["leg.mode"] for row in values}) == 3


def test_legs_that_cannot_close_are_dropped_where_a_leg_is_refused(tmp_path: Path) -> None:
    text = PLAIN.replace("vary.leg.L1 = [0.03, 0.05]", "vary.leg.L5 = [0.0, 0.4]")
    task = load(tmp_path, text)
    values = np.linspace(0.0, 0.4, 21)[:, None]
    closes = design.evaluate(task, values).measures[:, 0] >= 0.0
    for row, ok in zip(values, closes, strict=True):
        try:
            task.leg_of(row)
        except FiveBarError:
            assert not ok
        else:
            assert ok
    assert 0 < closes.sum() < len(closes)


def test_values_of_a_range_are_equally_likely_and_legal(rng: np.random.Generator) -> None:
    choice = Variable("servo", 0.0, 2.0, 1.0, ("a", "b", "c"))
    drawn = choice.from_unit(rng.random(3000))
    assert set(drawn) == {0.0, 1.0, 2.0}
    assert np.bincount(drawn.astype(int)).min() > 900
    assert choice.from_unit(np.array([0.0, 1.0])).tolist() == [0.0, 2.0]
    assert choice.grid(2).tolist() == [0.0, 1.0, 2.0]
    assert Variable("gear", 1.0, 2.0).grid(3).tolist() == [1.0, 1.5, 2.0]


PATHS = [
    ("ellipse", {"centre": [0.01, -0.08], "radii": [0.02, 0.01], "frequency": 2.0}),
    ("circle", {"centre": [0.01, -0.08], "radius": 0.02, "frequency": 2.0}),
    ("figure-eight", {"centre": [0.01, -0.08], "radii": [0.02, 0.01], "frequency": 2.0}),
    ("line", {"start": [0.01, -0.08], "stop": [0.0, -0.07], "frequency": 2.0}),
    ("gait", {"centre": [0.01, -0.08], "stride": 0.03, "lift": 0.01, "frequency": 2.0}),
    (
        "gait",
        {"centre": [0.0, -0.08], "stride": 0.03, "lift": 0.01, "frequency": 2.0, "running": True},
    ),
    ("sine", {"centre": [0.0, -0.08], "stride": 0.03, "lift": 0.01, "push": 0.1, "frequency": 1.0}),
    ("hop", {"low": 0.06, "high": 0.08, "thrust": 0.3, "flight": 0.3, "x": 0.01, "frequency": 1.0}),
    ("step", {"start": [0.01, -0.08], "stop": [0.0, -0.07], "lift": 0.01, "seconds": 0.4}),
]


@pytest.mark.parametrize(("kind", "keys"), PATHS)
def test_numbers_of_a_path_are_blended_as_each_path_has_them(
    tmp_path: Path, kind: str, keys: dict[str, Any]
) -> None:
    """All at once: that every sample is affine in each of them is not enough."""
    words = {key: value for key, value in keys.items() if key in AFFINE}
    vary: dict[str, Any] = {}
    for key, value in words.items():
        for k, number in enumerate(value if isinstance(value, list) else [value]):
            name = (
                f"motion.walk.path.{key}.{k}"
                if isinstance(value, list)
                else f"motion.walk.path.{key}"
            )
            vary[name] = [number, number + 0.002]
    table: dict[str, Any] = {
        "vary": {**vary, "motion.walk.payload": [0.0, 0.1]},
        "motion": {"walk": {"payload": 0.0, "path": {"kind": kind, **keys}}},
        "leg": "classic",
        "samples": 9,
    }
    if kind == "gait":
        table["motion"]["walk"]["force"] = {"kind": "stance", "peak": [0.1, 1.0]}
        table["vary"]["motion.walk.force.peak.0"] = [0.0, 0.2]
    task = load(tmp_path, tomli_w.dumps(table))
    assert task.variation.is_affine("motion.walk.")
    values = task.sample(5)
    blended = task.moving(task.motions[0], values)
    for k, row in enumerate(values):
        own = sampled(task.motions_of(row)[0], task.samples)
        for name in own._fields:
            got = np.broadcast_to(getattr(blended, name), (5, *getattr(own, name).shape[1:]))[k]
            expected = getattr(own, name)[0]
            scale = max(1e-3, float(np.abs(expected).max()))
            np.testing.assert_allclose(got, expected, rtol=0, atol=1e-13 * scale, err_msg=name)


def test_points_of_a_region_are_blended_as_each_region_has_them(tmp_path: Path) -> None:
    text = (
        PLAIN.split("[motion")[0].replace("torque_peak", "condition")
        + """
vary.region.a.low.0 = [-0.02, -0.01]
vary.region.b.radius = [0.01, 0.02]
vary.region.b.centre.1 = [-0.09, -0.07]
region.a = { kind = "box", low = [0.0, -0.08], high = [0.01, -0.07] }
region.b = { kind = "half-disc", centre = [0.0, -0.08], radius = 0.01 }
"""
    )
    task = load(tmp_path, text)
    values = task.sample(4)
    for cover in range(2):
        got = np.stack(np.broadcast_arrays(*task.points(task.covers[cover], values)), axis=-1)
        for k, row in enumerate(values):
            expected = task.covers_of(row)[cover].region.points(task.samples)
            mine = np.broadcast_to(got, (4, *got.shape[1:]))[k]
            np.testing.assert_allclose(mine, expected, rtol=0, atol=1e-16)


def test_every_objective_says_what_it_is() -> None:
    for name, each in CATALOGUE.items():
        assert each.text, name
        assert each.sense in (-1, 1)
