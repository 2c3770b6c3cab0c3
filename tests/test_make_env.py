"""Setting up .venv: what is installed, what is left after a failure, and what the user is told."""

from __future__ import annotations

import fcntl
import importlib.util
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


def load(name: str) -> ModuleType:
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make_env = load("make_env")


class Pip:
    """Stands in for venv and pip: keeps the commands, makes what venv makes, fails where told."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.commands: list[str] = []
        self.fails_on = "nothing"
        self.watch: Callable[[str], None] = lambda line: None
        monkeypatch.setattr(make_env, "PIPS", 2)
        monkeypatch.setattr(make_env, "call_all", lambda each: [self(*command) for command in each])

    def __call__(self, *command: str | Path) -> str:
        """Do as the command would."""
        line = " ".join(str(part) for part in command)
        self.commands.append(line)
        self.watch(line)
        if self.fails_on in line:
            raise make_env.SetUpError("told to")
        if "-m venv" in line:
            (Path(command[-1]) / "bin").mkdir(parents=True)
            (Path(command[-1]) / "bin" / "python").touch()
        return ""

    def installed(self) -> list[str]:
        """Return the locks that were installed since the last question."""
        found = [line for line in self.commands if "--require-hashes" in line]
        self.commands.clear()
        return list(dict.fromkeys(line.split("/")[-1] for line in found))


@pytest.fixture
def pip(monkeypatch: pytest.MonkeyPatch) -> Pip:
    return Pip(monkeypatch)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for file in ("pyproject.toml", *LOCKS):
        (tmp_path / file).write_text(f"# {file}\n", encoding="utf-8")
    return tmp_path


def test_each_requirement_is_installed_by_one_pip(tmp_path: Path, pip: Pip) -> None:
    """In the lines of the lock, which pip names where it complains."""
    lock = tmp_path / "a.lock"
    lock.write_text("# all\na==1 \\\n    --hash=x\n    # via b\nb==2 --hash=y\nc==3\n", "utf-8")
    parts: list[list[str]] = []
    pip.watch = lambda line: parts.append(Path(line.split()[-1]).read_text("utf-8").splitlines())
    make_env.Environment(tmp_path).install(lock)
    first = ["", "a==1 \\", "    --hash=x", "", "", "c==3"]
    second = ["", "", "", "", "b==2 --hash=y", ""]
    assert parts == [first, second]


def test_complaint_names_the_lock_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(commands: list[list[str | Path]]) -> None:
        raise make_env.SetUpError(f"no requirement: x (from line 3 of {commands[0][-1]})")

    monkeypatch.setattr(make_env, "call_all", refuse)
    lock = tmp_path / "a.lock"
    lock.write_text("a==1\nb==2\nx\n", "utf-8")
    with pytest.raises(make_env.SetUpError, match=rf"from line 3 of {lock}\)$"):
        make_env.Environment(tmp_path).install(lock)


def test_one_that_fails_lets_the_others_end(tmp_path: Path) -> None:
    """A pip that is killed leaves half a package; the first that failed is told."""
    late = (
        f"import pathlib, time; time.sleep(0.2); pathlib.Path({str(tmp_path)!r}, 'whole').touch()"
    )
    programs = [[sys.executable, "-c", code] for code in ("1 / 0", late)]
    with pytest.raises(make_env.SetUpError, match="ZeroDivisionError"):
        make_env.call_all(programs)
    assert (tmp_path / "whole").exists()


BOTH = ["requirements.lock", "requirements-dev.lock"]
LOCKS = [*BOTH, "requirements-lint.lock"]
EVERY = [*LOCKS, "requirements-gpu.lock"]


def test_each_kind_installs_its_locks_once(root: Path, pip: Pip) -> None:
    make_env.set_up(root, "run")
    assert pip.installed() == ["requirements.lock"]
    make_env.set_up(root, "dev")
    assert pip.installed() == ["requirements-dev.lock"]
    make_env.set_up(root, "lint")
    assert pip.installed() == ["requirements-lint.lock"]
    for kind in ("run", "dev", "lint", "run"):
        make_env.set_up(root, kind)
        assert pip.commands == []


def test_whatever_was_installed_is_checked_once(root: Path, pip: Pip) -> None:
    for kind in ("run", "dev", "lint"):
        make_env.set_up(root, kind)
        assert " check" in pip.commands[-1]
        assert sum(" check" in line for line in pip.commands) == 1
        pip.commands.clear()


def test_lock_that_changed_is_installed_anew(root: Path, pip: Pip) -> None:
    make_env.set_up(root, "dev")
    assert pip.installed() == BOTH
    (root / "requirements.lock").write_text("# newer\n", encoding="utf-8")
    (root / ".venv" / "stale").touch()
    make_env.set_up(root, "dev")
    assert pip.installed() == BOTH
    assert not (root / ".venv" / "stale").exists()

    (root / "pyproject.toml").write_text("# newer\n", encoding="utf-8")
    make_env.set_up(root, "dev")
    assert [line for line in pip.commands if "--editable" in line]
    assert pip.installed() == []


@pytest.mark.parametrize("step", ["-m venv", "--require-hashes"])
def test_environment_that_failed_is_gone(root: Path, pip: Pip, step: str) -> None:
    pip.fails_on = step
    with pytest.raises(make_env.SetUpError, match="told to"):
        make_env.set_up(root, "run")
    assert not (root / ".venv").exists()


@pytest.mark.parametrize("step", ["-dev.lock", "--editable", " check"])
def test_part_that_failed_is_tried_again(root: Path, pip: Pip, step: str) -> None:
    pip.fails_on = step
    with pytest.raises(make_env.SetUpError, match="told to"):
        make_env.set_up(root, "dev")
    pip.commands.clear()
    pip.fails_on = "nothing"
    make_env.set_up(root, "dev")
    assert any(step in line for line in pip.commands)
    assert " check" in pip.commands[-1]
    assert "requirements.lock" not in pip.installed()  # that part was whole


@pytest.mark.parametrize("file", [*BOTH, "pyproject.toml"])
def test_part_that_was_cut_off_is_not_in_the_record(root: Path, pip: Pip, file: str) -> None:
    """Killed outright, and the files then put back: what the record holds fits, or is made anew."""
    make_env.set_up(root, "dev")
    before = (root / file).read_text(encoding="utf-8")
    (root / file).write_text("# newer\n", encoding="utf-8")
    step = {"requirements.lock": "-m venv", "pyproject.toml": "--editable"}.get(file, "-dev.lock")
    seen = set[str]()

    def killed(line: str) -> None:
        if step in line:
            seen.update(make_env.Environment(root / ".venv").holds())
            raise KeyboardInterrupt

    pip.watch = killed
    with pytest.raises(KeyboardInterrupt):
        make_env.set_up(root, "dev")
    part = "fivebar-sim" if file == "pyproject.toml" else file
    assert part not in seen

    (root / file).write_text(before, encoding="utf-8")
    pip.commands.clear()
    pip.watch = lambda line: None
    make_env.set_up(root, "dev")
    assert any(step in line for line in pip.commands)


def test_environment_half_deleted_is_not_in_the_record(
    root: Path, pip: Pip, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_env.set_up(root, "run")
    (root / "requirements.lock").write_text("# newer\n", encoding="utf-8")

    def killed(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(make_env.shutil, "rmtree", killed)
    with pytest.raises(KeyboardInterrupt):
        make_env.set_up(root, "run")
    assert make_env.Environment(root / ".venv").holds() == {}


STARTS_ANOTHER = """
import fcntl, os, signal, subprocess, sys, time
file = open(sys.argv[1])
fcntl.flock(file, fcntl.LOCK_EX)
subprocess.Popen(["sleep", "60"], pass_fds=[file.fileno()])
os.kill(os.getppid(), signal.SIGTERM)
time.sleep(60)
"""
"""A program that holds a file's lock together with one that it starts, and ends what started it."""

CALLS = """
import signal, sys
sys.path.insert(0, sys.argv[1])
import make_env
signal.signal(signal.SIGTERM, make_env.interrupt)
try:
    make_env.call(sys.executable, "-c", *sys.argv[2:])
except KeyboardInterrupt:
    print("interrupted")
"""


def locked(file: Path) -> bool:
    """Return whether any program still holds a file's lock."""
    with file.open() as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_signal_ends_all_that_runs(tmp_path: Path) -> None:
    """Else pip would go on installing into what the next set-up deletes."""
    file = tmp_path / "held"
    file.touch()
    command = [sys.executable, "-c", CALLS, str(ROOT / "scripts"), STARTS_ANOTHER, str(file)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.stdout, run.stderr) == ("interrupted\n", "")

    for _ in range(100):  # the system may take a moment to end it
        if not locked(file):
            return
        time.sleep(0.1)
    pytest.fail("a program that pip or venv started still runs")


def test_pip_resolves_and_builds_nothing(root: Path, pip: Pip) -> None:
    make_env.set_up(root, "dev", pip="23.0.1")
    installs = [line.split() for line in pip.commands if "pip install" in line]
    assert len(installs) == 4
    assert all("--no-deps" in words for words in installs)
    assert sum("--only-binary=:all:" in words for words in installs) == 2
    assert sum("--no-index" in words for words in installs) == 1  # the project itself


def test_second_set_up_waits_for_the_first(tmp_path: Path) -> None:
    """Else each deletes what the other installs."""
    code = """if True:
        import pathlib, sys
        sys.path.insert(0, sys.argv[1])
        import make_env
        root = pathlib.Path(sys.argv[2])
        with make_env.alone(root):
            print("whole" if (root / "whole").exists() else "half made")"""
    command = [sys.executable, "-c", code, str(ROOT / "scripts"), str(tmp_path)]
    with make_env.alone(tmp_path):
        other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert other.stdout
        assert other.stdout.readline() == "Waiting for another set-up of this folder ...\n"
        time.sleep(0.3)  # long enough for one that does not wait
        (tmp_path / "whole").touch()
    rest, _ = other.communicate()
    assert rest == "whole\n"
    assert other.returncode == 0


# what the user is told


@pytest.mark.parametrize(
    ("output", "line"),
    [
        (
            "ERROR: Could not install packages due to an OSError: No space left on device",
            "the disk is full: Could not install packages due to",
        ),
        (
            "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE. If you\n"
            "    attrs==26.1.0 from somewhere:\n  Expected sha256 00\n  Got        11",
            "a hash of the lock does not fit the file that came: attrs==26.1.0 from",
        ),
        (
            "ERROR: Could not find a version that satisfies a==1 (from versions: none)"
            "\nERROR: No matching distribution found for a==1",
            "the package index cannot be reached (is there a network?), or it has no wheel",
        ),
        (
            "ERROR: Could not find a version that satisfies a==9 (from versions: 1)"
            "\nERROR: No matching distribution found for a==9",
            "the package index does not have a release that the lock names: Could not find",
        ),
        (
            "WARNING: Retrying after connection broken by 'NewConnectionError(...)': /simple/a/\n"
            "ERROR: Could not find a version that satisfies a==1 (from versions: none)\n",
            "the package index cannot be reached (is there a network?): Could not find a version",
        ),
        ("/usr/bin/python3: No module named ensurepip", "this Python lacks a part of venv or pip"),
        (
            "ModuleNotFoundError: No module named 'hatchling'",
            "ModuleNotFoundError: No module named",
        ),
        ("Traceback\n  x\nOSError: odd", "OSError: odd"),
        ("", "no output"),
    ],
)
def test_cause_is_one_clear_line(output: str, line: str) -> None:
    assert make_env.explain(output).startswith(line)
    assert "\n" not in make_env.explain(output)


def python_like(path: Path, version: str, *refused: str) -> str:
    """Write a program that says it is a Python, and fails on code with some words."""
    cases = "".join(f'case "$*" in *"{words}"*) exit 1;; esac\n' for words in refused)
    path.write_text(f"#!/bin/sh\n{cases}[ $1 = -c ] || echo {version}\n", encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def found(python: str, path: str) -> subprocess.CompletedProcess[str]:
    """Return what the shell's search for a Python ends with."""
    script = (ROOT / "scripts" / "setup.sh").read_text(encoding="utf-8")
    functions = script[script.index("fits=") : script.index("# The set-up compiles")]
    environment = {"PYTHON": python, "PATH": path}
    return subprocess.run(
        ["/bin/sh", "-c", f"{functions}\nfind_python"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_first_python_that_will_do_is_taken(tmp_path: Path) -> None:
    python_like(tmp_path / "python3", "Python 3.9.2", "version_info")
    python_like(tmp_path / "python3.13", "Python 3.13.1", "ensurepip")
    python_like(tmp_path / "python3.12", "Python 3.12.1")
    python_like(tmp_path / "python3.11", "Python 3.11.1")
    assert found("", str(tmp_path)).stdout == "python3.12\n"
    chosen = str(tmp_path / "python3.11")
    assert found(chosen, str(tmp_path)).stdout == f"{chosen}\n"


def test_why_no_python_will_do_is_one_line(tmp_path: Path) -> None:
    old = python_like(tmp_path / "python3", "Python 3.9.2", "version_info")
    bare = python_like(tmp_path / "python3.13", "Python 3.13.1", "ensurepip")
    why = {
        "": "python3 is Python 3.9.2, python3.13 (Python 3.13.1) has no venv (Debian: apt",
        old: f"{old} is Python 3.9.2; set PYTHON to one",
        bare: f"{bare} (Python 3.13.1) has no venv",
        "/no/such": "/no/such does not start; set PYTHON to one",
    }
    for python, line in why.items():
        search = found(python, str(tmp_path))
        assert search.returncode == 1
        assert search.stdout == ""
        assert search.stderr.startswith("fivebar-sim needs Python 3.11 or newer with venv, " + line)
        assert search.stderr.count("\n") == 1
    assert "with venv, none was found;" in found("", str(tmp_path / "empty")).stderr


def test_failure_of_a_program_is_explained() -> None:
    with pytest.raises(make_env.SetUpError, match="OSError: no such thing"):
        make_env.call(sys.executable, "-c", "raise OSError('no such thing')")


# the locks


def names(file: str) -> set[str]:
    """Return the packages of a lock."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z0-9-]+)==", text, re.MULTILINE))


def test_locks_share_no_package_and_all_is_hashed() -> None:
    run, dev, lint, gpu = (names(file) for file in EVERY)
    assert {"mujoco", "numpy", "rerun-sdk", "gymnasium", "hatchling"} <= run
    assert {"pytest", "dm-control"} <= dev
    assert {"ruff", "basedpyright"} <= lint
    assert gpu == {"mujoco-warp", "warp-lang"}
    assert len(run | dev | lint | gpu) == len(run) + len(dev) + len(lint) + len(gpu)
    for file in EVERY:
        entries = re.split(r"^(?=[a-z0-9])", (ROOT / file).read_text("utf-8"), flags=re.MULTILINE)
        assert [e.split()[0] for e in entries[1:] if "--hash=sha256:" not in e] == []
