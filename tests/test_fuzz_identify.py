"""Logs, scenarios and words given to `fivebar identify`, damaged in any way: the law of fuzz.py."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import fuzz_inputs as inputs
import numpy as np
import pytest
from fuzz import Bench, Law, both_forms
from hypothesis import strategies as st

from fivebar_sim import Scenario, rollout
from fivebar_sim.identify import fit, motions
from fivebar_sim.identify.parameters import DEFAULT, OFFSETS, SHARES
from fivebar_sim.overlay import measured, write

MINE = """
# No torque limit: its steps are taken twice, and other tests look at it.
duration = 1.1
scene = { kind = "payload", mass = 0.15 }
path = { kind = "ellipse", centre = [0.0, -0.072], radii = [0.020, 0.008], frequency = 4.0, ramp = 0.1 }
sim = { timestep = 0.005 }

[servo]
kp = 4.0
kd = 0.05
kt = 0.37
resistance = 5.0
delay = 0.004
friction = { model = "constant", base = 0.012, viscous = 0.004 }
"""  # noqa: E501
COLUMNS = """
[log]
file = "log.csv"
time = "time"
theta_A = "theta_A"
theta_E = { column = "theta_E", unit = "rad", sign = 1, offset = 0.0 }
ctrl_A = "ctrl_A"
ctrl_E = "ctrl_E"
"""
KEYS = sorted({*DEFAULT, *OFFSETS, *SHARES, "servo.friction.viscous", "leg.mass", "sim.seed", "x"})
EVALUATIONS = 2
"""Most of a fit: here it need not end where it should, but lawfully."""


class Attempt(NamedTuple):
    """A command line, and what is in one of its files.

    Attributes:
        file: Which file is another one.
        content: What is in it.
        words: Words of the command line besides.
    """

    file: str
    content: bytes
    words: tuple[str, ...] = ("--fit", "servo.kp")

    def __repr__(self) -> str:
        """Return it without the content, which may be long."""
        return f"Attempt({self.file}, {len(self.content)} bytes, {self.words})"


@functools.cache
def sound() -> dict[str, bytes]:
    """Return the files of a leg that is identified, its log a simulated leg's."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mine.toml").write_text(MINE, encoding="utf-8")
        real = ["servo.kp=4.5", "servo.rate=200", "sensors.noise=1e-3"]
        result = rollout.run(Scenario.load(folder / "mine.toml", real))
        write.write(measured.log_of(result.scenario, result.record), folder / "log.csv")
        log = (folder / "log.csv").read_bytes()
    files = {"mine.toml": MINE.encode(), "log.toml": COLUMNS.encode()}
    return files | {"log.csv": log, "held.csv": log}


@pytest.fixture
def bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Bench:
    from scipy import optimize

    few = functools.partial(optimize.least_squares, max_nfev=EVALUATIONS)
    monkeypatch.setattr(motions, "WAVES", dict([*motions.WAVES.items()][:1]))
    monkeypatch.setattr(fit, "_scipy", lambda: SimpleNamespace(least_squares=few))
    return Bench(tmp_path, monkeypatch, capfd)


def any_leg(bench: Bench, attempt: Attempt) -> None:
    for name, content in sound().items():
        (bench.folder / name).write_bytes(attempt.content if name == attempt.file else content)
    places = [bench.folder / name for name in ("out.toml", "motion.csv")]
    for place in (*places, *bench.folder.glob("out-*.toml")):
        place.unlink(missing_ok=True)
    args = ["identify", "mine.toml", "log.toml", "--held-out", "held.csv", "--threads", "1"]
    said = bench.lawful(*args, "--out", "out.toml", "--motion", "motion.csv", *attempt.words)
    # Found numbers are written even where they do not carry over; nothing is of a refusal.
    assert places[0].exists() == (said.status < 2)
    if places[0].exists():
        Scenario.load(places[0])


@st.composite
def tables(draw: st.DrawFn) -> bytes:
    """Return a log with other numbers: columns scaled, shifted, held, swapped, with odd cells."""
    head, *rows = sound()["log.csv"].decode().splitlines()
    values = np.array([row.split(",") for row in rows], float)
    for _ in range(draw(st.integers(1, 3))):
        column = draw(st.integers(0, values.shape[1] - 1))
        how = draw(st.sampled_from("scale shift hold swap rows cell".split()))
        if how == "scale":
            values[:, column] *= draw(st.sampled_from((-1.0, 0.0, 1e-9, 57.3, 1e3, 1e9, 1e200)))
        elif how == "shift":
            values[:, column] += draw(st.sampled_from((0.1, -3.0, 7.0, 1e6, 1e18)))
        elif how == "hold":
            values[draw(st.integers(0, len(values) - 1)) :, column] = values[0, column]
        elif how == "swap":
            values[:, [column, 1]] = values[:, [1, column]]
        elif how == "rows":
            begin = draw(st.integers(0, len(values) - 1))
            values = np.delete(values, slice(begin, begin + draw(st.integers(1, 60))), axis=0)
        if not len(values):
            break
        if how == "cell":
            values[draw(st.integers(0, len(values) - 1)), column] = draw(st.floats())
    lines = [",".join(f"{value:.9g}" for value in row) for row in values]
    return "\n".join([head, *lines, ""]).encode()


@st.composite
def attempts(draw: st.DrawFn) -> Attempt:
    """Return a damage of one file, other words, or both."""
    name = draw(st.sampled_from(sorted(sound())))
    content = sound()[name]
    some: list[inputs.Strategy] = [st.just(content), inputs.mutated(content)]
    some.append(inputs.tomls(content.decode()) if name.endswith("toml") else tables())
    return Attempt(name, draw(st.one_of(some)), tuple(draw(_words())))


@st.composite
def _words(draw: st.DrawFn) -> list[str]:
    """Return what is to be fitted, seldom all that usually is, and settings of the scenario."""
    words = [each for key in draw(_keys()) for each in ("--fit", key)]
    if draw(st.integers(0, 3)) == 0:
        words += [part for word in draw(inputs.settings()) for part in ("--set", word)]
    return words + draw(st.sampled_from(([], ["--json"], ["--quiet"])))


def _keys() -> st.SearchStrategy[list[Any]]:
    one = st.sampled_from(KEYS)
    return st.lists(one, min_size=1, max_size=2)


SOUND = Attempt("x", b"", ("--fit", "servo.kt"))
"""Nothing in the log depends on kt: its interval once was +- 0, with a warning."""
LAWS = {"identify": Law(SOUND, attempts(), any_leg, 2, 0.05)}

test_few_inputs_keep_the_law, test_many_inputs_keep_the_law = both_forms(LAWS)
