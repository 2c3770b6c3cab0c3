"""Commands and clocks that were read wrongly: one line each, with the mistake as a guess."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import FiveBar, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, LoopOpenError
from fivebar_sim.kinematics.commanded import check_commands
from fivebar_sim.kinematics.logged import check_closes, check_mostly
from fivebar_sim.logs.clock import check_follows

LEG = FiveBar.load("classic")
TIME = np.arange(400) / 200.0
SENT = kinematics.home(LEG)[::2] + 0.2 * np.sin(9.0 * TIME[:, None] + [0.0, 1.0])
WENT = SENT + 0.05 * np.cos(9.0 * TIME[:, None])
"""A servo that lags by 3 degrees, as soft ones do."""


def test_commands_that_are_followed_pass_also_with_rows_missing() -> None:
    check_commands(WENT, SENT, "bench.csv")
    gaps = SENT.copy()
    gaps[::3] = np.nan
    check_commands(WENT, gaps, "bench.csv")
    check_commands(WENT, np.full_like(SENT, np.nan), "bench.csv")
    # Far off, but like nothing that is known: the run shows it.
    check_commands(WENT, 3.0 * np.random.default_rng(0).standard_normal(SENT.shape), "bench.csv")


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (SENT[:, ::-1], r"exchange ctrl_A and ctrl_E"),
        (np.degrees(SENT), r"commands in degrees .* 57\.3: unit = 'deg'"),
        (np.radians(SENT), r"commands in radians .* 57\.3: unit = 'rad'"),
        (-SENT, r"sign = -1 for both"),
        (np.add(SENT, [0.9, -1.2]), r"the same offset for both"),
    ],
)
def test_commands_that_were_misread_are_refused_with_a_guess(sent: Array, said: str) -> None:
    with pytest.raises(ConfigError, match=rf"bench\.csv: .* apart \(RMS\).* a guess.*{said}"):
        check_commands(WENT, sent, "bench.csv")


@pytest.mark.parametrize(("interval", "unit"), [(5.0, "ms"), (5e3, "us"), (5e6, "ns")])
def test_times_in_another_unit_are_guessed(interval: float, unit: str) -> None:
    with pytest.raises(ConfigError, match=rf"rows are .* it is 5 ms if the times are in {unit}"):
        check_follows(interval, "bench.csv")
    check_follows(0.2, "bench.csv")


def test_a_few_poses_out_of_reach_are_forgiven_where_the_leg_is_not_known() -> None:
    wide = WENT.copy()
    wide[:20] = [np.pi, 0.0]
    short = FiveBar(L2=0.05, L3=0.05)
    with pytest.raises(LoopOpenError, match=r"cannot close in 5 % of rows: first at t = 0 s"):
        check_closes(short, TIME, wide, "bench.csv")
    check_mostly(short, TIME, wide, "bench.csv")
    wide[:60] = [np.pi, 0.0]
    with pytest.raises(LoopOpenError, match=r"bench\.csv: .*cannot close in 15 % of rows"):
        check_mostly(short, TIME, wide, "bench.csv")
    with pytest.raises(LoopOpenError, match="exchange theta_A and theta_E"):
        check_mostly(LEG, TIME, WENT[:, ::-1], "bench.csv")
