"""./.venv/bin/python scripts/determinism.py [MUJOCO ...]: how far metrics move elsewhere.

Runs all shipped scenarios as `fivebar check` does, then by plain mj_step, as older processors
would compute (scripts/determinism_processor.py), and with other versions of MuJoCo (3.16.0 and
4.0.0, if none is named), each installed over the network into a virtual environment of its own that
has everything else from this one. Prints for every metric the scenario where it moves most, beside
what its baseline allows; exit status 1 where that is passed, 2 where a version cannot be installed
or run.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import sysconfig
import tempfile
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, NamedTuple

from rich import box
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
WORKER = Path(__file__).resolve().parent / "determinism_runs.py"
PROCESSORS = Path(__file__).resolve().parent / "determinism_processor.py"
VERSIONS = ("3.16.0", "4.0.0")
CONSOLE = Console(width=110)

Runs = dict[str, dict[str, Any]]
"""What the worker measured of each scenario: its metrics, and a digest of its record's bits."""


class Moved(NamedTuple):
    """A metric elsewhere and here; `part` is its difference as a part of what is allowed."""

    key: str
    scenario: str
    here: float | None
    there: float | None
    tolerance: float
    part: float


class UnusableError(Exception):
    """An environment that cannot be made, or in which nothing runs."""


def measured(python: Path | str, *, plain: bool, settings: dict[str, str] | None = None) -> Runs:
    """Return what all shipped scenarios come to in an environment.

    Args:
        python: Its interpreter.
        plain: By mj_step, one scenario after the other, and not as one batch.
        settings: More environment variables.
    """
    command = [str(python), str(WORKER), *(["--plain"] if plain else [])]
    env = {**os.environ, **(settings or {})}
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, env=env)
    if done.returncode:
        raise UnusableError(f"the scenarios do not run with it: {last_line(done.stderr)}")
    return json.loads(done.stdout)


def processors() -> dict[str, dict[str, str]]:
    """Return the settings of each older processor that this one can stand in for."""
    command = [sys.executable, str(PROCESSORS)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    lines = [line.split("\t") for line in done.stdout.splitlines()]
    return {title: dict(each.split("=", 1) for each in settings) for title, *settings in lines}


def environment(folder: Path, version: str) -> Path:
    """Return the interpreter of a new environment with another MuJoCo, and all else from here."""
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    call("no virtual environment", sys.executable, "-m", "venv", "--without-pip", folder)
    pins = folder / "pins.txt"
    pins.write_text("".join(f"{pin}\n" for pin in installed()), encoding="utf-8")
    pip = (sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check")
    what = f"MuJoCo {version} cannot be installed; that needs the network"
    call(what, *pip, "install", "--quiet", "--constraint", pins, f"mujoco=={version}")
    purelib = sysconfig.get_path("purelib", vars={"base": str(folder), "platbase": str(folder)})
    here = sorted({sysconfig.get_path("purelib"), sysconfig.get_path("platlib")})
    lines = [f"import site; site.addsitedir({path!r})" for path in here]  # after its own
    (Path(purelib) / "here.pth").write_text("\n".join(lines) + "\n", encoding="utf-8")

    return python


def installed() -> list[str]:
    """Return what is installed here and is not MuJoCo's, as pip's constraints."""
    every = {each.metadata["Name"]: each.version for each in distributions()}
    return [f"{name}=={every[name]}" for name in sorted(every) if not name.startswith("mujoco")]


def call(what: str, *command: str | Path) -> None:
    """Run a command; raise with what it would have been for if it fails."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise UnusableError(f"{what}: {last_line(done.stderr)}")


def last_line(text: str) -> str:
    """Return the last line of what a command said, which mostly says why."""
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1].strip() if lines else "it does not say why"


def compared(here: Runs, there: Runs) -> list[Moved]:
    """Return for each metric the scenario where it moves most, by what is allowed there."""
    most: dict[str, Moved] = {}
    for name, run in here.items():
        for key, (value, tolerance) in run["metrics"].items():
            now = there[name]["metrics"][key][0]
            part = math.inf
            if value is None or now is None:
                part = 0.0 if value is now else math.inf
            elif value == now:
                part = 0.0
            elif tolerance > 0.0:
                part = abs(now - value) / tolerance
            moved = Moved(key, name, value, now, tolerance, part)
            if key not in most or part > most[key].part:
                most[key] = moved

    return list(most.values())


def show(title: str, here: Runs, there: Runs) -> bool:
    """Print what moves in an environment; return whether all of it is allowed."""
    same = sum(run["bits"] == there[name]["bits"] for name, run in here.items())
    CONSOLE.print(f"\n{title}: {same} of {len(here)} scenarios have the same bits", highlight=False)
    moved = compared(here, there)
    if any(each.part for each in moved):
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        table.add_column("metric", no_wrap=True)
        for name in ("here", "difference", "relative", "tolerance", "of it"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("most in", no_wrap=True)
        for each in moved:
            table.add_row(*cells(each))
        CONSOLE.print(table)

    bad = [f"{each.scenario} ({each.key})" for each in moved if each.part > 1.0]
    if bad:
        CONSOLE.print(f"beyond the tolerance: {', '.join(bad)}", highlight=False)

    return not bad


def cells(moved: Moved) -> list[str]:
    """Return what the table says of a metric, in SI units."""
    allowed = f"{moved.tolerance:.1e}"
    if moved.here is None or moved.there is None:
        return [moved.key, str(moved.here), str(moved.there), "", allowed, "", moved.scenario]

    change = moved.there - moved.here
    relative = f"{abs(change / moved.here):.0e}" if moved.here else ""
    part = f"{100.0 * moved.part:.1g} %"

    return [
        moved.key,
        f"{moved.here:.4g}",
        f"{change:+.1e}",
        relative,
        allowed,
        part,
        moved.scenario,
    ]


def main(versions: list[str]) -> int:
    """Compare this environment with others; return the exit status."""
    with tempfile.TemporaryDirectory() as place:
        here = measured(sys.executable, plain=False)
        good = show("plain mj_step, here", here, measured(sys.executable, plain=True))
        for name, settings in processors().items():
            there = measured(sys.executable, plain=False, settings=settings)
            good &= show(f"processor: {name}", here, there)
        for version in versions:
            python = environment(Path(place) / version, version)
            there = measured(python, plain=True)
            good &= show(f"MuJoCo {version}, plain mj_step", here, there)
    return 0 if good else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("versions", nargs="*", metavar="MUJOCO", default=list(VERSIONS))
    try:
        sys.exit(main(parser.parse_args().versions))
    except UnusableError as error:
        print(f"determinism: {error}", file=sys.stderr)
        sys.exit(2)
