"""The pytest plugin: the fixture `leg_run`, which keeps the runs of a test that fails.

pytest loads this file every time, so heavy imports wait until a test asks for the fixture.
"""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Generator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fivebar_sim.regression.leg_run import LegRunner
    from fivebar_sim.rollout import Result

RUNS: pytest.StashKey[list[Result]] = pytest.StashKey()
"""The runs of a test, until it ends."""

PLAIN = re.compile(r"(?:\w+/)*\w+\.py(?:::\w+)+")
"""Test ids that stay unique when they are turned into a folder's name."""

LONGEST = 120
"""Longest name of a test's folder, without the hash that makes it unique."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --fivebar-artifacts."""
    parser.getgroup("fivebar", "foot tracking").addoption(
        "--fivebar-artifacts",
        metavar="DIR",
        default="fivebar-artifacts",
        help="where the runs of a failed test are kept, relative to rootdir (%(default)s)",
    )


@pytest.fixture
def leg_run(request: pytest.FixtureRequest) -> LegRunner:
    """Run scenarios: `leg_run("trot.toml", controller=Mine()).assert_limits()`.

    The runs of a failed test are kept under --fivebar-artifacts, with pictures of foot tracking.
    """
    from fivebar_sim.regression.leg_run import LegRunner

    _clear(_folder(request.node))
    return LegRunner(request.path.parent, request.node.stash.setdefault(RUNS, []))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep the runs of a failed test and report where; forget them when the test ends."""
    report = yield
    runs = item.stash.get(RUNS, [])
    if report.failed and runs:
        lines = [_keep(result, _folder(item), item.config) for result in runs]
        report.sections.append(("runs of the leg", "\n".join(lines)))
    # A test can fail in its call and again in its teardown: its runs are written once.
    if report.failed or call.when == "teardown":
        runs.clear()
    return report


def _folder(item: pytest.Item) -> Path:
    """Return the folder for the runs of a test that fails."""
    artifacts = str(item.config.getoption("fivebar_artifacts"))
    return item.config.rootpath / artifacts / name_of(item.nodeid)


def name_of(nodeid: str) -> str:
    """Return the name of a test's folder: a plain file name, unique to the test."""
    name = re.sub(r"[^\w.]+", "-", nodeid)
    if PLAIN.fullmatch(nodeid) and len(name) <= LONGEST:
        return name
    # Parameters may differ only in characters that no file name has, or past the cut.
    own = hashlib.sha256(nodeid.encode("utf-8", "backslashreplace")).hexdigest()[:10]
    return f"{name[:LONGEST].strip('-.')}-{own}"


def _clear(folder: Path) -> None:
    """Delete the runs of an earlier failure of a test; anything else stays."""
    if not folder.is_dir():
        return
    from fivebar_sim.runs import directory

    for place in folder.iterdir():
        if directory.is_run(place) and not place.is_symlink():
            shutil.rmtree(place)
    if not any(folder.iterdir()):
        folder.rmdir()


def _keep(result: Result, folder: Path, config: pytest.Config) -> str:
    """Write a run directory with its pictures; return a line that says where it is."""
    name = result.scenario.name
    places = (folder / (f"{name}-{number}" if number > 1 else name) for number in count(1))
    place = next(place for place in places if not place.exists())
    here = config.invocation_params.dir
    shown = place.relative_to(here) if place.is_relative_to(here) else place
    try:
        result.write(place)
        files = ["recording.rrd", *_draw(result, place)]
    # An error raised in a hook would end the whole pytest session.
    except Exception as error:
        return f"{name}: {result.verdict}, but cannot all be kept in {shown}: {error}"
    return f"{name}: {result.verdict}, kept in {shown} ({', '.join(files)})"


def _draw(result: Result, place: Path) -> list[str]:
    """Write the pictures of the foot's path and of its error; return their names."""
    from fivebar_sim.report import in_plane, look, over_time
    from fivebar_sim.runs.stored import StoredRun

    run = StoredRun(place, result.scenario, result.record, result.measured)
    names = []
    with look.project_style():
        for drawn in (in_plane.foot_path(run), over_time.tracking_error(run)):
            names.append(f"{drawn.key}.png")
            (place / names[-1]).write_bytes(look.png(drawn.figure))
    return names
