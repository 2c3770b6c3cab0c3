"""Numbers with units in scenarios and legs, and the units that written scenarios carry."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shell import Shell

from fivebar_sim import Scenario, control, paths
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.files.quantities import SIZES, annotated, quantity, units_of
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Sim
from fivebar_sim.paths import FootPath
from fivebar_sim.scenario import forces, scenes

KINDS: list[type[Any]] = [
    *(FiveBar, Servo, Sensors, Sim),
    *paths.KINDS.values(),
    *scenes.KINDS.values(),
    *forces.KINDS.values(),
    *(control.find(name) for name in control.known()),
]
PURE = {
    *("arithmetic", "assembly", "columns", "derivative", "duty", "feedforward", "file", "flight"),
    *("friction", "integrator", "interpolation", "mass_error", "mode", "name", "outside"),
    *("periodic", "running", "scale"),
    *("seed", "thrust"),
}
"""Keys of which some class has no unit: words, counts, ratios."""


class Own(FootPath, frozen=True, tag="own"):
    """A user's path.

    Attributes:
        reach: How far [m], at most 3 [s] or so.
        start, stop: (x, z) of both ends
            [m].
        turns: How many [see the manual].
    """

    reach: float = 0.0
    start: tuple[float, float] = (0.0, 0.0)
    stop: tuple[float, float] = (0.0, 0.0)
    turns: float = 1.0


# law


@given(number=st.integers(-10_000, 10_000), space=st.sampled_from(["", " ", "  "]))
def test_decimal_units_are_as_written_in_si(number: int, space: str) -> None:
    """To the last bit: "35 mm" is 0.035, not 35 times a thousandth."""
    assert quantity(f"{number}{space}mm", "m", "x") == float(f"{number}e-3")
    assert quantity(f"{number / 100}{space}us", "s", "x") == pytest.approx(number * 1e-8, rel=1e-15)
    assert quantity([f"{number} g", 0.5], "kg", "x") == [float(f"{number}e-3"), 0.5]


@given(number=st.floats(-400.0, 400.0))
def test_degrees_are_a_part_of_a_turn(number: float) -> None:
    assert quantity(f"{number!r} deg", "rad", "x") == pytest.approx(math.radians(number))
    assert quantity(f"{number!r}°", "rad", "x") == pytest.approx(math.radians(number))
    assert quantity(f"{number!r} rpm", "rad/s", "x") == pytest.approx(number * math.pi / 30.0)


def test_a_unit_of_each_si_unit_is_itself() -> None:
    for unit, sizes in SIZES.items():
        assert sizes[unit] == 1.0
        assert quantity(f"2.5 {unit}", unit, "x") == 2.5


def test_every_number_of_a_scenario_has_its_unit_in_a_docstring() -> None:
    """Else its key would take no unit, and a written scenario would show none."""
    without = set[str]()
    for kind in KINDS:
        keys = {f.name for f in dataclasses.fields(FiveBar)}
        if kind is not FiveBar:
            keys = {f.encode_name for f in msgspec.structs.fields(kind)}
        without |= keys - set(units_of(kind))
    assert without == PURE
    assert units_of(paths.Gait)["touchdown"] == "m/s"
    assert units_of(paths.Csv)["period"] == "s"
    assert units_of(FiveBar)["inertia"] == "kg m^2"


def test_a_users_own_class_says_its_units_the_same_way() -> None:
    assert units_of(Own) == {"ramp": "s", "reach": "m", "start": "m", "stop": "m"}


# edge


def test_scenarios_and_legs_take_units(tmp_path: Path) -> None:
    leg = tmp_path / "leg.toml"
    leg.write_text('L1 = "40 mm"\nL2 = "6cm"\ntilt = "5 deg"\ndensity = "1.2 g/cm^3"\n', "utf-8")
    assert FiveBar.load(leg) == FiveBar(tilt=math.radians(5.0), name="leg")
    plain = Scenario.load("classic-ellipse", ["leg.L2=0.065", "servo.delay=0.002"])
    written = Scenario.load(
        "classic-ellipse",
        [
            "leg.L2=65 mm",
            "servo.delay=2 ms",
            'path.radii=["20 mm", 0.008]',
            "duration=4000 ms",
            "sim.timestep=1ms",
            "servo.kp=8000 mN m/rad",
        ],
    )
    assert written == plain
    rpm = Scenario.load("classic-ellipse", ["servo.limit=300 mN m", "servo.speed=60 rpm"]).servo
    assert rpm.limit == 0.3
    assert rpm.speed == pytest.approx(2.0 * math.pi)


def test_written_scenario_has_its_units(shell: Shell) -> None:
    assert (
        shell("run", "short.toml", "--set", "leg.L2=65 mm", "--out", "mine", "--quiet").status == 0
    )
    text = Path("mine/scenario.toml").read_text("utf-8")
    for line in ("L2 = 0.065  # [m]", "duration = 0.6  # [s]", "frequency = 4.0  # [Hz]"):
        assert f"\n{line}\n" in text
    assert "\nname = " not in text.split("[leg]")[0].split("# [")[-1]
    assert Scenario.load("mine/scenario.toml") == Scenario.load("short.toml", ["leg.L2=0.065"])


def test_units_change_nothing_of_a_text() -> None:
    text = 'name = "x # y"\nduration = 1.0\n\n[path]\ncentre = [\n    0.0,\n]\n[other]\nL1 = 1\n'
    said = annotated(text, {"path": paths.Circle}, {"duration": "s"})
    assert tomllib.loads(said) == tomllib.loads(text)
    assert "centre = [  # [m]" in said
    assert "L1 = 1\n" in said


# refusal


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("leg.L2=40 deg", r"\[leg\]: L2 must have one of the units nm, um, mm, m, km, cm, got '40"),
        ("servo.delay=2 mm", r"servo.delay must have one of the units us, ms, s, got '2 mm'"),
        ('path.radii=["1 mm", "2 kg"]', r"path.radii must have one of the units .*, got '2 kg'"),
        ("duration=4 mm", r"duration must have one of the units us, ms, s, got '4 mm'"),
        ("servo.kp=stiff", r"servo.kp must be a number, got 'stiff'"),
        ("servo.kp='8'", r"servo.kp must be a number, got '8'"),
        ("scene.drop=1 mm", r"\[scene\]: unknown key 'drop'"),
        ("sim.seed=1 s", r"sim.seed must be an integer, got '1 s'"),
        ("leg.L1=4000 mm", r"\[leg\]: L1 must be in \[0.001, 3\] m, got 4:"),
    ],
)
def test_refusal_of_units(setting: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^classic-ellipse: {message}"):
        Scenario.load("classic-ellipse", [setting])
