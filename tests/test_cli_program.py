"""The command `fivebar` as a program: its status and output, its start, and what interrupts it."""

from __future__ import annotations

import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from shell import JUDGED, LIGHT, Shell

from fivebar_sim import __version__
from fivebar_sim.cli import program as fivebar
from fivebar_sim.render import gl

DIVERGING = ["--set", "sim.integrator=implicitfast", "--set", "sim.timestep=0.02"]


FIVEBAR = str(Path(sys.executable).with_name("fivebar"))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, quick_start: None) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(JUDGED, encoding="utf-8")
    return tmp_path


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def program(*args: str) -> tuple[int, str, str]:
    """Return status, stdout and stderr of a command."""
    done = subprocess.run([FIVEBAR, *args], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_program_runs_and_fails_as_its_function_does(folder: Path) -> None:
    assert program("--version") == (0, f"fivebar-sim {__version__}\n", "")
    before = names(folder)
    for args, status in ((["--set", "leg.L1=0"], 2), (DIVERGING, 1)):
        came, out, err = program("run", "short.toml", *args)
        assert (came, out, err.count("\n")) == (status, "", 1)
    assert names(folder) == before  # no run directory, and no log of MuJoCo's


def test_output_suits_its_reader(folder: Path) -> None:
    odd = ["run", "short.toml", "--set", "leg.name=é", "--out", "mine"]
    code = LIGHT + "from fivebar_sim.cli import main\nsys.exit(main())"  # a whole run
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-c", code, *odd]
    done = subprocess.run(command, capture_output=True, text=True, env=ascii_only)
    assert (done.returncode, done.stderr) == (0, "")
    assert "short: \\xe9 leg" in done.stdout
    for command in (["list"], ["check", "short.toml"]):
        with subprocess.Popen(
            [FIVEBAR, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            process.stdout.close()  # as head does when it has enough
            assert process.stderr is not None
            assert process.stderr.read() == b""
        assert process.returncode == 141


@pytest.mark.parametrize("columns", ["0", "5", "20"])
def test_too_few_columns_cut_nothing(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    usual = shell("run", "short.toml", "--out", "mine").out
    monkeypatch.setenv("COLUMNS", columns)
    assert shell("run", "short.toml", "--out", "mine").out == usual
    shell.capture.readouterr()
    with pytest.raises(SystemExit):
        fivebar.main(["replay", "--help"])
    assert "RUN_DIR" in shell.capture.readouterr().out
    assert os.environ["COLUMNS"] == columns


def test_a_closed_stdout_or_stderr_changes_no_status(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout", None)
    monkeypatch.setattr("sys.stderr", None)
    assert fivebar.main(["run", "nowhere.toml"]) == 2
    for words, status in ((["run", "--help"], 0), (["run", "--nonsense"], 2)):
        with pytest.raises(SystemExit) as ended:
            fivebar.main(words)
        assert ended.value.code == status


def test_start_and_end_are_quick() -> None:
    code = """
import atexit, gc, sys
from fivebar_sim.cli import main
frozen = gc.get_freeze_count()  # Python 3.12 begins with some
atexit.register(lambda: print("frozen:", gc.get_freeze_count() > frozen))
slow = {"rerun", "dm_control", "matplotlib", "mujoco", "scipy", "pyarrow", "typeguard", "asyncio"}
main(["--help"])
print("slow:", sorted({"tyro", "rich", *slow} & set(sys.modules)))
for args in (["--version"], ["-h"], ["run", "--help"], ["report", "--help"]):
    try:
        main(args)
    except SystemExit as end:
        assert not end.code
    print("slow:", sorted(slow & set(sys.modules)))
print("frozen:", gc.get_freeze_count() > frozen)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    said = [line for line in done.stdout.splitlines() if line.startswith(("slow:", "frozen:"))]
    # What was imported is left alone at the end of the process, and only there.
    assert said == [*5 * ["slow: []"], "frozen: False", "frozen: True"]


def test_tables_do_without_pandas_unless_something_needs_it(tmp_path: Path) -> None:
    (tmp_path / "pandas.py").write_text("__version__ = '3.0.0'", encoding="utf-8")
    code = """
import sys
import numpy, pyarrow
from fivebar_sim.cli import arrow
arrow.leave_pandas_out()
assert pyarrow.array(numpy.ones(2)).to_pylist() == [1.0, 1.0]
assert pyarrow.array([1, None]).to_pylist() == [1, None]
assert pyarrow.scalar("one").as_py() == "one"
assert "pandas" not in sys.modules
try:
    pyarrow.table({"a": [1]}).to_pandas()
# There is no such thing in the one that stands in for it.
except AttributeError:
    print(sys.modules["pandas"].__version__)
"""
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True
    )
    assert done.stdout == "3.0.0\n"


def test_the_collector_is_seldom_called_within(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = gc.get_threshold()
    during: list[int] = []

    def call(args: list[str]) -> int:
        during.append(gc.get_threshold()[0])
        return 0

    monkeypatch.setattr(fivebar, "_call", call)
    try:
        for first in (700, 0, 900_000):
            gc.set_threshold(first, *usual[1:])
            assert fivebar.main([]) == 0
            assert gc.get_threshold()[0] == first
    finally:
        gc.set_threshold(*usual)
    assert during == [fivebar.SELDOM, 0, 900_000]
    assert fivebar.SELDOM > 100 * 700


def test_help_is_a_line_a_command(shell: Shell) -> None:
    """The same line that the command's own help begins with, so that no list of them grows old."""
    said = shell("--help")
    assert (said.status, said.err) == (0, "")
    for name, summary in fivebar.COMMANDS.items():
        assert (fivebar.function_of(name).__doc__ or "").splitlines()[0] == summary
        assert re.search(rf"^  {name} +{re.escape(summary)}$", said.out, re.MULTILINE)
    assert max(map(len, said.out.splitlines())) <= 80
    assert said.out.count("\n") <= len(fivebar.COMMANDS) + 7


@pytest.mark.parametrize("which", fivebar.SHELLS)
def test_completion_knows_every_command(shell: Shell, which: str) -> None:
    with pytest.raises(SystemExit) as ended:
        fivebar.main([fivebar.COMPLETION, which])
    assert not ended.value.code
    script = shell.capture.readouterr().out
    assert [name for name in fivebar.COMMANDS if name not in script] == []
    assert "--keep" in script
    legal = "--completion takes bash, fish, zsh, got 'tcsh'"
    assert shell.refused(fivebar.COMPLETION, "tcsh") == legal


PROBE = [sys.executable, "-c", "import ctypes"]


def test_code_in_the_users_folder_is_not_run_by_children(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Libraries start Python too, as glfw does; those children we cannot give a -P."""
    (folder / "ctypes.py").write_text("raise SystemExit(3)", encoding="utf-8")

    def call(args: list[str]) -> int:
        return subprocess.run(PROBE).returncode

    monkeypatch.delenv(fivebar.SAFE, raising=False)
    monkeypatch.setattr(fivebar, "_call", call)
    assert subprocess.run(PROBE).returncode == 3
    assert fivebar.main([]) == 0
    assert subprocess.run(PROBE).returncode == 3  # the caller's environment is as it was


def test_trial_of_gl_imports_nothing_from_the_users_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "mine.py").touch()
    monkeypatch.delenv(fivebar.SAFE, raising=False)
    monkeypatch.setattr(gl, "TRIAL", "import mine")
    assert not gl.works.__wrapped__("egl")
