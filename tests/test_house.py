"""The house: short files and functions, rooms that import nothing heavy, exports that exist."""

from __future__ import annotations

import ast
import gc
import importlib
import importlib.util
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import house
import pytest
from hatchling.builders.wheel import WheelBuilder
from house import Edge
from hypothesis import HealthCheck, settings

import fivebar_sim
from fivebar_sim.cli.program import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(
    path
    for folder, pattern in (
        ("fivebar_sim", "**/*.py"),
        ("controllers", "**/*.py"),
        ("scripts", "*.py"),
        ("tests", "**/*.py"),
    )
    for path in (ROOT / folder).glob(pattern)
)
PURE = (
    "dynamics",
    "firmware",
    "geometry",
    "kinematics",
    "workspace",
    "kinematics.hip",
    "kinematics.leg_arrays",
    "kinematics.two_link",
    "analysis.singularity",
    "analysis.quality",
    "analysis.aspects",
    "analysis.following",
    "control.hobby",
    "paths",
    "scenario.forces",
    "logs",
    "metrics.load",
    "metrics.ground",
    "metrics.energy",
    "metrics.guards",
    "integrator",
    "scenario.scenes",
    "control.sensors",
    "control.servo",
    "control.bus",
    "control.noise",
    "control.step",
    "design",
    "design.certificate.best",
    "design.search.run",
    "tasks",
    "tasks.episodes",
)
HEAVY = {"mujoco", "rerun", "matplotlib", "scipy"}

ASKED = ("fivebar_sim.environment", "fivebar_sim.rollout", "fivebar_sim.cli.program")
"""What imports MuJoCo, and packages of extras only where someone asks for them."""

EXTRA = {"gymnasium", "dm_control", "dm_env", "warp", "mujoco_warp", "torch"}


@pytest.fixture(scope="module", autouse=True)
def trees() -> Iterator[None]:
    """Forget the trees of all files when nobody asks for them any more.

    Until then they are all kept: the collector would go through millions of nodes in vain, while
    they are made and while they are walked.
    """
    gc.disable()
    yield
    gc.enable()
    house.written.cache_clear()
    house.parsed.cache_clear()
    imports.cache_clear()


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def imports(source: str) -> list[str]:
    """Return the top-level names of all modules that a source imports, anywhere in it."""
    found = []
    for node in house.written(source):
        if isinstance(node, ast.Import):
            found += [alias.name.split(".")[0] for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.append(node.module.split(".")[0])
    return found


def examples_set(source: str) -> set[str]:
    """Return which of Hypothesis's settings a source sets anywhere, in whatever call."""
    calls = (node for node in ast.walk(house.parsed(source)) if isinstance(node, ast.Call))
    return {
        str(keyword.arg)
        for call in calls
        if getattr(call.func, "attr", getattr(call.func, "id", "")) == "settings"
        for keyword in call.keywords
    }


def exporting() -> list[str]:
    """Return the modules of the package and of controllers that have an __all__."""
    modules = []
    for path in FILES:
        parts = path.relative_to(ROOT).with_suffix("").parts
        if parts[0] in ("fivebar_sim", "controllers") and "\n__all__ = " in path.read_text("utf-8"):
            dotted = ".".join(parts).removeprefix("controllers.")
            modules.append(dotted.removesuffix(".__init__"))
    return modules


def shipped(path: Path) -> bool:
    return name(path).split("/")[0] in ("fivebar_sim", "controllers")


def test_functions_are_short_and_do_one_thing_a_line() -> None:
    for path in FILES:
        source = path.read_text(encoding="utf-8")
        most = house.MOST_IN_A_FILE if shipped(path) else house.MOST_IN_A_FILE_OF_TESTS
        assert house.long_functions(source) == [], name(path)
        assert house.length(house.parsed(source)) <= most, name(path)
        assert house.double_assignments(source) == [], name(path)


def test_long_bodies_have_air() -> None:
    sources = [path.read_text(encoding="utf-8") for path in FILES if shipped(path)]
    assert sum(len(house.dense_functions(source)) for source in sources) <= 10


def test_what_is_long_or_dense_is_seen() -> None:
    body = "\n".join("    pass" for _ in range(30))
    assert house.long_functions(f"def f():\n{body}\n") == []
    assert house.long_functions(f"class A:\n  async def f():\n{body}\n    pass\n") == ["f: 31"]
    assert house.length(ast.parse('"""Doc."""\nimport a\nif a:\n    b = 1\n')) == 2
    assert house.dense_functions(f"def f():\n{body}\n") == ["f"]
    assert house.dense_functions(f"def f():\n{body}\n\n    pass\n") == []
    assert house.double_assignments("a, b = 1, 2\na, b = b, a\na, b = c\na = 1, 2\n") == [1]
    assert {"fivebar_sim", "scripts", "tests"} <= {name(path).split("/")[0] for path in FILES}


@pytest.fixture(scope="module")
def graph() -> list[Edge]:
    return house.edges(ROOT)


def test_imports_go_down_only(graph: list[Edge]) -> None:
    """Lazy imports and those for types are counted like all others."""
    assert len(graph) > 500
    assert {edge.when for edge in graph} == {"", "lazy", "typing"}
    assert house.unplaced(graph) == []
    assert house.upward(graph) == []
    assert house.circles(graph) == []
    assert house.circles(house.between_rooms(graph)) == []


def test_upward_import_and_circle_are_seen(graph: list[Edge]) -> None:
    up = Edge("fivebar_sim.kinematics.reach", "fivebar_sim.model", "lazy")
    assert house.upward([*graph, up]) == [up]
    back = Edge("fivebar_sim.errors", "fivebar_sim.kinematics.reach", "typing")
    (circle,) = house.circles([*graph, back])
    assert {"fivebar_sim.errors", "fivebar_sim.kinematics.reach"} <= set(circle)
    source = "def f():\n    import a\nif TYPE_CHECKING:\n    import b\n"
    assert [kind for _, kind in house.statements(ast.parse(source))] == ["lazy", "typing"]


def test_top_level_and_rooms_are_small() -> None:
    sizes = house.sizes(ROOT)
    sizes["cli"] -= len(COMMANDS)
    assert sizes.pop("") <= house.MOST_AT_THE_TOP
    assert max(sizes.values()) <= house.MOST_IN_A_ROOM


IMPORTED = """import importlib, os, subprocess, sys
subprocess.run = subprocess.Popen = None
before = dict(os.environ)
for module in sys.argv[1:]:
    loaded = importlib.import_module(module)
    if module == "fivebar_sim.rollout":
        loaded.run_all([])
    assert dict(os.environ) == before
    print(module, *sys.modules)
"""


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """Return what is loaded after each of some modules, imported in turn by one new process.

    What one loads stays loaded for the next, so the first that is named is the one.
    """
    rooms = [f"fivebar_sim.{room}" for room in PURE]
    command = [sys.executable, "-W", "error", "-c", IMPORTED, *rooms, *ASKED]
    # MuJoCo itself would start a process, to look for a screen.
    env = {**os.environ, "MUJOCO_GL": "disable"}
    run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=env)
    rows = [line.split() for line in run.stdout.splitlines()]
    assert [module for module, *_ in rows] == [*rooms, *ASKED]
    return {module: set(names) for module, *names in rows}


def tops(modules: set[str]) -> set[str]:
    """Return the top-level names of modules."""
    return {module.split(".")[0] for module in modules}


def test_pure_rooms_import_nothing_heavy(loaded: dict[str, set[str]]) -> None:
    for room in PURE:
        assert not HEAVY & tops(loaded[f"fivebar_sim.{room}"]), room


def test_imports_start_and_set_nothing_and_bring_no_extra_along(
    loaded: dict[str, set[str]],
) -> None:
    """Each would be an error where they are loaded: a process that is started, a variable set."""
    for module in ASKED:
        assert "mujoco" in loaded[module]
        assert not EXTRA & tops(loaded[module]), module
        assert "fivebar_sim.warp" not in loaded[module], module


def test_only_what_has_an_extra_for_it_imports_scipy() -> None:
    """It is a seventh of what a run would have to install."""
    folders = ("fivebar_sim", "controllers")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    users = {name(path) for path in files if "scipy" in imports(path.read_text(encoding="utf-8"))}
    own = ("dynamics/motion", "sweep/points", "design/search/methods", "identify/fit")
    assert users == {f"fivebar_sim/{module}.py" for module in own}


def test_package_never_imports_controllers() -> None:
    lazy = "def f():\n    from fivebar_controllers.x import y, z\n"
    assert imports(lazy) == ["fivebar_controllers"]
    for path in (ROOT / "fivebar_sim").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        found = set(imports(source)) if "fivebar_controllers" in source else set()
        assert "fivebar_controllers" not in found, name(path)


def compile_strictly(source: str, file: str) -> None:
    """Raise SyntaxError if the compiler warns."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compile(source, file, "exec")


def test_no_file_makes_the_compiler_warn() -> None:
    for path in FILES:
        compile_strictly(path.read_text(encoding="utf-8"), name(path))
    for source in (r"x = '\d'", "assert (1, 'said')", "x = 1 is 1"):
        with pytest.raises(SyntaxError):
            compile_strictly(source, "odd.py")


def test_warnings_of_the_compiler_are_no_error_of_an_import(tmp_path: Path) -> None:
    """What others wrote is compiled at its first import, which may be in the midst of any test."""
    odd = tmp_path / "odd_escape.py"
    odd.write_text(r"x = '\d'", encoding="utf-8")
    spec = importlib.util.spec_from_file_location("odd_escape", odd)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.x == r"\d"


def test_scripts_and_tests_are_not_imported_by_what_ships() -> None:
    for path in FILES:
        if path.parent.name not in ("scripts", "tests"):
            found = set(imports(path.read_text(encoding="utf-8")))
            assert not found & {"scripts", "tests"}, name(path)


@pytest.mark.parametrize("module", exporting())
def test_every_export_exists(module: str) -> None:
    loaded = importlib.import_module(module)
    assert [each for each in loaded.__all__ if not hasattr(loaded, each)] == []


def test_package_shows_what_it_exports() -> None:
    assert set(fivebar_sim.__all__) <= set(dir(fivebar_sim))
    assert set(fivebar_sim.__all__) == {*fivebar_sim._MODULES, *fivebar_sim._HOMES}
    with pytest.raises(AttributeError, match="no attribute 'servo_of_mine'"):
        _ = fivebar_sim.servo_of_mine


def test_wheel_says_that_it_has_types() -> None:
    shipped = {file.distribution_path for file in WheelBuilder(str(ROOT)).recurse_included_files()}
    assert {"fivebar_sim/py.typed", "fivebar_controllers/py.typed"} <= shipped


def test_examples_have_no_deadline_and_repeat_unless_asked_for_others(
    pytestconfig: pytest.Config,
) -> None:
    for profile in (settings(), settings.get_profile("random")):
        assert profile.deadline is None
        assert HealthCheck.too_slow in profile.suppress_health_check
    asked = pytestconfig.getoption("--hypothesis-profile") or "repeatable"
    assert settings().derandomize == (asked == "repeatable")
    assert not settings.get_profile("random").derandomize
    assert "--long) which=--hypothesis-profile=random" in (ROOT / "scripts" / "test").read_text()


def test_no_test_has_its_own_deadline_or_draw() -> None:
    ours = "@hypothesis.settings(max_examples=3, deadline=None)\ndef f(): ..."
    assert examples_set(ours) == {"max_examples", "deadline"}
    for path in FILES:
        if path.name != "conftest.py":
            source = path.read_text(encoding="utf-8")
            own = examples_set(source) if "settings(" in source else set()
            assert not own & {"deadline", "derandomize"}, name(path)


def test_readme_fits_a_terminal() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if len(line) > 100] == []
