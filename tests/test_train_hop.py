"""The search and the measure of scripts/train_hop.py."""

from __future__ import annotations

import runpy
import socket
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from fivebar_sim import rollout
from fivebar_sim.workers import cluster
from fivebar_sim.workers.here import Here

SCRIPT = Path(__file__).parents[1] / "scripts" / "train_hop.py"


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(SCRIPT))


def test_search_finds_the_top_of_a_long_ridge(script: dict[str, Any]) -> None:
    """An ellipsoid of axes 1 to 1000, which needs C: steps of one length take 10^4 generations."""
    scale = np.logspace(0.0, 3.0, 6)
    top = np.arange(6.0)
    search = script["Cma"](6, 12, 0.5, np.random.default_rng(0))
    for _ in range(400):
        x = search.ask()
        assert x.shape == (12, 6)
        search.tell(-((scale * (x - top)) ** 2).sum(axis=1))
    np.testing.assert_allclose(search.mean, top, rtol=0.0, atol=1e-6)
    assert search.sigma < 1e-3


def test_a_few_generations_hop_higher_and_again_alike(
    script: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second time in blocks, as on a cluster."""
    monkeypatch.setitem(script["train"].__globals__, "LEGS", 24)
    first = list(script["train"](3, 5, duration=0.4))
    again = list(script["train"](1, 5, duration=0.4, workers=Here()))
    assert first[-1].average > first[0].average + 0.05
    assert first[-1].best > first[0].best
    for one, other in zip(first[:1], again, strict=True):
        assert one[:4] == other[:4]
        np.testing.assert_array_equal(one.mean, other.mean)


def test_cluster_that_does_not_answer_is_one_line(
    script: dict[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: name)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        free = listening.getsockname()[1]
    for address, line in (
        (f"127.0.0.1:{free}", f"no Ray cluster answers at 127.0.0.1:{free}: Connection refused"),
        ("cluster", "--ray takes HOST:PORT of a Ray cluster, got 'cluster'"),
    ):
        monkeypatch.setattr(sys, "argv", ["train_hop.py", "--ray", address])
        with pytest.raises(SystemExit, match="2"):
            script["main"]()
        assert capsys.readouterr() == ("", f"error: {line}\n")


def test_hop_path_is_the_scenarios(script: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Two hops of it."""
    monkeypatch.setitem(script["on_path"].__globals__, "SHOWN", 1.0)
    rail = msgspec.structs.replace(script["RAIL"], duration=1.0)
    played = script["on_path"](rail.servo)
    record = rollout.run(rail).record
    np.testing.assert_array_equal(played.hip_z[:, 0], record["hip_z"])
