"""The same bits again: alone and together, by mj_step, in another process; and what says so."""

from __future__ import annotations

import json
import math
import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shipped import NAMES, in_short, shortened

from fivebar_sim import rollout
from fivebar_sim.files import resources
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.simulation import steps

SCRIPTS = Path(__file__).parents[1] / "scripts"
WORKER = SCRIPTS / "determinism_runs.py"


@pytest.fixture(scope="module")
def plans() -> list[Plan]:
    """Every scenario's plan, in the order of their names."""
    return [rollout.plan(shortened(name)) for name in NAMES]


@pytest.fixture(scope="module")
def alone() -> list[Result]:
    """What comes of each by itself."""
    return [in_short(name) for name in NAMES]


def same_bits(result: Result, other: Result) -> None:
    assert result.scenario == other.scenario
    assert result.record.keys() == other.record.keys()
    for key, column in result.record.items():
        np.testing.assert_array_equal(column, other.record[key], err_msg=key)


def test_two_of_each_together_on_two_threads(plans: list[Plan], alone: list[Result]) -> None:
    together = rollout.run_all([plan for each in reversed(plans) for plan in (each, each)], 2)
    for i, result in enumerate(reversed(alone)):
        same_bits(together[2 * i], result)
        same_bits(together[2 * i + 1], result)


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_by_plain_steps(alone: list[Result], every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """One mj_step after the other, as whoever has no `mujoco.batch` would write it."""
    monkeypatch.setattr(steps, "Batch", runpy.run_path(str(WORKER))["Plain"])
    for result in alone[::every]:
        same_bits(rollout.run(result.scenario), result)


def test_stand_in_has_all_that_the_package_takes_from_batch() -> None:
    module = runpy.run_path(str(WORKER))["stand_in"]()
    package = Path(rollout.__file__).parent
    lines = [line for path in package.rglob("*.py") for line in path.read_text().splitlines()]
    begin = "from mujoco.batch import "
    taken = [line.strip().removeprefix(begin) for line in lines if line.strip().startswith(begin)]
    names = {name.strip() for each in taken for name in each.split(",")}
    assert "Batch" in names
    assert not names - set(vars(module))


@pytest.mark.long
def test_other_processes() -> None:
    def run(seed: str, *options: str) -> Any:
        command = [sys.executable, str(WORKER), *options]
        known = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(command, env=known, capture_output=True, check=True)
        return json.loads(done.stdout)

    first = run("0")
    assert sorted(first) == sorted(resources.shipped("scenarios"))
    assert len({each["bits"] for each in first.values()}) == len(first)
    assert run("1") == first
    assert run("2", "--plain") == first


# what scripts/determinism.py makes of it


def runs(value: float | None, bits: str = "") -> dict[str, Any]:
    metrics = {"tracking.rms": (value, 1e-6), "load.saturated.A": (0.0, 0.0)}
    return {"one": {"metrics": {k: (0.0, 1.0) for k in metrics}, "bits": ""},
            "two": {"metrics": metrics, "bits": bits}}  # fmt: skip


def test_what_moves_most_is_named() -> None:
    script = runpy.run_path(str(SCRIPTS / "determinism.py"))
    (moved, still) = script["compared"](runs(1e-3), runs(1.0005e-3))
    assert (moved.key, moved.scenario, still.part) == ("tracking.rms", "two", 0.0)
    assert moved.part == pytest.approx(0.5)
    assert script["compared"](runs(1e-3), runs(None))[0].part == math.inf


@pytest.mark.parametrize(("there", "status"), [(1.0005e-3, 0), (1.002e-3, 1), (None, 1)])
def test_beyond_the_tolerance_is_status_1(
    capsys: pytest.CaptureFixture[str], there: float | None, status: int
) -> None:
    main = runpy.run_path(str(SCRIPTS / "determinism.py"))["main"]
    main.__globals__["measured"] = lambda _, plain, settings=None: (
        runs(there, "x") if plain else runs(1e-3)
    )
    main.__globals__["processors"] = dict  # the next test
    assert main([]) == status
    said = capsys.readouterr().out
    assert "plain mj_step, here: 1 of 2 scenarios have the same bits" in said
    assert ("beyond the tolerance: two (tracking.rms)" in said) == bool(status)


@pytest.mark.parametrize("moved", [1.0005e-3, 1.002e-3])
def test_older_processor_is_compared_too(capsys: pytest.CaptureFixture[str], moved: float) -> None:
    main = runpy.run_path(str(SCRIPTS / "determinism.py"))["main"]
    main.__globals__["processors"] = lambda: {"oldest": {"FEATURES": "off"}}
    main.__globals__["measured"] = lambda _, plain, settings=None: (
        runs(moved, "x") if settings == {"FEATURES": "off"} else runs(1e-3)
    )
    assert main([]) == int(moved > 1.001e-3)
    assert "processor: oldest: 1 of 2 scenarios have the same bits" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "status"),
    [
        ({"NPY_DISABLE_CPU_FEATURES": "AVX"}, 1),
        ({"OPENBLAS_CORETYPE": "x"}, 1),
        ({"GLIBC_TUNABLES": "glibc.cpu.hwcaps="}, 1),
        ({}, 0),
    ],
)
def test_setting_without_effect_is_status_1(
    monkeypatch: pytest.MonkeyPatch, asked: dict[str, str], status: int
) -> None:
    verify = runpy.run_path(str(SCRIPTS / "determinism_processor.py"))["verify"]
    verify.__globals__["dispatched"] = lambda: ["AVX"]
    verify.__globals__["libm_under"] = lambda tunables: "digest"
    verify.__globals__["libm"] = lambda: "digest"  # no setting takes effect
    for name in ("NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE", "GLIBC_TUNABLES"):
        monkeypatch.delenv(name, raising=False)
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    assert verify() == status


def test_another_process_computes_the_same_sines() -> None:
    script = runpy.run_path(str(SCRIPTS / "determinism_processor.py"))
    here = os.environ.get(script["LIBC"], "")  # set to stand in for an older processor
    assert script["libm_under"](here) == script["libm"]()


def test_version_that_does_not_exist_is_one_line() -> None:
    script = runpy.run_path(str(SCRIPTS / "determinism.py"))
    with pytest.raises(script["UnusableError"], match=r"^no such thing: "):
        script["call"]("no such thing", sys.executable, "-c", "raise SystemExit('why')")


# limits set anew

FILE = """[path]
closure.max = 9.0 # of no limits table

[limits]
tracking.rms = 2e-3              # [m], loose
closure.max = 1.05e-6            # [m], tight
load.share_A = [0.1, 0.9]
load.saturated.A = 0.5
"""


def test_only_loose_limits_are_set_anew(capsys: pytest.CaptureFixture[str]) -> None:
    script = runpy.run_path(str(SCRIPTS / "limits.py"))
    low = -math.inf
    limits = [
        rollout.Limit("tracking.rms", low, 2e-3, 1e-3, ok=True),
        rollout.Limit("closure.max", low, 1.05e-6, 1e-6, ok=True),
        rollout.Limit("load.share_A", 0.1, 0.9, 0.5, ok=True),
        rollout.Limit("load.saturated.A", low, 0.5, 0.0, ok=True),
    ]
    changed = script["rewritten"](FILE, limits).splitlines()
    assert changed[:4] == FILE.splitlines()[:4]
    assert changed[4:] == [
        "tracking.rms = 1.05e-3              # [m], loose",
        "closure.max = 1.05e-6            # [m], tight",
        "load.share_A = [0.475, 0.525]",
        "load.saturated.A = 0",
    ]
    assert "tracking.rms: 2e-3 -> 1.05e-3" in capsys.readouterr().out
