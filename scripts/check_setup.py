"""./scripts/check_setup [--long] [PYTHON ...]: every pip installs exactly what the locks say.

Offers a newer release of three locked packages from an index of its own, beside the real one, and
asks the oldest pip what it would install of all locks. --long installs instead of asking, the least
set-up and the whole one, each twice in a row, with pip 23.0.1, 23.2.1, 24.0 and the newest, and
with every Python named, or else with every one on the PATH; each of these takes a minute or two.
"""

from __future__ import annotations

import argparse
import http.server
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
LOCKS = {
    "run": ["requirements.lock"],
    "lint": ["requirements.lock", "requirements-dev.lock", "requirements-lint.lock"],
}
"""The least and the most that is set up; what the tests need lies between."""

PIPS = {"23.0.1": (3, 11), "23.2.1": (3, 12), "24.0": (3, 12), "newest": (3, 99)}
"""The pips that are tried, and the newest Python that each of them runs on."""

NEWER = {"coverage": "999.0", "numpy": "999.0", "rich": "999.0"}
"""Releases that do not exist. pytest-cov asks for coverage[toml]: old pips resolve such extras."""

NOT_LOCKED = {"pip", "setuptools", "fivebar-sim"}
"""What venv itself brings, and the project."""


def wheel(name: str, version: str) -> bytes:
    """Return a wheel that holds nothing."""
    info = f"{name}-{version}.dist-info"
    tag = "Wheel-Version: 1.0\nGenerator: check\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        file.writestr(
            f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        )
        file.writestr(f"{info}/WHEEL", tag)
        file.writestr(f"{info}/RECORD", f"{info}/METADATA,,\n{info}/WHEEL,,\n{info}/RECORD,,\n")
    return content.getvalue()


class Index(http.server.BaseHTTPRequestHandler):
    """A package index of the newer releases."""

    def do_GET(self) -> None:
        """Answer with a project's page, with its wheel, or with 404."""
        found = re.fullmatch(r"/simple/([a-z]+)/(.*)", self.path)
        version = NEWER.get(found[1]) if found else None
        if not found or not version:
            self.send_error(404)
            return

        file = f"{found[1]}-{version}-py3-none-any.whl"
        page = f'<!DOCTYPE html><html><body><a href="{file}">{file}</a></body></html>'
        body = page.encode() if not found[2] else wheel(found[1], version)
        self.send_response(200)
        self.send_header("Content-Type", "text/html" if not found[2] else "application/zip")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Keep the terminal for the result."""


@contextmanager
def newer_releases() -> Iterator[dict[str, str]]:
    """Serve the index on loopback; yield the environment variables that make pip look there too."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Index)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield {"PIP_EXTRA_INDEX_URL": f"http://127.0.0.1:{server.server_port}/simple"}
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def ask(python: str | Path, *args: str | Path, cwd: Path, env: dict[str, str]) -> str:
    """Return the output of a Python program that must succeed."""
    command = [str(python), *(str(arg) for arg in args)]
    done = subprocess.run(command, cwd=cwd, env=os.environ | env, capture_output=True, text=True)
    if done.returncode:
        said = f"{done.stdout}{done.stderr}"
        raise SystemExit(f"{' '.join(command)}: status {done.returncode}\n{said}")
    return done.stdout


def normal(name: str) -> str:
    """Return the one spelling of a package's name."""
    return re.sub(r"[-_.]+", "-", name).lower()


def version_of(python: str) -> tuple[int, int]:
    """Return the (major, minor) version of a Python."""
    code = "import sys; print(*sys.version_info[:2])"
    major, minor = ask(python, "-c", code, cwd=ROOT, env={}).split()
    return int(major), int(minor)


def locked(kind: str, version: tuple[int, int], full: str) -> dict[str, str]:
    """Return the version of every package that a set-up must install on one Python."""
    place = {"python_version": f"{version[0]}.{version[1]}", "python_full_version": full}
    pins = {}
    for lock in LOCKS[kind]:
        for line in (ROOT / lock).read_text(encoding="utf-8").splitlines():
            if re.match(r"[a-z0-9]", line):
                pin = Requirement(line.removesuffix("\\").strip())
                if not pin.marker or pin.marker.evaluate(place):
                    pins[normal(pin.name)] = str(pin.specifier).removeprefix("==")
    return pins


def difference(found: str, wanted: dict[str, str]) -> list[str]:
    """Return how lines of NAME==VERSION differ from what is locked."""
    pairs = (line.split("==") for line in found.split())
    have = {normal(name): version for name, version in pairs}
    names = (have.keys() | wanted.keys()) - (NOT_LOCKED - wanted.keys())
    wrong = sorted(name for name in names if have.get(name) != wanted.get(name))
    return [f"{name}: locked {wanted.get(name)}, installed {have.get(name)}" for name in wrong]


def leave_out(folder: str, names: list[str]) -> set[str]:
    """Return what a copy of the checkout leaves out; fivebar_sim has a package called runs too."""
    written = {"build", "runs"} if Path(folder) == ROOT else set[str]()
    return {name for name in names if name.startswith(".") or name in {"__pycache__", *written}}


def check(python: str, pip: str, kind: str, install: bool, env: dict[str, str]) -> list[str]:
    """Return what one set-up, with one Python and pip, would install or installs wrongly."""
    full = ask(python, "-c", "import platform; print(platform.python_version())", cwd=ROOT, env={})
    wanted = locked(kind, version_of(python), full.strip())
    make = ["scripts/make_env.py", kind, "--pip", pip]
    if not install:
        return difference(ask(python, *make, "--dry-run", cwd=ROOT, env=env), wanted)

    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "clone"
        shutil.copytree(ROOT, copy, ignore=leave_out)
        ask(python, *make, cwd=copy, env=env)
        again = ask(python, *make, cwd=copy, env=env)
        bin = copy / ".venv" / "bin"
        ask(bin / "fivebar", "run", "classic-ellipse", "--quiet", cwd=Path(folder), env=env)
        list_all = ("-m", "pip", "list", "--format=freeze", "--exclude-editable")
        wrong = difference(ask(bin / "python", *list_all, cwd=copy, env=env), wanted)
        return wrong + ([f"the second call was not silent: {again}"] if again else [])


def check_offer(env: dict[str, str]) -> None:
    """Fail unless a pip that resolves would take the newer releases: else this shows nothing."""
    options = ("--dry-run", "--quiet", "--ignore-installed", "--no-deps", "--report", "-")
    found = ask(sys.executable, "-m", "pip", "install", *options, *NEWER, cwd=ROOT, env=env)
    missing = [name for name, version in NEWER.items() if f'"version": "{version}"' not in found]
    if missing:
        raise SystemExit(f"the newer releases are not on offer: {missing}")


def pythons() -> list[str]:
    """Return one Python of each version on the PATH that the project supports.

    A name that starts none is left out: version managers have one for every Python installed.
    """
    names = [f"python3.{minor}" for minor in range(11, 30)]
    paths = [path for path in map(shutil.which, names) if path]
    return [path for path in paths if starts(path)]


def starts(python: str) -> bool:
    """Return whether a program is a Python that can make environments; say so if not."""
    done = subprocess.run([python, "-c", "import ensurepip, venv"], capture_output=True, text=True)
    if done.returncode:
        reason = (done.stderr.strip() or "no output").splitlines()[0]
        print(f"{python} is left out: {reason}", flush=True)
    return done.returncode == 0


def end(number: int, _: object) -> NoReturn:
    """End as Ctrl-C does: the copies that are being set up go with their folders."""
    raise SystemExit(128 + number)


def main() -> int:
    """Check all pairs; print a line each; return the exit status."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end)
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("python", nargs="*", help="default: this one; with --long all on the PATH")
    parser.add_argument("--long", action="store_true", help="install, with every pip and Python")
    args = parser.parse_args()
    chosen = args.python or (pythons() if args.long else [sys.executable])

    wrong = []
    with newer_releases() as env:
        check_offer(env)
        for python in chosen:
            version = version_of(python)
            pips = [pip for pip, last in PIPS.items() if version <= last]
            for pip in pips if args.long else pips[:1]:
                for kind in LOCKS if args.long else ["lint"]:
                    found = check(python, pip, kind, args.long, env)
                    title = f"Python {version[0]}.{version[1]}, pip {pip}, {kind}"
                    print(f"{title}: {'; '.join(found) or 'as locked'}", flush=True)
                    wrong += found

    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
