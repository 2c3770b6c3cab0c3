"""What the program does where the system refuses: memory, disks, files that never end."""

from __future__ import annotations

import errno
import io
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import pytest
import rerun
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.cli import memory, terminal
from fivebar_sim.files import input_file, resources
from fivebar_sim.runs import directory, recording_file
from fivebar_sim.scenario import together

resource = pytest.importorskip("resource", reason="this system limits no process")

FIVEBAR = str(Path(sys.executable).with_name("fivebar"))
GB = 10**9


def limited(folder: Path, which: int, most: int, *args: str) -> subprocess.CompletedProcess[str]:
    """Return what came of a command that a limit of the system holds back."""

    def limit() -> None:
        resource.setrlimit(which, (most, most))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return subprocess.run(
        [FIVEBAR, *args], capture_output=True, text=True, cwd=folder, preexec_fn=limit
    )


def one_line(err: str) -> str:
    """Return the one line on stderr."""
    assert err.startswith("fivebar: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    return err.removeprefix("fivebar: ").rstrip("\n")


FULL = """
import resource, sys
# Python keeps what the limit left of a module's bytecode, and no later start could read it.
sys.dont_write_bytecode = True
from fivebar_sim import cli
hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for most in sys.argv[1:]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(most), hard))
    print(cli.main(["run", "short.toml", "--out", "a"]), flush=True)
"""
"""The program, run several times: no file may have more bytes than the words say."""


# memory


def test_too_little_memory_is_one_line(shell: Shell) -> None:
    before = shell.names()
    done = limited(shell.folder, resource.RLIMIT_AS, GB, "run", "short.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert one_line(done.stderr) == (
        "fivebar needs 3.2 GB of address space, and may have 1.0 GB: see `ulimit -v`"
    )
    long = ["run", "short.toml", "--set", "duration=2000"]
    done = limited(shell.folder, resource.RLIMIT_AS, 4 * GB, *long)
    assert (done.returncode, done.stdout) == (2, "")
    assert one_line(done.stderr).startswith("a run of 2000000 steps needs 6.2 GB of address space")
    assert shell.names() == before
    help_text = limited(shell.folder, resource.RLIMIT_AS, GB, "--help")
    assert (help_text.returncode, help_text.stderr) == (0, "")


@pytest.mark.long
def test_as_much_memory_as_is_asked_for_is_enough(shell: Shell) -> None:
    for steps in (600, 1_000_000):
        most = memory.LEAST + memory.A_STEP * steps
        run = ["run", "short.toml", "--quiet", "--set", f"duration={steps / 1000}", "--out", "mine"]
        done = limited(shell.folder, resource.RLIMIT_AS, most, *run)
        assert (done.returncode, done.stderr) == (0, "")
        directory.check_run(shell.folder / "mine")


def test_memory_that_runs_out_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def out(planned: object, watch: object = None) -> NoReturn:
        raise MemoryError("Unable to allocate 1 GiB")

    monkeypatch.setattr(rollout, "execute", out)
    said = shell.refused("run", "short.toml")
    assert said == "not enough memory: Unable to allocate 1 GiB"


@pytest.mark.parametrize(
    "settings",
    [
        ["duration=1e9"],
        ["duration=1e300"],
        ["sim.timestep=1e-12"],
        ["sim.timestep=5e-324"],
        ["duration=5000.001"],
        ["path.kind=line", "path.start=[0,-0.08]", "path.stop=[0,-0.08]", "duration=1e6"],
    ],
)
def test_a_run_without_end_is_refused(shell: Shell, settings: list[str]) -> None:
    pairs = [part for setting in settings for part in ("--set", setting)]
    for command in ("run", "check"):
        said = shell.refused(command, "short.toml", *pairs)
        assert f"duration must be 2 to {together.MOST_STEPS} timesteps of" in said


# files


@pytest.mark.parametrize("make", [os.mkfifo, lambda place: os.symlink("/dev/zero", place)])
def test_a_file_without_end_is_refused(shell: Shell, make: Callable[[str], None]) -> None:
    for name in ("pipe.toml", "pipe.csv"):
        make(name)
    Path("baselines").mkdir()
    make("baselines/short.json")
    what = "it is not a regular file"
    csv = ("--set", "path.kind=csv", "--set", "path.file=pipe.csv")
    refusals = [
        (("run", "pipe.toml"), f"cannot read scenario pipe.toml: {what}"),
        (("run", "short.toml", "--set", "leg=pipe.toml"), "cannot read leg pipe.toml"),
        (("run", "short.toml", "--set", "servo=pipe.toml"), "cannot read servo pipe.toml"),
        (("run", "short.toml", *csv), "cannot read foot path "),
        (("check", "short.toml"), "cannot read baseline baselines/short.json"),
    ]
    for args, message in refusals:
        said = shell.refused(*args)
        assert message in said
        assert said.endswith(what)


def test_a_file_too_large_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "large"
    with file.open("wb") as stream:
        stream.truncate(1001)
    input_file.check(file, 1001)
    with pytest.raises(OSError, match=r"^\[Errno \d+\] it must have at most 0\.001 MB, got "):
        input_file.check(file, 1000)
    with pytest.raises(IsADirectoryError):
        input_file.check(tmp_path, 1000)


def test_a_damaged_record_is_noticed(shell: Shell) -> None:
    assert shell("run", "short.toml", "--out", "mine", "--quiet").status == 0
    file = Path("mine/rollout.parquet")
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1  # one bit among the numbers
    file.write_bytes(data)
    said = shell.refused("report", "mine")
    assert said.startswith("mine/rollout.parquet is not a record, or is damaged: ")


def test_a_recording_of_a_newer_patch_is_rebuilt_not_warned_about(tmp_path: Path) -> None:
    file = tmp_path / "recording.rrd"
    here = [int(part) for part in re.findall(r"\d+", rerun.__version__)[:3]]
    for patch, newer in ((here[2], False), (here[2] + 1, True)):
        file.write_bytes(b"RRF2" + bytes([here[0], here[1], patch, 0]))
        assert recording_file.may_be_read(file) != newer


# places


def test_a_file_that_may_not_grow_leaves_nothing(shell: Shell) -> None:
    before = shell.names()
    command = [sys.executable, "-c", FULL, "100", "20000", "150000"]  # scenario, record, recording
    done = subprocess.run(command, capture_output=True, text=True, cwd=shell.folder)
    assert (done.returncode, done.stdout) == (0, "2\n" * 3)
    assert done.stderr == "fivebar: cannot write a: File too large\n" * 3
    assert shell.names() == before


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Give small file systems of their own, mounted with some options."""
    mounted: list[Path] = []

    def mount(options: str) -> Path:
        place = tmp_path / f"disk{len(mounted)}"
        place.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", options, "fivebar-test", str(place)]
        try:
            subprocess.run(command, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            pytest.skip("only a superuser may mount a file system, and not everywhere")
        mounted.append(place)
        return place

    yield mount
    for place in mounted:
        subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_leaves_nothing(shell: Shell, disk: Callable[[str], Path]) -> None:
    place = disk("size=64k")
    said = shell.refused("run", "short.toml", "--out", str(place / "a"))
    assert said == f"cannot write {place / 'a'}: No space left on device"
    assert os.listdir(place) == []


def test_a_disk_for_reading_is_refused(shell: Shell, disk: Callable[[str], Path]) -> None:
    place = disk("ro")
    for out in (place / "a", place / "deep" / "a"):
        said = shell.refused("run", "short.toml", "--out", str(out))
        assert said.startswith(f"cannot write {out}: ")
    said = shell.refused("check", "short.toml", "--junit", str(place / "a.xml"))
    assert said.startswith(f"cannot write {place / 'a.xml'}: ")


def test_places_of_a_check_are_tried_before_its_runs(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(plans: object, nthread: int = 1) -> NoReturn:
        raise AssertionError("it was simulated")

    monkeypatch.setattr(rollout, "run_all", never)
    for option, place in (("--junit", "."), ("--junit", "foot.csv/x.xml"), ("--summary", ".")):
        assert shell.refused("check", "short.toml", option, place).startswith("cannot write ")
    with pytest.raises(AssertionError, match="it was simulated"):
        shell("check", "short.toml", "--junit", "deep/x.xml", "--summary", "deep/x.md")


# words


def test_a_line_is_short_and_obeyed_by_no_terminal() -> None:
    assert terminal.one_line("two\nlines,\ta  gap") == "two lines, a gap"
    assert terminal.one_line("red \x1b[31m, \u202eright, \udcff, é") == (
        "red \\x1b[31m, \\u202eright, \\udcff, é"
    )
    long = terminal.one_line("a" * 10_000 + "end")
    assert long.startswith("aaa")
    assert long.endswith("aaaend")
    assert len(long) < 610


def test_everything_slow_is_imported_within_main() -> None:
    slow = ("numpy", "tyro", "rich", "typing", "importlib.metadata", "fivebar_sim.cli.program")
    code = f"import sys, fivebar_sim.cli; print(set({slow}) & set(sys.modules))"
    # -S: packages of the environment may import anything when Python starts.
    command = [sys.executable, "-S", "-c", code]
    env = os.environ | {"PYTHONPATH": str(resources.PACKAGE.parent)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=env)
    assert done.stdout == "set()\n"


class FullDisk(io.StringIO):
    """A stream that takes nothing."""

    def write(self, text: str) -> int:
        """Refuse."""
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("args", [["run", "nowhere.toml"], ["run", "--nonsense"]])
def test_a_message_that_cannot_be_written_leaves_the_status(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, args: list[str]
) -> None:
    monkeypatch.setattr("sys.stderr", FullDisk())
    assert shell(*args).status == 2
