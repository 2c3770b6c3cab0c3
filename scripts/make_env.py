"""python scripts/make_env.py KIND [--pip VERSION] [--dry-run]: makes .venv as the locks say.

KIND is one of

    run    requirements.lock: what a run needs
    dev    requirements-dev.lock besides: what the tests need
    lint   requirements-lint.lock besides: the linters, a sixth of all that is installed

Nothing is resolved: the locks are complete, so pip installs each line of them and no more, only
from wheels, and only with the locked hashes. What is there already stays; a lock that changed is
installed anew. The environment says in its file `installed` what it holds. A part stands there only
while nothing works on it, so that an interrupted set-up is never taken for a whole one.

--dry-run prints what pip would install, NAME==VERSION a line.

Needs the standard library alone: it runs before anything is installed.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

ALL = ["requirements.lock", "requirements-dev.lock", "requirements-lint.lock"]
LOCKS = {"run": ALL[:1], "dev": ALL[:2], "lint": ALL}
"""The locks of each set-up, in the order in which they are installed."""

ADDS = {ALL[1]: "what the tests need", ALL[2]: "the linters"}
"""What a lock adds to an environment."""

CHECK = "pip check"
"""The part of the record that says for which content pip found nothing missing."""

INSTALL = ["install", "--quiet", "--disable-pip-version-check", "--no-input", "--no-deps"]
"""Without pip's resolver, which until 23.3 takes the newest release where an extra is asked for."""

FROM_LOCK = ["--require-hashes", "--only-binary=:all:", "--no-compile"]
"""No build from source, which may need a compiler; bytecode is written for what is imported."""

PIPS = min(4, os.cpu_count() or 1)
"""How many pips share a lock; no package stands in two parts of it."""

NETWORK = "the package index cannot be reached (is there a network?)"
NO_VENV = "this Python lacks a part of venv or pip (Debian: apt install python3-venv)"
CAUSES = {
    "No space left on device": "the disk is full",
    "Disk quota exceeded": "the disk quota is used up",
    "DO NOT MATCH THE HASHES": "a hash of the lock does not fit the file that came",
    "Hashes are required": "the lock lacks a hash",
    "Invalid requirement": "the lock has a line that is no requirement",
    "name resolution": NETWORK,
    "Connection": NETWORK,
    "timed out": NETWORK,
    "(from versions: none)": f"{NETWORK}, or it has no wheel for this Python",
    "No matching distribution": "the package index does not have a release that the lock names",
    "No module named ensurepip": NO_VENV,
    "No module named venv": NO_VENV,
    "No module named pip": NO_VENV,
}
"""What words of pip and venv mean, most telling first."""


class SetUpError(Exception):
    """Says in one line why there is no environment."""


def explain(output: str) -> str:
    """Return the cause of a failure in one line, with the program's own words."""
    lines = [line.strip() for line in output.splitlines() if line.strip()] or ["no output"]
    errors = [
        line
        for line in lines
        if ("ERROR" in line or "Error" in line) and not line.startswith("WARNING")
    ] or lines

    for sign, meaning in CAUSES.items():
        if sign in output:
            # of a hash that does not fit pip names the package below the error
            where = lines if "HASHES" in sign else errors
            about = [line for line in where if "==" in line or sign in line] or lines
            words = about[-1] if "HASHES" in sign else about[0]
            return f"{meaning}: {shortened(words)}"
    return shortened(errors[-1])


def shortened(line: str) -> str:
    """Return a line of pip as part of another one."""
    return line.removeprefix("ERROR: ").removesuffix(":")[:200]


def call(*command: str | Path) -> str:
    """Return the output of a command that must succeed."""
    return call_all([command])[0]


def call_all(commands: Sequence[Sequence[str | Path]]) -> list[str]:
    """Return the outputs of commands that run side by side; all must succeed."""
    programs: list[subprocess.Popen[str]] = []
    try:
        for command in commands:
            programs.append(start(command))
        outputs = [program.communicate()[0] for program in programs]
    except BaseException:
        for program in programs:
            if program.poll() is None:
                os.killpg(program.pid, signal.SIGKILL)
                program.wait()
        raise

    # One that fails lets the others end: a pip that is killed leaves half a package.
    for program, output in zip(programs, outputs, strict=True):
        if program.returncode:
            raise SetUpError(explain(output))
    return outputs


def start(command: Sequence[str | Path]) -> subprocess.Popen[str]:
    """Start a command."""
    # A user's settings for other environments must not send packages elsewhere.
    aside = {"PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_NO_BINARY", "PYTHONHOME", "PYTHONPATH"}
    env = {key: value for key, value in os.environ.items() if key not in aside}
    env |= {"PIP_USER": "0", "PIP_REQUIRE_VIRTUALENV": "0"}

    # A group of its own: what pip and venv start ends with them.
    return subprocess.Popen(
        [str(part) for part in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=env,
        start_new_session=True,
    )


def dealt(lock: str, hands: int) -> list[str]:
    """Return a lock's requirements dealt out, each in the line in which the lock has it.

    So pip names the lock's own line where it complains.
    """
    whole = re.split(r"(?<!\\)\n", lock)  # a requirement and its hashes are one line
    blank = [line.count("\n") * "\n" for line in whole]
    places = [k for k, line in enumerate(whole) if line and not line.lstrip().startswith("#")]

    parts = []
    hands = max(1, min(hands, len(places)))
    for hand in range(hands):
        mine = set(places[hand::hands])
        lines = [line if k in mine else blank[k] for k, line in enumerate(whole)]
        parts.append("\n".join(lines))
    return parts


def interrupt(number: int, frame: object) -> NoReturn:
    """End as Ctrl-C does: nothing half made stays, and nothing that was started runs on."""
    raise KeyboardInterrupt


def fingerprint(root: Path, *files: str) -> str:
    """Return what an environment depends on: the content of files, this Python and the place."""
    content = [(root / file).read_bytes() for file in files]
    origin = f"{sys.version}\n{sys.base_prefix}\n{root}\n".encode()
    return hashlib.sha256(b"\0".join([origin, *content])).hexdigest()


class Environment:
    """A virtual environment and the record of what was installed into it."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.python = place / "bin" / "python"
        self.record = place / "installed"

    def holds(self) -> dict[str, str]:
        """Return the fingerprint of each part that was installed to the end."""
        try:
            return json.loads(self.record.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}

    def write(self, marks: dict[str, str]) -> None:
        """Write the record: all of it, or it stays as it was before."""
        new = self.record.with_suffix(".new")
        new.write_text(json.dumps(marks, indent=1), encoding="utf-8")
        new.replace(self.record)

    def content(self) -> str:
        """Return what stands for all that is installed."""
        marks = {name: mark for name, mark in self.holds().items() if name != CHECK}
        return hashlib.sha256(json.dumps(marks, sort_keys=True).encode()).hexdigest()

    @contextmanager
    def part(self, name: str, mark: str) -> Iterator[None]:
        """Strike a part from the record while it is worked on; enter it when that is done."""
        held = self.holds()
        if held.pop(name, None):
            self.write(held)
        yield
        self.write(held | {name: mark})

    def pip(self, *args: str | Path) -> str:
        """Return the output of the environment's own pip."""
        return call(self.python, "-m", "pip", *args)

    def install(self, lock: Path) -> None:
        """Install a lock by several pips side by side: each unpacks on one processor alone."""
        with tempfile.TemporaryDirectory() as folder:
            commands = []
            for number, part in enumerate(dealt(lock.read_text(encoding="utf-8"), PIPS)):
                file = Path(folder) / str(number) / lock.name
                file.parent.mkdir()
                file.write_text(part, encoding="utf-8")
                commands.append([self.python, "-m", "pip", *INSTALL, *FROM_LOCK, "-r", file])

            try:
                call_all(commands)
            except SetUpError as error:
                said = re.sub(rf"{re.escape(folder)}/\d+", str(lock.parent), str(error))
                raise SetUpError(said) from None

    def make(self, pip: str | None) -> None:
        """Make an empty environment, with this Python's pip or another release of it."""
        self.record.unlink(missing_ok=True)
        if self.place.is_dir():
            shutil.rmtree(self.place)
        # venv would start ensurepip itself, but keep to itself what that says of a failure.
        call(sys.executable, "-m", "venv", "--without-pip", self.place)
        call(self.python, "-m", "ensurepip", "--upgrade", "--default-pip")
        if pip:
            self.pip(*INSTALL, "--upgrade", "pip" if pip == "newest" else f"pip=={pip}")


def set_up(root: Path, kind: str, pip: str | None = None) -> None:
    """Bring .venv to what a kind of set-up asks for.

    Raises:
        SetUpError: If a step fails. An environment that was whole for another kind stays whole.
    """
    env = Environment(root / ".venv")
    locks = LOCKS[kind]
    base = fingerprint(root, locks[0])
    if env.holds().get(locks[0]) != base or not env.python.exists():
        print(f"Setting up .venv with Python {sys.version.split()[0]} ...", flush=True)
        try:
            env.make(pip)
            with env.part(locks[0], base):
                env.install(root / locks[0])
        except BaseException:
            shutil.rmtree(env.place, ignore_errors=True)
            raise

    for number, lock in enumerate(locks[1:], 2):
        mark = fingerprint(root, *locks[:number])
        if env.holds().get(lock) != mark:
            print(f"Adding {ADDS[lock]} ...", flush=True)
            with env.part(lock, mark):
                env.install(root / lock)
            if lock == "requirements-dev.lock":
                say_what_is_left_out()

    mark = fingerprint(root, "pyproject.toml", locks[0])
    if env.holds().get("fivebar-sim") != mark:
        with env.part("fivebar-sim", mark):
            env.pip(*INSTALL, "--no-index", "--no-build-isolation", "--editable", root)

    # Asked of all that is there, once: a kind that holds less has nothing more to ask.
    mark = env.content()
    if env.holds().get(CHECK) != mark:
        with env.part(CHECK, mark):
            env.pip("check", "--disable-pip-version-check")


@contextmanager
def alone(root: Path) -> Iterator[None]:
    """Wait until no other set-up works on the same folder; then keep others waiting."""
    folder = os.open(root, os.O_RDONLY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("Waiting for another set-up of this folder ...", flush=True)
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def say_what_is_left_out() -> None:
    """Print which extras this Python cannot have."""
    version = ".".join(str(number) for number in sys.version_info[:2])
    if sys.version_info >= (3, 13):
        print(f"dm-control is left out: its labmaze has no wheel for Python {version}.")
    if sys.version_info >= (3, 15):
        print(f"pymoo, pandas and Ray are left out: they have no wheel for Python {version}.")


def would_install(root: Path, kind: str, pip: str | None = None) -> list[str]:
    """Return NAME==VERSION of all that pip would install, asked in a temporary environment."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        env = Environment(Path(folder) / "env")
        env.make(pip)
        for lock in LOCKS[kind]:
            report = Path(folder) / "report.json"
            env.pip(*INSTALL, *FROM_LOCK, "--dry-run", "--report", report, "-r", root / lock)
            items = json.loads(report.read_text(encoding="utf-8"))["install"]
            found += [f"{i['metadata']['name']}=={i['metadata']['version']}" for i in items]
    return sorted(found, key=str.lower)


def main() -> int:
    """Set up, or say what would be installed; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kind", choices=LOCKS)
    parser.add_argument("--pip", metavar="VERSION", help="another pip, or newest")
    parser.add_argument("--dry-run", action="store_true", help="only print what would be installed")
    args = parser.parse_args()

    root = Path(__file__).resolve().parents[1]
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, interrupt)

    try:
        if args.dry_run:
            print("\n".join(would_install(root, args.kind, args.pip)))
        else:
            with alone(root):
                set_up(root, args.kind, args.pip)
    except (SetUpError, OSError) as error:
        print(f"fivebar-sim could not be set up: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("fivebar-sim could not be set up: interrupted", file=sys.stderr)
        return 130

    return 0


if __name__ == "__main__":
    sys.exit(main())
