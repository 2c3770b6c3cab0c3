"""The pytest plugin: the fixture `leg_run`, which keeps the runs of a test that fails.

pytest loads this file every time, so heavy imports wait until a test asks for the fixture.
"""

from __future__ import annotations

import hashlib
import inspect
import re
import shutil
from collections.abc import Generator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pluggy import Result as Outcome

    from fivebar_sim.regression.leg_run import LegRunner
    from fivebar_sim.rollout import Result

RUNS: pytest.StashKey[list[Result]] = pytest.StashKey()
"""The runs of a test, until it ends."""

SHARED: pytest.StashKey[dict[str, list[Result]]] = pytest.StashKey()
"""The session's runs of fixtures that several tests share, by the fixture's name; until it ends."""

NOW: pytest.StashKey[Now] = pytest.StashKey()
"""What the session is busy with."""


class Now:
    """Whose runs those are that are made now.

    Attributes:
        item: The test, in its set-up, call or teardown.
        fixtures: Name and folder of the shared fixtures that are being set up, innermost last.
    """

    def __init__(self) -> None:
        self.item: pytest.Item | None = None
        self.fixtures: list[tuple[str, Path]] = []


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


@pytest.fixture(scope="session")
def leg_run(request: pytest.FixtureRequest) -> LegRunner:
    """Run scenarios: `leg_run("trot.toml", controller=Mine()).assert_limits()`.

    A fixture of any scope may use it. The runs of a failed test, and of the shared fixtures that it
    uses, are kept under --fivebar-artifacts, with pictures of foot tracking.
    """
    from fivebar_sim.regression.leg_run import LegRunner

    stash = request.config.stash
    now = stash.setdefault(NOW, Now())
    shared = stash.setdefault(SHARED, {})

    def place() -> tuple[Path, list[Result]]:
        # Whoever calls it is within a test's set-up, call or teardown.
        assert now.item is not None
        if now.fixtures:
            name, folder = now.fixtures[-1]
            return folder, shared.setdefault(name, [])
        return now.item.path.parent, now.item.stash.setdefault(RUNS, [])

    return LegRunner(place)


# Not `wrapper=True`: with a pluggy before 1.2 that would end every session at its start.
@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None]:
    """Remember which test runs, and forget what it kept at an earlier failure."""
    item.config.stash.setdefault(NOW, Now()).item = item
    if "leg_run" in getattr(item, "fixturenames", ()):
        _clear(_folder(item))
    yield


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(
    fixturedef: pytest.FixtureDef[object], request: pytest.FixtureRequest
) -> Generator[None]:
    """Remember whose set-up runs: what a shared fixture runs is of all tests that use it."""
    now = request.config.stash.setdefault(NOW, Now())
    # What is no function, as a class with a call, has no file.
    plain = hasattr(inspect.unwrap(fixturedef.func), "__code__")
    shared = fixturedef.scope != "function" and plain
    if shared:
        # A fixture of a conftest.py has its scenarios beside that.
        file = inspect.unwrap(fixturedef.func).__code__.co_filename
        now.fixtures.append((fixturedef.argname, Path(file).parent))
    yield
    if shared:
        now.fixtures.pop()


def pytest_fixture_post_finalizer(
    fixturedef: pytest.FixtureDef[object], request: pytest.FixtureRequest
) -> None:
    """Forget the runs of a shared fixture at its end."""
    request.config.stash.get(SHARED, {}).pop(fixturedef.argname, None)


@pytest.hookimpl(hookwrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, Outcome]:
    """Keep the runs of a failed test and report where; forget them when the test ends."""
    outcome = yield
    report = outcome.get_result()
    own = item.stash.get(RUNS, [])
    if report.failed:
        kept = [_keep(result, _folder(item), item.config) for result in [*own, *_shared(item)]]
        if kept:
            report.sections.append(("runs of the leg", "\n".join(line for line, _ in kept)))
        # These are in JUnit's file too, which shows no sections.
        places = [("fivebar_run", place) for _, place in kept if place]
        item.user_properties.extend(places)
    # A test can fail in its call and again in its teardown: its runs are written once.
    if report.failed or call.when == "teardown":
        own.clear()


def _shared(item: pytest.Item) -> list[Result]:
    """Return the runs of the shared fixtures that a test uses, if it has not kept them yet."""
    if any(name == "fivebar_run" for name, _ in item.user_properties):
        return []
    found = item.config.stash.get(SHARED, {})
    names = getattr(item, "fixturenames", ())
    return [result for name in names for result in found.get(name, [])]


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


def _keep(result: Result, folder: Path, config: pytest.Config) -> tuple[str, str]:
    """Write a run directory with its pictures; return a line that says where it is, and where.

    The place is "" where it cannot be written.
    """
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
        return f"{name}: {result.verdict}, but cannot all be kept in {shown}: {error}", ""
    return f"{name}: {result.verdict}, kept in {shown} ({', '.join(files)})", str(shown)


def _draw(result: Result, place: Path) -> list[str]:
    """Write the pictures of the foot's path and of its error; return their names.

    Of a robot those of its path from above, and of all feet's errors.
    """
    from fivebar_sim.report import in_plane, look, over_time, robot_figures
    from fivebar_sim.robots.columns import trunk
    from fivebar_sim.robots.scenario import RobotScenario
    from fivebar_sim.runs.stored import StoredRun

    run = StoredRun(place, result.scenario, result.record, result.measured)
    names = []
    with look.project_style():
        if isinstance(result.scenario, RobotScenario):
            body = trunk(result.record)
            above = [] if body is None else [robot_figures.from_above(run, body)]
            figures = [*above, robot_figures.errors(run)]
        else:
            figures = [in_plane.foot_path(run), over_time.tracking_error(run)]

        for drawn in figures:
            names.append(f"{drawn.key}.png")
            (place / names[-1]).write_bytes(look.png(drawn.figure))
    return names
