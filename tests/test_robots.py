"""Robots as data: what a file says is what the robot is, and what it cannot be is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import tomli_w

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources
from fivebar_sim.robots import LEGS, Robot

TABLE = {
    "leg": "classic",
    "servo": "xl330",
    "mass": 0.8,
    "trunk": {"size": [0.2, 0.1, 0.04]},
    "hips": {
        "FL": {"pos": [0.08, 0.06, 0.0]},
        "FR": {"pos": [0.08, -0.06, 0.0]},
        "RL": {"pos": [-0.08, 0.06, 0.0], "mirrored": True},
        "RR": {"pos": [-0.08, -0.06, 0.0], "mirrored": True},
    },
}


def changed(**changes: object) -> dict:
    """Return the table with changes; None leaves a key out, `__` stands for a dot."""
    table = {**TABLE, "hips": dict(TABLE["hips"]), "trunk": dict(TABLE["trunk"])}
    for dotted, value in changes.items():
        *parts, last = dotted.split("__")
        inner = table
        for part in parts:
            inner[part] = dict(inner[part])
            inner = inner[part]
        if value is None:
            del inner[last]
        else:
            inner[last] = value
    return table


@pytest.mark.parametrize("name", resources.shipped("models/robots"))
def test_shipped_robot_loads_by_name(name: str) -> None:
    robot = Robot.load(name)
    assert robot.name == name
    assert tuple(robot.hips) == LEGS
    assert 0.0 < robot.trunk_mass < robot.mass


def test_own_file_names_what_lies_beside_it(tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text("L1 = 0.05\nL2 = 0.07\nL3 = 0.07\nL4 = 0.05\n")
    file = tmp_path / "mine.toml"
    file.write_text(tomli_w.dumps(changed(leg={"preset": "long.toml", "L5": 0.02})))

    robot = Robot.load(file)
    assert robot.name == "mine"
    assert (robot.leg.L1, robot.leg.L5) == (0.05, 0.02)
    assert robot.leg.armature == robot.servo.armature
    assert robot.hips["RL"].mirrored
    assert robot.length == 0.2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"legs": "classic"}, r"unknown key 'legs'; known: .+ \(did you mean 'leg'\?\)"),
        ({"mass": None}, "mass is missing"),
        ({"mass": 0.03}, r"mass must be in \(0\.0\d+, 1e\+06\] kg, more than that of the four"),
        ({"mass": "heavy"}, r"mass must be in \(0, 1e\+06\) kg, got 'heavy'"),
        ({"leg": "clasic"}, "unknown leg preset 'clasic'; known: .+did you mean 'classic'"),
        ({"trunk__size": [0.2, 0.0, 0.04]}, r"trunk\.size must be in \(0, 1000\) m, got 0"),
        ({"trunk__size": [0.2, 0.1]}, r"trunk\.size must be"),
        ({"trunk__inertia": [1.0, 1.0, 3.0]}, "inertia: no body has a moment of inertia greater"),
        ({"trunk__weight": 1.0}, r"\[trunk\]: unknown key 'weight'"),
        ({"hips__RR": None}, r"hips\.RR is missing"),
        ({"hips__BL": {"pos": [0.0, 0.0, 0.0]}}, r"\[hips\]: unknown key 'BL'"),
        ({"hips__FL__pos": [0.08, "a", 0.0]}, r"hips\.FL\.pos\[1\] must be a number"),
        ({"hips__FL__height": 0.0}, r"\[hips\.FL\]: unknown key 'height'"),
        (
            {"hips__FR__pos": [0.07, 0.055, 0.0]},
            r"hips\.FR is inside hips\.FL: they must be 0\.012 m apart along y, or 0\.042 m in "
            r"the leg's plane, got 0\.005 m and 0\.01 m",
        ),
        ({"hips": "four"}, "hips must be a table, got 'four'"),
        ({"name": "a\nb"}, "name must be a printable string"),
    ],
)
def test_refusal(changes: dict, message: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(tomli_w.dumps(changed(**changes)))
    with pytest.raises(ConfigError, match=message) as refused:
        Robot.load(file)
    assert "mine.toml: " in str(refused.value)
    assert "\n" not in str(refused.value)


def test_unknown_robot_is_one_line() -> None:
    with pytest.raises(ConfigError, match=r"robot preset 'q8bt'; known: .+did you mean 'q8bot'"):
        Robot.load("q8bt")
