"""`fivebar import`: what is no planar five-bar leg is refused in a line; the command itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from shell import Shell

from fivebar_sim import FiveBar
from fivebar_sim.errors import ConfigError
from fivebar_sim.formats.incoming.understood import understand

SOURCES = Path(__file__).parent / "sources"

CHANGES = {
    # A connect at another place beside the loop's.
    "two closed loops": (
        "doggo.xml",
        "</equality>",
        '<connect name="other" body1="outer" body2="inner" anchor="0 0 0"/></equality>',
        "has 2 closed loops, equality 0, other: a leg has one; name it with --loop",
    ),
    "none": (
        "doggo.xml",
        '<connect body1="shin_0" body2="shin_1" anchor="-0.006 0.162 0"/>',
        "",
        "has no closed loop: no equality connect or weld of two bodies",
    ),
    "a tilted knee": (
        "q8bot.xml",
        '<joint name="rear_knee" type="hinge" axis="0 1 0"/>',
        '<joint name="rear_knee" type="hinge" axis="0.02 1 0"/>',
        "is not planar: the axis of rear_knee is 1.15 deg off that of ",
    ),
    "a gap across": (
        "q8bot.xml",
        '<site name="pin_rear" pos="0.04 0 0"/>',
        '<site name="pin_rear" pos="0.04 0.003 0"/>',
        "is not planar: what pin joins is 3 mm apart across the plane, at most 0.0065 mm",
    ),
    "no motors": (
        "doggo.xml",
        '<motor joint="motor_0"/>\n    <motor joint="motor_1"/>',
        "",
        "no motors in the loop of motor_0, knee_0, equality 0, knee_1, motor_1; name the two with",
    ),
    "three motors": (
        "doggo.xml",
        '<motor joint="motor_1"/>',
        '<motor joint="motor_1"/><motor joint="knee_0"/>',
        "more than two motors in the loop of ",
    ),
    "a driven knee": (
        "doggo.xml",
        '<motor joint="motor_1"/>',
        '<motor joint="knee_1"/>',
        "both motors must turn against the ground, axle, and those at motor_0 and knee_1 do not",
    ),
    "a motor on a link": (
        "doggo.xml",
        '<motor joint="motor_1"/>',
        '<motor joint="knee_0"/>',
        "both motors must turn against the ground, axle, and those at motor_0 and knee_0 do not",
    ),
    "a missing mesh": (
        "doggo.xml",
        "<worldbody>",
        '<asset><mesh name="m" file="not_there.stl"/></asset><worldbody>',
        "MuJoCo cannot compile it: Error: Error opening file",
    ),
    "four hinges": (
        "minitaur.xml",
        '<joint name="pin"/>',
        "",
        "a five-bar has five hinges around its loop, this one has 4: motor_l, knee_l,",
    ),
    "a slide": (
        "doggo.xml",
        '<joint name="knee_0" axis="1 0 0"/>',
        '<joint name="knee_0" axis="1 0 0" type="slide"/>',
        "body 'shin_0' must move by one hinge, got slide",
    ),
    "millimetres": (
        "q8bot.xml",
        '<body name="rear_rod" pos="0.025 0 0"',
        '<body name="rear_rod" pos="25 0 0"',
        "L1 must be in [0.001, 3] m, got 25: lengths are in metres; did you mean 0.025?",
    ),
    "no length": (
        "doggo.xml",
        '<body name="shin_1" pos="0.004 0.09 0"',
        '<body name="shin_1" pos="0.004 0 0"',
        "the link between motor_1 and knee_1 must be longer than 0 m, got 0 m",
    ),
    "not finite": (
        "infantry.xml",
        '<body name="frame" pos="0 0.2 -0.02">',
        '<body name="frame" pos="0 inf -0.02">',
        "a number is not finite: body_pos of the compiled model",
    ),
    "a beam": (
        "doggo.xml",
        "</equality>",
        '<connect body1="shin_0" body2="shin_1" anchor="0 0.1 0"/></equality>',
        "equality 1 joins the links of equality 0 62 mm beside it: they cannot turn",
    ),
}
"""What is changed in a file, and what is then said."""


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_no_leg_is_refused_in_a_line(change: str, tmp_path: Path) -> None:
    file, old, new, said = CHANGES[change]
    text = (SOURCES / file).read_text("utf-8")
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new), "utf-8")
    with pytest.raises(ConfigError) as refused:
        understand(tmp_path / file)
    message = str(refused.value)
    assert said in message
    assert message.startswith(str(tmp_path / file))
    assert "\n" not in message


def test_command(shell: Shell) -> None:
    file = str(SOURCES / "minitaur.xml")
    said = shell("import", file, "--out", "m.toml", "--picture", "m.svg")
    assert said.status == 0
    assert "B-C 199 mm" in said.out
    assert "not taken over: knee_r: its damping" in said.out
    assert "upper_l, bracket_l" in said.out
    drawn = Path("m.svg").read_text("utf-8")
    assert all(word in drawn for word in ("A: motor_l", "D: knee_r", "199 mm", "geom foot_pad"))
    assert FiveBar.load("m.toml").L6 == 0.0325
    assert shell.refused("import", file, "--out", "m.txt").endswith("must end in .toml")
    assert shell.refused("import", file, "--picture", "m.gif").endswith(".svg, .png, .pdf")
    assert "takes two names" in shell.refused("import", file, "--motors", "A")
    assert "cannot read" in shell.refused("import", "nothing.xml")
    Path("short.urdf").write_text("<robot name='x'/>")
    assert "needs a YAML of closures" in shell.refused("import", "short.urdf")
    Path("short.yaml").write_text("closed_loop: [[a, b]]\ntype: [5d]")
    assert "type must be one of 3d, 6d" in shell.refused("import", "short.urdf")
    assert "is not XML" in shell.refused("import", "short.yaml")
