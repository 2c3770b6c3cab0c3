"""A kind of path that another package brings: one file and an entry point."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from fivebar_sim import paths
from fivebar_sim.errors import ConfigError
from fivebar_sim.scenario import Scenario

ROSE = """
import numpy as np

from fivebar_sim.paths.base import Cyclic, Pair, Sample


class Rose(Cyclic, frozen=True, tag="rose"):
    centre: Pair
    size: float

    def nominal(self, time):
        turns = 1j * np.pi * self.frequency * np.array([4.0, -2.0])
        petals = 0.5 * self.size * np.exp(turns * np.asarray(time)[..., None])
        rates = [(petals * turns**k).sum(axis=-1) for k in range(3)]
        position, velocity, acceleration = (np.stack([r.real, r.imag], axis=-1) for r in rates)
        return Sample(position + self.centre, velocity, acceleration)


class Unnamed:
    pass
"""
KEYS = "path={kind='rose',centre=[0.0,-0.075],size=0.012,frequency=2.0,ramp=0.1}"

Plug = Callable[[str, str], None]


@pytest.fixture
def plug(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Plug]:
    """Give a function that installs the file above under one entry point."""

    def install(name: str, value: str) -> None:
        site = tmp_path / "site"
        info = site / "strangers-1.0.dist-info"
        info.mkdir(parents=True)
        (site / "strangers.py").write_text(ROSE, encoding="utf-8")
        (info / "METADATA").write_text("Name: strangers\nVersion: 1.0\n", encoding="utf-8")
        text = f"[fivebar_sim.paths]\n{name} = {value}\n"
        (info / "entry_points.txt").write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(site)

    yield install
    sys.modules.pop("strangers", None)  # the next test has a file of its own


def test_a_scenario_names_it_and_its_run_directory_is_read_again(shell: Shell, plug: Plug) -> None:
    plug("rose", "strangers:Rose")
    assert shell("run", "short.toml", "--set", KEYS, "--out", "run").status == 0
    again = Scenario.load("run/scenario.toml")
    assert type(again.path).__name__ == "Rose"
    target = again.path.at(np.array([0.1])).position[0]
    # half a ramp late: at 50 ms both arms of the rose have turned by 0.4 pi and -0.2 pi
    arms = 0.006 * (np.exp(0.4j * np.pi) + np.exp(-0.2j * np.pi))
    assert target == pytest.approx([arms.real, arms.imag - 0.075], abs=1e-12)


def test_a_change_of_kind_keeps_the_keys_that_both_have(plug: Plug) -> None:
    plug("rose", "strangers:Rose")
    changes = ["path.kind=rose", "path.size=0.01", "limits={}"]
    changed = Scenario.load("classic-ellipse", changes).table()["path"]
    before = Scenario.load("classic-ellipse").table()["path"]
    assert "radii" in before.keys() - changed.keys()
    assert (changed["centre"], changed["frequency"]) == (before["centre"], before["frequency"])
    assert changed["size"] == 0.01


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("ellipse", "strangers:Rose", "has the name of a shipped kind"),
        ("tulip", "strangers:Rose", "must have its name as tag, got 'rose'"),
        ("rose", "strangers:Unnamed", "must be a FootPath, got <class"),
        ("rose", "strangers:Missing", "cannot load path 'rose' from strangers:Missing"),
    ],
)
def test_what_is_no_kind_is_refused(plug: Plug, name: str, value: str, said: str) -> None:
    plug(name, value)
    with pytest.raises(ConfigError, match=said):
        paths.kinds()
