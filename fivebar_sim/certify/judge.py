"""Judge a program's answers: which are right, and what is wrong with the others."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from fivebar_sim.certify import bits, dialogue, faults, suite
from fivebar_sim.certify.exact import KEYS
from fivebar_sim.certify.faults import Fault
from fivebar_sim.certify.suite import ANSWERS, OK, PRECISIONS, REFUSALS, UNSUPPORTED, Case, Leg
from fivebar_sim.geometry import FiveBar

GREETING = "fivebar 1"
"""The first line that a program gets; it answers with its precision."""

FIRMWARE = "firmware"
"""The precision of a program that is the firmware: its bits are compared too."""

LEAST = 1
"""Right answers without which nothing is certified: a program may not leave out everything."""


NUMBERS = 200
"""Most letters of an answer of numbers that are shown: enough for all of a Jacobian's."""


class Report(NamedTuple):
    """What came of a program.

    Attributes:
        precision: What it said of itself, or "" if it said nothing of use.
        asked: Number of questions.
        right: Number of right answers.
        left_out: Number of questions that it does not support.
        faults: What is wrong, in the order of the questions.
        troubles: What is wrong with the program as a whole, one line each.
    """

    precision: str
    asked: int
    right: int
    left_out: int
    faults: list[Fault]
    troubles: list[str]

    @property
    def passes(self) -> bool:
        """Whether all that it answered is right."""
        return not self.faults and not self.troubles and self.right >= LEAST

    def by_kind(self) -> dict[str, list[Fault]]:
        """Return the faults by kind of question and of fault, the most frequent first."""
        groups: dict[str, list[Fault]] = {}
        for fault in self.faults:
            groups.setdefault(f"{fault.case.kind}: {fault.kind}", []).append(fault)
        return dict(sorted(groups.items(), key=lambda item: -len(item[1])))


def questions(legs: Sequence[Leg]) -> list[str]:
    """Return all lines that a program is sent."""
    lines = [GREETING]
    for leg in legs:
        lines += [leg.line, *(case.line for case in leg.cases)]
    return lines


def judge(legs: Sequence[Leg], said: dialogue.Said) -> Report:
    """Return what comes of a program that said something."""
    asked = sum(len(leg.cases) for leg in legs)
    needed = 1 + asked + len(legs)
    troubles = _troubles(said, needed)
    precision = said.lines[0].strip() if said.lines else ""
    if precision not in PRECISIONS:
        heard = f"got {_short(precision)!r}" if said.lines else "it said nothing"
        troubles.append(f"its first line must be one of {', '.join(PRECISIONS)}; {heard}")
        return Report("", asked, 0, 0, [], troubles)

    found: list[Fault] = []
    right = 0
    left_out = 0
    answers = iter(said.lines[1:])
    for leg in legs:
        taken = next(answers, None)
        if taken is None:
            break
        supported = _is_taken(taken, troubles)
        lines = list(itertools.islice(answers, len(leg.cases)))
        asked_for = [supported and line.strip() != UNSUPPORTED for line in lines]
        wrong = _wrong(leg, precision, lines) if supported else []
        found += wrong
        left_out += len(lines) - sum(asked_for)
        right += sum(asked_for) - len(wrong)

    if not troubles and right + len(found) < LEAST:
        troubles.append("it supports none of the questions")
    return Report(precision, asked, right, left_out, found, troubles)


def _wrong(leg: Leg, precision: str, lines: Sequence[str]) -> list[Fault]:
    """Return what is wrong with the answers to a leg's questions, as far as they came."""
    geometry = geometry_of(leg)
    to_the_bit = precision == FIRMWARE
    golden = bits.answers(geometry, leg.cases) if to_the_bit else lines
    found = []

    for case, line, own in zip(leg.cases, lines, golden, strict=False):
        if line.strip() == UNSUPPORTED:
            continue
        fault = look(geometry, case, precision, line)
        if fault is None and to_the_bit and not bits.same(line, own):
            fault = Fault("other bits than the firmware's", case, _short(line, NUMBERS), own=own)
        if fault is not None:
            found.append(fault)
    return found


def _is_taken(line: str, troubles: list[str]) -> bool:
    """Return whether a program takes a leg, as it answers."""
    word = line.strip()
    if word not in (OK, UNSUPPORTED):
        troubles.append(f"a leg is answered by ok or unsupported; got {_short(line)!r}")
    return word == OK


def _troubles(said: dialogue.Said, needed: int) -> list[str]:
    """Return what is wrong with the whole: how it ended, and how many lines came."""
    troubles = []
    if said.ending:
        words = f"; it wrote: {_short(said.words)}" if said.words else ""
        troubles.append(said.ending + words)
    if len(said.lines) != needed:
        troubles.append(f"each line must get one line: {needed} were sent, {len(said.lines)} came")
    return troubles


def geometry_of(leg: Leg) -> FiveBar:
    """Return the leg as geometry."""
    numbers = [float.fromhex(word) for word in leg.numbers]
    return FiveBar(**dict(zip(KEYS, numbers, strict=True)), scale="any")


def look(leg: FiveBar, case: Case, precision: str, line: str) -> Fault | None:
    """Return what is wrong with the answer to a question, or None."""
    words = line.split()
    if len(words) == 1 and words[0] in REFUSALS:
        if case.may_refuse or not case.answer:
            return None
        return Fault("refused, though there is an answer", case, line)

    numbers = _numbers(words, ANSWERS[case.kind])
    if numbers is None:
        return Fault("not an answer", case, _short(line))
    if not case.answer:
        return Fault(faults.not_refused(case, numbers), case, _short(line, NUMBERS))

    worst, beyond = faults.difference(case, precision, numbers)
    if beyond <= 0.0 and not faults.whole_turn(case, precision, numbers):
        return None
    expected = case.answer[worst]
    name = faults.NAMES[case.kind][worst]
    kind = faults.kind(leg, case, precision, numbers)
    return Fault(kind, case, line, name, expected, numbers[worst])


def _numbers(words: list[str], count: int) -> tuple[float, ...] | None:
    """Return the numbers after `ok`, decimal or hex; None if the words are none."""
    if not words or words[0] != OK or len(words) != 1 + count:
        return None
    try:
        return tuple(map(suite.number, words[1:]))
    except (ValueError, OverflowError):
        return None


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else f"{text[: most - 3]}..."
