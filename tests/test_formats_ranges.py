"""The ranges of a source's joints, which `fivebar import` names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fivebar_sim.formats.incoming import preset
from fivebar_sim.formats.incoming.understood import understand
from fivebar_sim.kinematics.planar import wrap

SOURCES = Path(__file__).parent / "sources"


@pytest.mark.parametrize(
    ("file", "count"), [("q8bot.urdf", 4), ("minitaur.urdf", 4), ("chain.xml", 0)]
)
def test_ranges_of_joints_are_named_with_every_digit(file: str, count: int) -> None:
    """Their ends are the leg's angles where the source's own joint has its ends."""
    seen = understand(SOURCES / file)
    model = seen.source.model
    told = "^(.*): its range, theta_(.) in \\[(.*), (.*)\\] rad, is not of a leg"
    found = [re.match(told, each) for each in preset.notes(seen)]
    ranges = [each.groups() for each in found if each]
    assert len(ranges) == count
    for name, letter, *ends in ranges:
        joint = model.joint(name)
        read = []
        for end in joint.range:
            pose = seen.source.poses[0].copy()
            pose[joint.qposadr] = end
            read.append(seen.angles(pose)["ABED".index(letter)])
        low, high = map(float, ends)
        assert high - low == pytest.approx(np.ptp(joint.range), abs=1e-12)
        np.testing.assert_allclose(
            np.sort(wrap(np.array(read))), np.sort(wrap(np.array([low, high]))), rtol=0, atol=1e-12
        )
    text = preset.text(seen)
    assert all(f"#   {each}" in text for each in preset.notes(seen))
