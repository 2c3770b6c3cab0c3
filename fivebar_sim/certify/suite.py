"""The questions and answers of `conformance/`, read from their text.

docs/conformance.md has the format.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources

FOLDER = "conformance"

OK = "ok"
REFUSALS = ("unreachable", "open", "singular", "refused")
"""The words with which a question is refused; any of them will do."""

UNSUPPORTED = "unsupported"

ANSWERS = {"inverse": 2, "forward": 2, "knees": 4, "jacobian": 4, "torque": 2, "nearest": 2}
"""The kinds of questions, and how many numbers answer one."""

PRECISIONS = ("float32", "float64", "degrees", "firmware")
"""What a program says of itself; "firmware" is float32, and the firmware's own bits."""


class Case(NamedTuple):
    """A question with its answer.

    Attributes:
        leg: Name of the leg.
        trap: What is special about it: "edge", "fold", ...
        kind: One of `ANSWERS`.
        inputs: The words after the kind, as they are sent.
        answer: The exact numbers; () where the question has to be refused.
        within: Tolerance of each number, for float32 and for float64.
        may_refuse: Whether a refusal is right as well: at the very edge, rounding decides.
    """

    leg: str
    trap: str
    kind: str
    inputs: tuple[str, ...]
    answer: tuple[float, ...]
    within: tuple[float, float]
    may_refuse: bool

    @property
    def line(self) -> str:
        """The question as it is sent."""
        return " ".join([self.kind, *self.inputs])


class Leg(NamedTuple):
    """A leg: name, (L1..L6 [m], bend, tilt [rad]) as they are sent, and its cases."""

    name: str
    numbers: tuple[str, ...]
    cases: tuple[Case, ...]

    @property
    def line(self) -> str:
        """The leg as it is sent."""
        return " ".join(["leg", *self.numbers])


def number(word: str) -> float:
    """Return a number of an answer, hex or decimal: as C prints it, by %a or %g.

    Raises:
        ValueError: The word is no number.
        OverflowError: A hex number beyond the largest one.
    """
    return float.fromhex(word) if "x" in word.lower() else float(word)


def load(place: Path | None = None) -> list[Leg]:
    """Return the legs of a folder's files, sorted by name; None is the shipped folder.

    Raises:
        ConfigError: A file that cannot be read, or a line that is not in the format.
    """
    folder = resources.folder(FOLDER) if place is None else place
    return [read(path) for path in sorted(folder.glob("*.txt"))]


def read(path: Path) -> Leg:
    """Return the leg of a file, with its cases."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"cannot read {path}: {error}") from None

    name = ""
    numbers: tuple[str, ...] = ()
    cases = []
    for row, line in enumerate(lines, 1):
        words = line.split()
        if not words or words[0] == "#":
            continue
        try:
            if words[0] == "leg":
                name, *rest = words[1:]
                numbers = tuple(rest)
            else:
                cases.append(case(name, words))
        except (ValueError, LookupError) as error:
            raise ConfigError(f"{path}, line {row}: not in the format: {error}") from None

    return Leg(name, numbers, tuple(cases))


def case(leg: str, words: list[str]) -> Case:
    """Return the case of a line's words.

    Raises:
        ValueError: The words are not in the format.
        LookupError: An unknown kind of question, or too few numbers.
    """
    middle = words.index("=")
    trap, kind, *inputs = words[:middle]
    status, *rest = words[middle + 1 :]
    if status in REFUSALS and not rest:
        return Case(leg, trap, kind, tuple(inputs), (), (0.0, 0.0), may_refuse=True)

    count = ANSWERS[kind]
    numbers = tuple(float.fromhex(word) for word in rest[:count])
    within = (float(rest[count + 1]), float(rest[count + 2]))
    alternative = rest[count + 3 :]
    if status != OK or rest[count] != "within" or alternative not in ([], ["or", "refused"]):
        raise ValueError(f"an answer is {OK}, {count} numbers, within, and two tolerances")
    return Case(leg, trap, kind, tuple(inputs), numbers, within, bool(alternative))
