"""`conformance/` and `fivebar certify`: right answers, faults by their kinds, bad programs."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from shell import Shell, started

from fivebar_sim.certify import bits, dialogue, judge, suite
from fivebar_sim.certify.suite import Case, Leg

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = Path(__file__).resolve().parent / "leg_programs"
LEGS = suite.load()


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    return Shell(tmp_path, capsys)


def found(name: str, *args: str) -> judge.Report:
    """Return what comes of one of the test programs."""
    command = [sys.executable, str(PROGRAMS / f"{name}.py"), *args]
    return judge.judge(LEGS, dialogue.ask(command, judge.questions(LEGS), 60.0))


def the(kind: str, leg: str) -> tuple[Leg, Case]:
    """Return the first case of a kind that has an answer."""
    (chosen,) = (each for each in LEGS if each.name == leg)
    return chosen, next(
        case
        for case in chosen.cases
        if case.kind == kind and case.trap in ("closed", "anywhere") and case.answer
    )


def look(leg: Leg, case: Case, numbers: list[float], precision: str = "float64") -> str | None:
    """Return the kind of fault in an answer of some numbers, or None."""
    line = " ".join(["ok", *map(float.hex, numbers)])
    fault = judge.look(judge.geometry_of(leg), case, precision, line)
    return None if fault is None else fault.kind


def test_every_answer_is_right_by_crossings_of_circles(right: ModuleType) -> None:
    """The independent controller of leg_programs/right.py, within the tolerance of float64."""
    for leg in LEGS:
        numbers = right.Leg(*map(float.fromhex, leg.numbers))
        for case in (case for case in leg.cases if case.kind != "nearest"):
            inputs = [float.fromhex(word) for word in case.inputs]
            finite = all(map(math.isfinite, inputs))
            answer = right.SOLVERS[case.kind](numbers, inputs) if finite else None
            line = "refused" if answer is None else " ".join(["ok", *map(float.hex, answer)])
            assert judge.look(judge.geometry_of(leg), case, "float64", line) is None, case


def test_all_traps_are_there() -> None:
    counts = Counter((case.trap, case.kind) for leg in LEGS for case in leg.cases)
    for trap in ("edge-A", "edge-E", "exact-edge", "fold-A", "half-turn", "on-A", "nan", "far"):
        assert counts[trap, "inverse"] >= 10, trap
    assert counts["turns", "forward"] >= 20
    assert counts["inside", "nearest"] >= 80
    by_name = {leg.name: judge.geometry_of(leg) for leg in LEGS}
    assert by_name["coaxial"].L5 == by_name["doggo"].L5 == 0.0
    assert by_name["turned"].tilt > math.pi / 2.0
    assert abs(by_name["turned"].bend) > math.pi / 2.0
    assert by_name["unequal"].L2 != by_name["unequal"].L3
    # B on D, exactly, and B, C and D in line, exactly: no made-up answer.
    of = [case for leg in LEGS for case in leg.cases if case.trap == "axis"]
    assert {case.leg for case in of if case.kind == "forward" and not case.answer} >= {"coaxial"}
    assert {case.leg for case in of if case.kind == "jacobian" and not case.answer} >= {"flat"}
    size = sum(path.stat().st_size for path in (ROOT / suite.FOLDER).iterdir())
    assert size < 700_000


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("kind", list(suite.ANSWERS))
def test_three_tolerances_off_is_found(kind: str, precision: str) -> None:
    leg, case = the(kind, "extended")
    within = case.within[precision == "float64"]
    assert 0.0 < case.within[1] < 1e-6 * case.within[0]
    for k in range(len(case.answer)):
        numbers = list(case.answer)
        numbers[k] += 0.9 * within
        assert look(leg, case, numbers, precision) is None
        numbers[k] += 2.1 * within
        assert look(leg, case, numbers, precision) == "imprecise"


def test_known_faults_get_their_names() -> None:
    leg, case = the("inverse", "unequal")
    a, e = case.answer
    degrees = math.degrees(a), math.degrees(e)
    tilt = judge.geometry_of(leg).tilt
    assert look(leg, case, [-a, -e]) == "wrong sign"
    assert look(leg, case, [e, a]) == "A and E exchanged"
    assert look(leg, case, [*degrees]) == "degrees"
    assert look(leg, case, [a - tilt, e - tilt]) == "tilt left out"
    assert look(leg, case, [a + math.pi / 2.0, e + math.pi / 2.0]).startswith("90 deg + angle")  # pyright: ignore[reportOptionalMemberAccess]
    assert look(leg, case, [a, e + math.copysign(2.0 * math.pi, -e)]) == "a whole turn off"
    assert look(leg, case, [a, math.nan]) == "NaN"
    assert look(leg, case, [a, math.inf]) == "infinite"
    assert look(leg, case, [a, e + 0.5]) == "wrong"
    assert look(leg, case, [a, e, 0.0]) == "not an answer"
    cut = [float(math.trunc(each)) for each in degrees]
    assert look(leg, case, cut, "degrees") == "truncated, not rounded"

    leg, case = the("jacobian", "extended")
    xa, xe, za, ze = case.answer
    assert look(leg, case, [xa, za, xe, ze]) == "transposed"
    assert look(leg, case, [xe, xa, ze, za]) == "A and E exchanged"
    assert look(leg, case, [1e3 * each for each in case.answer]) == "millimetres"
    leg, case = the("torque", "extended")
    assert look(leg, case, [-each for each in case.answer]) == "wrong sign"
    leg, case = the("forward", "extended")
    assert look(leg, case, [case.answer[0], -case.answer[1]]) == "z downwards"


def test_published_faults_are_found_and_nothing_else() -> None:
    """One controller answers 0 out of reach, one takes the wrong branch where a servo ends."""
    zero = found("zero")
    assert {*zero.by_kind()} == {
        "inverse: out of reach: not refused, answered 0",
        "inverse: on the edge: answered 0",
    }
    fallback = found("fallback")
    sides = ("A", "E", "A and E")
    assert {*fallback.by_kind()} == {f"inverse: wrong branch of {side}" for side in sides}
    truncated = found("whole_degrees", "truncated")
    assert {*truncated.by_kind()} == {"inverse: truncated, not rounded"}
    for report in (zero, fallback, truncated):
        assert len(report.faults) > 500
        assert report.right > 500
        assert report.right + len(report.faults) + report.left_out == report.asked
        assert report.troubles == []
        assert not report.passes


def test_firmware_gives_its_own_bits(tmp_path: Path) -> None:
    """The C code of `firmware/`, and with another last bit it is found."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    firmware = ROOT / "firmware"
    sources = [str(PROGRAMS / "firmware.c"), str(firmware / "fivebar_leg.c")]
    lines: list[str] = []
    for flags, precision in ((("-DFIVEBAR_DOUBLE",), "float64"), ((), "firmware")):
        program = tmp_path / precision
        # Not optimised: test_firmware_bits.py does, with every compiler.
        strict = ["-std=c99", "-O0", "-Wall", "-Wextra", "-pedantic", "-Werror", *flags]
        build = [compiler, *strict, "-I", str(firmware), "-o", str(program), *sources]
        subprocess.run(build, check=True)
        said = dialogue.ask([str(program)], judge.questions(LEGS), 60.0)
        lines = said.lines
        report = judge.judge(LEGS, said)
        assert report.precision == precision
        assert (report.right, report.faults, report.troubles) == (report.asked, [], [])

    # One number of the first leg is moved by its last bit: well within float32.
    lines = lines[: 2 + len(LEGS[0].cases)]
    said = dialogue.Said(lines, "", "")
    row = next(k for k, line in enumerate(lines) if line.startswith("ok 0x"))
    word = lines[row].split()[1]
    moved = np.nextafter(np.float32(float.fromhex(word)), np.float32(np.inf))
    lines[row] = lines[row].replace(word, float(moved).hex())
    assert judge.judge(LEGS[:1], said).by_kind().keys() == {
        "inverse: other bits than the firmware's"
    }
    lines[0] = "float32"
    assert judge.judge(LEGS[:1], said).passes


def test_decimal_answers_are_numbers_too() -> None:
    """Also with an exponent, of whatever precision."""
    leg = LEGS[0]
    exact = [case.answer for case in leg.cases]
    own = bits.answers(judge.geometry_of(leg), leg.cases)
    held = [tuple(map(float.fromhex, line.split()[1:])) for line in own]
    for precision, answers in (("float64", exact), ("firmware", held)):
        # How the firmware refuses is looked at too.
        lines = [
            " ".join(["ok", *map(repr, numbers)]) if numbers else word
            for numbers, word in zip(answers, own, strict=True)
        ]
        assert any("e-" in line for line in lines)
        report = judge.judge([leg], dialogue.Said([precision, "ok", *lines], "", ""))
        assert (report.right, report.faults, report.troubles) == (report.asked, [], [])


def test_command_says_what_is_wrong_and_where(shell: Shell) -> None:
    said = shell("certify", "--quiet", "--", sys.executable, str(PROGRAMS / "right.py"))
    assert said == (0, "", "")
    said = shell("certify", "--", sys.executable, str(PROGRAMS / "whole_degrees.py"))
    assert said.status == 0
    assert said.out.endswith(" 0 wrong, 2962 not supported: pass\n")
    said = shell("certify", "--examples", "1", "--", sys.executable, str(PROGRAMS / "fallback.py"))
    assert said.status == 1
    first, second, *_, last = said.out.splitlines()
    assert first.endswith("inverse: wrong branch of A and E")
    assert second.split(": ")[0].strip() == "airhockey (anywhere)"
    assert " must be " in second
    assert last.startswith("float64: ")
    assert last.endswith(": fail")


def test_answer_of_many_digits_is_not_shown_in_full() -> None:
    leg = LEGS[0]
    case = next(each for each in leg.cases if not each.answer and each.kind == "inverse")
    line = " ".join(["ok", "0" * 5000 + "1", "2"])
    fault = judge.look(judge.geometry_of(leg), case, "float64", line)
    assert fault is not None
    assert len(fault.got) == judge.NUMBERS


HELLO = "import sys; sys.stdout.write('float64\\n'); sys.stdout.flush()\n"
BAD = {
    "silent": ("import time; time.sleep(60)", "had not ended after 0.3 s"),
    "goes on": (HELLO + "sys.stdin.read(); import time; time.sleep(60)", "had not ended"),
    "dies": (HELLO + "sys.exit('no leg')", "ended with status 1; it wrote: no leg"),
    "killed": (HELLO + "import os; os.kill(os.getpid(), 9)", "ended by signal SIGKILL"),
    "endless": ("import sys\nwhile 1: sys.stdout.write('ok\\n' * 9999)", "printed more than"),
    "no line end": ("import sys\nwhile 1: sys.stdout.write('x' * 9999)", "printed more than"),
    "shut": (
        HELLO + "import os, time; os.close(1); os.close(2); time.sleep(60)",
        "closed its output",
    ),
    "binary": ("import os; os.write(1, bytes(range(256)) * 40)", "its first line must be one of"),
    "nothing": ("", "it said nothing"),
    "deaf": (HELLO + "sys.stdin.close()", "2 came"),
    "empty": (HELLO + "print('\\n' * 9999)", "a leg is answered by ok or unsupported; got ''"),
}


@pytest.mark.parametrize("how", list(BAD))
def test_bad_program_is_told_and_ended(how: str) -> None:
    code, expected = BAD[how]
    timeout = 0.3 if "sleep" in code else 20.0
    if how == "deaf":
        expected = "1 came"
    said = dialogue.ask([sys.executable, "-S", "-c", code], judge.questions(LEGS), timeout)
    report = judge.judge(LEGS, said)
    assert not report.passes
    assert any(expected in trouble for trouble in report.troubles), report.troubles


def test_child_that_keeps_the_pipe_holds_nobody_up(tmp_path: Path) -> None:
    """The program ends at once; what it started has its output, and is ended with it."""
    note = tmp_path / "pid"
    code = f"sleep 60 & echo $! > {note}; echo float64"
    said = dialogue.ask(["sh", "-c", code], ["fivebar 1"], 20.0)
    assert (said.lines, said.ending) == (["float64"], "")
    assert gone(int(note.read_text()))


def gone(pid: int) -> bool:
    """Return whether a process has ended, waiting a little for its parent to notice."""
    for _ in range(200):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.01)
    return False


def test_ctrl_c_ends_the_program_too(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    code = f"sleep 60 & echo $! > {note}.part; mv {note}.part {note}; trap '' INT TERM; sleep 60"
    command = [sys.executable, "-m", "fivebar_sim", "certify", "--timeout", "60"]
    process = started([*command, "--", "sh", "-c", code], cwd=ROOT)
    while not note.exists():
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, b"")
    assert err.endswith(b"interrupted\n")
    assert gone(int(note.read_text()))


def test_refusals(shell: Shell, tmp_path: Path) -> None:
    assert shell.refused("certify") == "name the program to certify"
    assert shell.refused("certify", "no-such") == "cannot start no-such: No such file or directory"
    (tmp_path / "plain").write_text("not a program")
    assert shell.refused("certify", "./plain") == "cannot start ./plain: Permission denied"
    message = shell.refused("certify", "--timeout", "0", "cat")
    assert message.startswith("--timeout must be ")
