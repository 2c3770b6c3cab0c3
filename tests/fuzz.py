"""Any input against one law: a status and one clear line, or a run that is right; nothing else."""

from __future__ import annotations

import functools
import math
import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import fuzz_verify
import hypothesis
import pytest
import tyro
from hypothesis import HealthCheck, example, given, settings
from hypothesis.strategies import SearchStrategy
from shell import Said

from fivebar_sim import cli
from fivebar_sim.runs import directory
from fivebar_sim.scenario import together

STEPS = 2000
"""Steps that a run may have here; the program's own bound is tried in test_robust.py."""
SECONDS = 20.0
"""Processor time that one input may take [s]; most take a hundredth of one."""
LINE = 1000
"""Characters that one clear line may have."""
INPUTS = 100_000
MINUTES = 25.0
"""Processor time of the long form of all laws: it ends with whichever comes first."""
SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
"""What is no fault here: a simulation takes its time."""
LEAST = 10_000
"""Inputs of the long form, however long they take."""
ROUND = 250
"""Inputs of the long form between two looks at the clock."""


class Bench:
    """A folder in which `fivebar` is called within this process, and whatever it does is judged."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        capture: pytest.CaptureFixture[str],
    ) -> None:
        self.folder = folder
        self.capture = capture
        self.seen = Counter[str]()
        self.last = Said(0, "", "")
        monkeypatch.chdir(folder)
        monkeypatch.setattr(together, "MOST_STEPS", STEPS)
        monkeypatch.setattr(tyro, "cli", parsed_once(tyro.cli))
        for screen in ("DISPLAY", "WAYLAND_DISPLAY"):
            monkeypatch.delenv(screen, raising=False)

    def __call__(self, *args: str) -> Said:
        """Return what a command came to; its own way out of wrong words is one, too."""
        self.capture.readouterr()
        with _timed():
            try:
                status = cli.main(args)
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
        out, err = self.capture.readouterr()
        self.seen[f"{args[0] if args else ''} {status}"] += 1
        self.last = Said(status, out, err)
        return self.last

    def lawful(self, *args: str) -> Said:
        """Return what a command came to, which must be lawful; nothing half written is left."""
        said = self(*args)
        check_said(said, args)
        left = [p.name for p in self.folder.rglob("*") if p.suffix in (".partial", ".old")]
        left += [p.name for p in self.folder.rglob("*") if p.name.startswith(".fivebar-")]
        assert left == [], args
        assert not (self.folder / "MUJOCO_LOG.TXT").exists(), args
        return said

    def run(self, *args: str) -> Said:
        """Return what a run came to; one that was accepted is checked by what it wrote."""
        place = self.folder / "out"
        said = self.lawful("run", *args, "--out", "out", "--quiet")
        assert said.out == ""
        assert said.status in (0, 1, 2), args
        written = place.exists()
        assert written == (said.status < 2 and not said.err), (args, said)
        if written:
            verdict = fuzz_verify.check(place)
            assert (verdict != "fail") == (said.status == 0)
            self.seen[f"run {verdict}"] += 1
            self.clear(place)
        return said

    @staticmethod
    def clear(place: Path) -> None:
        """Delete a whole run directory."""
        directory.check_run(place)
        for file in place.iterdir():
            file.unlink()
        place.rmdir()


def parsed_once(cli: Callable[..., Any]) -> Callable[..., Any]:
    """Return the parser with a memory: most inputs are files, whose command lines are all alike.

    Wrong words are parsed each time; whoever tries words tries other ones.
    """

    def parse(command: Callable[..., int], *, args: Sequence[str], **how: Any) -> int:
        key = (how["prog"], *args)
        if key not in _parsed:
            told: list[tuple[Any, Any]] = []

            @functools.wraps(command)
            def hear(*given: Any, **options: Any) -> int:
                told.append((given, options))
                return 0

            cli(hear, args=args, **how)
            _parsed[key] = told[0]
        given, options = _parsed[key]
        return command(*given, **options)

    return parse


_parsed: dict[tuple[str, ...], tuple[Any, Any]] = {}
"""What command lines mean."""


def spent() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def check_said(said: Said, args: tuple[str, ...]) -> None:
    """Fail unless an end of the program is one that its users may meet."""
    assert said.status in (0, 1, 2), (args, said)
    assert "Traceback" not in said.err, (args, said)
    for text in (said.out, said.err):  # nothing that a terminal obeys
        assert text.replace("\n", "").isprintable(), (args, said)
    if said.status == 0:
        assert said.err == "", args
    elif said.err.startswith("╭"):  # the parser's own box
        assert said.status == 2
    elif said.err or said.status == 2:
        lines = said.err.splitlines()
        assert said.err.endswith("\n"), (args, said)
        assert said.status == 1 or len(lines) == 1, (args, said)
        for line in lines:
            assert line.startswith("fivebar: "), (args, line)
            assert len(line) <= LINE, (args, line)
            assert line.isprintable(), (args, line)
            assert len(line) > len("fivebar: "), args


@contextmanager
def _timed() -> Iterator[None]:
    """Fail what takes too much of the processor: a hang, or as good as one."""

    def late(number: int, frame: object) -> NoReturn:
        raise TimeoutError(f"more than {SECONDS} s of processor time")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


class Law(NamedTuple):
    """What inputs are held against, a few of them always, a great many in the long form.

    Attributes:
        sound: An input that the program does not refuse, tried first.
        inputs: What is tried.
        holds: Fails unless the program does right by one input.
        few: Inputs of the short form, always the same ones.
        share: Part of the long form's inputs and time.
    """

    sound: Any
    inputs: SearchStrategy[Any]
    holds: Callable[[Bench, Any], object]
    few: int
    share: float

    def try_few(self, bench: Bench) -> None:
        """Try the law with few inputs."""
        self._try(bench, self.few, 0)

    def try_many(self, bench: Bench) -> int:
        """Try the law with many inputs, other ones in every round; return how many it was."""
        end = spent() + 60.0 * MINUTES * self.share
        rounds = math.ceil(INPUTS * self.share / ROUND)
        for done in range(1, rounds + 1):
            self._try(bench, ROUND, done)
            if spent() > end and done * ROUND >= LEAST * self.share:
                return done * ROUND
        return rounds * ROUND

    def _try(self, bench: Bench, examples: int, seed: int) -> None:
        @hypothesis.seed(seed)
        @settings(
            max_examples=examples,
            database=None,
            print_blob=False,
            suppress_health_check=SLOW,
        )
        @given(self.inputs)
        @example(self.sound)
        def holds(value: Any) -> None:
            self.holds(bench, value)

        holds()


def both_forms(laws: Mapping[str, Law]) -> tuple[Callable[..., None], Callable[..., None]]:
    """Return the two tests of some laws, with few inputs and with many; they need a `bench`."""

    @pytest.mark.parametrize("name", laws)
    def few(bench: Bench, name: str) -> None:
        laws[name].try_few(bench)
        assert len(bench.seen) > 1  # some are refused, some are not

    @pytest.mark.long
    @pytest.mark.parametrize("name", laws)
    def many(bench: Bench, name: str) -> None:
        assert laws[name].try_many(bench) > 0

    return few, many
