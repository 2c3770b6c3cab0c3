"""What headers say of a leg: its preset, and every number in which it differs from it."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from shell import ELLIPSE, Shell

from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario.leg_words import UNITS, leg_words

CLASSIC = FiveBar.load("classic")


@pytest.mark.parametrize("name", resources.shipped("models/legs"))
def test_a_preset_is_its_name(name: str) -> None:
    assert leg_words(FiveBar.load(name)) == f"{name} leg"


@pytest.mark.parametrize(
    ("leg", "words"),
    [
        (replace(CLASSIC, L2=0.07), "classic leg, L2 = 70 mm"),
        (replace(CLASSIC, L2=0.07, L3=0.0655), "classic leg, L2 = 70 mm, L3 = 65.5 mm"),
        (replace(CLASSIC, tilt=np.pi / 6), "classic leg, tilt = 30 deg"),
        (replace(CLASSIC, gravity=(0.0, -1.62)), "classic leg, gravity = (0, -1.62) m/s2"),
        (replace(CLASSIC, armature=2e-5), "classic leg, armature = 20000 g mm2"),
        (replace(CLASSIC, L2=0.07, name="mine"), "mine leg"),
        (FiveBar(L2=0.07), "custom leg, L2 = 70 mm"),
        (
            replace(CLASSIC, L1=0.041, L2=0.07, L3=0.07, L4=0.041, L5=0.02, radius=0.003),
            "classic leg, L1 = 41 mm, L2 = 70 mm, L3 = 70 mm, L4 = 41 mm, and 2 more",
        ),
    ],
)
def test_differences_are_told_with_their_units(leg: FiveBar, words: str) -> None:
    assert leg_words(leg) == words


def test_every_number_of_a_leg_has_a_unit_or_needs_none() -> None:
    plain = {"mode", "assembly", "name", "scale"}
    assert {field.name for field in dataclasses.fields(FiveBar)} == plain | UNITS.keys()


def test_console_says_what_differs(shell: Shell) -> None:
    (shell.folder / "short.toml").write_text(ELLIPSE, encoding="utf-8")
    said = shell("run", "short.toml", "--set", "leg={preset='classic',L2=0.062}")
    assert said.out.splitlines()[0].strip() == (
        "short: classic leg, L2 = 62 mm; window 0.1 to 0.6 s"
    )


def test_a_rotor_that_came_with_the_servo_is_no_difference() -> None:
    leg = replace(CLASSIC, armature=2e-5)
    assert leg_words(leg, 2e-5) == "classic leg"
    assert leg_words(leg, 3e-5) == leg_words(leg) == "classic leg, armature = 20000 g mm2"
