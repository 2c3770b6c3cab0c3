"""`fivebar certify`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Words, spinner
from fivebar_sim.cli.terminal import FAILED
from fivebar_sim.errors import ConfigError

if TYPE_CHECKING:
    from fivebar_sim.certify.faults import Fault
    from fivebar_sim.certify.judge import Report

UNITS = {
    **dict.fromkeys(("forward", "knees", "nearest"), "m"),
    **{"inverse": "rad", "jacobian": "m/rad", "torque": "N m"},
}
"""Of the numbers of an answer."""

EXAMPLES = 2
"""Faults of each kind that are shown."""


def certify(
    program: Positional[Annotated[Words, arg(metavar="PROGRAM [ARG ...]")]],
    /,
    *,
    timeout: Annotated[float, arg(metavar="SECONDS")] = 30.0,
    examples: int = EXAMPLES,
    quiet: bool = False,
) -> int:
    """Check any program that computes a leg against known answers.

    Exit status 1 if an answer is wrong.

    The program reads questions line by line from its standard input and answers each with a line:
    docs/conformance.md has the words. It may leave out what it does not support. Options of the
    program itself come after `--`: `fivebar certify -- python3 -u mine.py`.

    Args:
        program: The program and its arguments.
        timeout: Longest time that the program may take for all questions.
        examples: Faults of each kind that are shown.
        quiet: Print nothing but errors.
    """
    from fivebar_sim.certify import dialogue, judge, suite
    from fivebar_sim.checks import check_number
    from fivebar_sim.cli.program import user_environment

    if not program:
        raise ConfigError("name the program to certify")
    check_number("--timeout", timeout, "s", low=0.0, high=3600.0, strict=True)

    legs = suite.load()
    with spinner(f"asking {program[0]}", quiet=quiet):
        said = dialogue.ask(program, judge.questions(legs), timeout, user_environment())
        report = judge.judge(legs, said)
    if not quiet:
        _print(report, max(examples, 1))
    return 0 if report.passes else FAILED


def _print(report: Report, examples: int) -> None:
    """Print what came of a program."""
    for trouble in report.troubles:
        print(f"trouble: {trouble}")  # noqa: T201
    for kind, found in report.by_kind().items():
        print(f"{len(found):5d}  {kind}")  # noqa: T201
        for fault in found[:examples]:
            print(f"       {_told(fault)}")  # noqa: T201

    missed = report.asked - report.right - report.left_out - len(report.faults)
    never = f", {missed} never answered" if missed else ""
    verdict = "pass" if report.passes else "fail"
    print(  # noqa: T201
        f"{report.precision or 'unknown precision'}: {report.asked} questions, "
        f"{report.right} right, {len(report.faults)} wrong, "
        f"{report.left_out} not supported{never}: {verdict}"
    )


def _told(fault: Fault) -> str:
    """Return a fault as a line: where, what was expected, what came."""
    case = fault.case
    signs = 2 if case.kind == "inverse" else 1
    values = [f"{float.fromhex(word):.9g}" for word in case.inputs[signs:]]
    where = f"{case.leg} ({case.trap}): {' '.join([case.kind, *case.inputs[:signs], *values])}"

    if not case.answer:
        return f"{where}: must be refused, got {fault.got.strip()!r}"
    if fault.own:
        return f"{where}: must be {fault.own!r}, got {fault.got.strip()!r}"
    if not fault.name:
        numbers = " ".join(f"{value:.9g}" for value in case.answer)
        return f"{where}: expected {numbers}, got {fault.got.strip()!r}"
    unit = UNITS[case.kind]
    return f"{where}: {fault.name} must be {fault.expected:.9g} {unit}, got {fault.came:.9g}"
