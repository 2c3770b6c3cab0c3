"""Fixtures of all tests, and how Hypothesis draws its examples in all of them."""

from __future__ import annotations

import gc
import importlib
import os
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shared
from _pytest.runner import runtestprotocol
from hypothesis import HealthCheck, settings
from shell import CSV, JUDGED, Shell

from fivebar_sim.cli import arrow
from fivebar_sim.files import exchange
from fivebar_sim.runs import coarse

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler.loadfile import LoadFileScheduling

# An ordinary run draws the same examples every time; ./scripts/test --long asks for "random".
# Neither judges how long an example takes: that is the machine's load, not the code's fault.
settings.register_profile(
    "repeatable",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
    max_examples=40,
)
settings.register_profile(
    "random", settings.get_profile("repeatable"), derandomize=False, max_examples=400
)
settings.load_profile("repeatable")

# Until all is collected: what is imported stays, and the collector would go through it in vain.
gc.disable()


def pytest_collection(session: pytest.Session) -> None:
    """Have each worker of xdist import its own share of all test modules first.

    pytest rewrites their assertions and keeps what it compiled: half of what collecting takes in a
    fresh clone. From one end, all workers would do all of that side by side.

    Every worker imports all of them, so what few of them need of SciPy they import where they use
    it, and pandas is imported by the tests of data frames alone.
    """
    arrow.leave_pandas_out()
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    here = Path(__file__).parent
    if [Path(each).resolve() for each in session.config.args] != [here]:
        return
    names = sorted(path.stem for path in here.glob("test_*.py"))
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    own = names[len(names) * int(worker.removeprefix("gw")) // workers :]
    for name in own:
        # pytest imports it again, and says what is wrong.
        with suppress(Exception, pytest.skip.Exception):
            importlib.import_module(name)


def pytest_collection_finish() -> None:
    """Keep the collector from going through all that was imported and collected, again and again.

    Hardly any of it will ever be garbage, and it is a million objects: even to look through them
    once, for what little could go, takes longer than most tests.
    """
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """Give one worker all tests that need a browser, so that they share it."""
    from xdist.scheduler.loadfile import LoadFileScheduling

    class Together(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return str(Path(file).parent) if "in_browser" in file else file

    return Together(config, log) if config.getoption("dist") == "loadfile" else None


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Have a worker of xdist send of a test that passes what came of it, and no more.

    Else it also sends that the test begins, is set up and is torn down: four messages, which take
    workers and who started them as long as a short test does. Whoever asks for every duration, or
    for JUnit's file, gets all of them.
    """
    timed = item.config.getoption("durations") is not None
    if timed or item.config.getoption("xmlpath") or "PYTEST_XDIST_WORKER" not in os.environ:
        return None

    for report in runtestprotocol(item, log=False, nextitem=nextitem):
        if report.when == "call" or not report.passed:
            item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


@pytest.fixture(scope="session", autouse=True)
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Tell `shared` where the processes that run the tests together meet, if there are several."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared.folders.append(tmp_path_factory.getbasetemp().parent)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240607)


@pytest.fixture(scope="session")
def right() -> ModuleType:
    """Return the controller of leg_programs that knows nothing of the package."""
    programs = str(Path(__file__).with_name("leg_programs"))
    sys.path.insert(0, programs)
    try:
        return importlib.import_module("right")
    finally:
        sys.path.remove(programs)


@pytest.fixture
def quick_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have programs that are started find no pandas, which the least set-up lacks too, and no GL.

    MuJoCo would import the one for a screen, which takes a fifth of its import; `render.gl` finds
    its own.
    """
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).with_name("without_pandas")))
    monkeypatch.setenv("MUJOCO_GL", "disable")


@pytest.fixture
def shell(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    quick_start: None,
) -> Shell:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(JUDGED, encoding="utf-8")
    (tmp_path / "foot.csv").write_text(CSV, encoding="utf-8")
    return Shell(tmp_path, capsys)


@pytest.fixture
def two_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a system that cannot exchange two directories in one step."""
    monkeypatch.setattr(exchange, "exchange", lambda one, other: False)


@pytest.fixture
def light(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write no recording but its first bytes, and take no run again in shorter steps.

    Where the directory goes is what is asked.
    """
    write = "fivebar_sim.recording.rrd.write"
    monkeypatch.setattr(write, lambda path, *run: path.write_bytes(b"RRF2"))
    monkeypatch.setattr(coarse, "warnings", lambda result, again: [])
