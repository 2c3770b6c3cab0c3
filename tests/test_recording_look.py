"""How a recording looks: letters that can be read, curves that nothing covers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
from recorded import LEG, ellipse, read, written

from fivebar_sim.kinematics import bases
from fivebar_sim.recording import layout
from fivebar_sim.recording.look import Look, shade
from fivebar_sim.recording.plots import Series


def test_motors_of_a_recording_have_their_letters_and_colours(tmp_path: Path) -> None:
    """The letters stand apart, outwards and above, also where both motors are at one place."""
    _, static = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 5)))
    for motor, base, side in zip("AE", bases(LEG), (-1.0, 1.0), strict=True):
        letter = static[f"/hip/letter_{motor}"]
        assert letter["Points3D:labels"] == [[motor]]
        x, _, z = letter["Points3D:positions"][0][0]
        assert side * (x - base[0]) > 3.0 * LEG.radius
        assert z - base[1] > 3.0 * LEG.radius
        red, green, blue = shade(motor)
        packed = (red << 24) + (green << 16) + (blue << 8) + 255
        # a colour would not stand out from the grey that Rerun writes on
        assert letter["Points3D:colors"] == [[0xFFFFFFFF]]
        assert static[f"/hip/{motor}"]["Cylinders3D:colors"] == [[packed]]


def test_no_legend_lies_over_the_curves() -> None:
    values = np.zeros((3, 2))
    lines = {"A": shade("A"), "E": shade("E")}
    plot = Series("torque", "Motor torques [mN m]", lines, values, np.ones(3, dtype=bool))
    view = layout.plot_view(plot, [Look()])
    legend = view.properties["PlotLegend"]
    assert isinstance(legend, rrb.PlotLegend)
    assert legend.visible is not None
    assert legend.visible.as_arrow_array().to_pylist() == [False]
