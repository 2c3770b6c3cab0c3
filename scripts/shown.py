"""What a page of the documentation shows, and whether something printed is that; see check_docs."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from decimal import Decimal
from typing import NamedTuple

NOTE = re.compile(r"<!--\s*(printed by(?:, long)?|long|status|not checked):\s*(.*?)\s*-->", re.S)
NUMBER = r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)"
TOKEN = re.compile(rf"{NUMBER}|\w+|[^\w\s]")
NOISE = 1e-8
RULES = str.maketrans("", "", "─│")


class WrongError(Exception):
    """What a page says is not so."""


class Item(NamedTuple):
    """A block, a table or a paragraph: `kind` is the block's language, or its own name."""

    kind: str
    line: int
    text: str
    title: str
    note: str
    said: str


def items(page: str) -> Iterator[Item]:
    """Yield the items of a page in order."""
    lines = page.splitlines()
    at = 0
    note = ("", "")
    while at < len(lines):
        line = lines[at]
        if not line:
            at += 1
        elif line.startswith("<!--"):
            note, at = _note(lines, at)
        elif line.startswith("```"):
            end = _closing(lines, at)
            language, _, rest = line[3:].partition(" ")
            named = re.fullmatch(r'title="(.+)"', rest)
            title = named[1] if named else ""
            yield Item(language or "text", at + 1, "\n".join(lines[at + 1 : end]), title, *note)
            at = end + 1
            note = ("", "")
        else:
            end = _last(lines, at)
            kind = "table" if line.startswith("|") else "paragraph"
            yield Item(kind, at + 1, "\n".join(lines[at : end + 1]), "", *note)
            at = end + 1
            note = ("", "")


def _closing(lines: list[str], at: int) -> int:
    """Return where the block that begins at a line ends."""
    if "```" not in lines[at + 1 :]:
        raise WrongError(f"line {at + 1}: a block without an end")
    return lines.index("```", at + 1)


def _note(lines: list[str], at: int) -> tuple[tuple[str, str], int]:
    """Return the comment that begins at a line, and the line after it."""
    end = at
    while "-->" not in lines[end] and end + 1 < len(lines):
        end += 1
    found = NOTE.fullmatch("\n".join(lines[at : end + 1]))
    if found is None:
        raise WrongError(f"line {at + 1}: no such comment: {lines[at]}")
    return (found[1], " ".join(found[2].split())), end + 1


def _last(lines: list[str], at: int) -> int:
    """Return the last line of the table or the paragraph that begins at a line."""
    while at + 1 < len(lines) and lines[at + 1] and lines[at + 1][:3] not in ("```", "<!-"):
        at += 1
    return at


def close(shown: str, came: str) -> bool:
    """Return whether a printed number is the one that a page shows."""
    a = Decimal(shown.replace(",", ""))
    b = Decimal(came.replace(",", ""))
    if 0 < abs(a) < NOISE:
        return abs(b) <= 10 * abs(a)
    digits = a.as_tuple().digits
    exponent = int(a.as_tuple().exponent)
    return abs(a - b) <= Decimal(1 if len(digits) >= 3 else 0.5).scaleb(exponent)


def alike(shown: list[str], came: list[str]) -> bool:
    """Return whether tokens are the same, numbers within their tolerance."""
    pairs = zip(shown, came, strict=False)
    return len(shown) == len(came) and all(
        close(a, b) if re.fullmatch(NUMBER, a) and re.fullmatch(NUMBER, b) else a == b
        for a, b in pairs
    )


def tokens(text: str) -> list[str]:
    """Return words, numbers and signs."""
    return TOKEN.findall(text.translate(RULES))


def holds(line: list[str], shown: list[str]) -> bool:
    """Return whether a line of tokens has others somewhere in a row."""
    size = len(shown)
    return any(alike(shown, line[k : k + size]) for k in range(len(line) - size + 1))


def compare_lines(shown: str, came: str) -> None:
    """Raise unless all lines shown are in what came, in order."""
    if not tokens(shown):
        raise WrongError(f"shows nothing of\n{came}")

    rest = [tokens(line) for line in came.splitlines()]
    for line in filter(tokens, shown.splitlines()):
        parts = [tokens(part) for part in line.split("...")]
        for k, other in enumerate(rest):
            if alike(parts[0], other) if len(parts) == 1 else all(holds(other, p) for p in parts):
                rest = rest[k + 1 :]
                break
        else:
            near = difflib.get_close_matches(line, came.splitlines(), n=1, cutoff=0.3) or [
                "nothing"
            ]
            raise WrongError(
                f"shows\n    {line.strip()}\n  but what is printed has\n    {near[0].strip()}"
            )


def labelled(came: str, label: str) -> list[str]:
    """Return the tokens after a label that begins a line."""
    for line in came.splitlines():
        if re.match(rf"\s*{re.escape(label)}\s\s", line + "  "):
            return tokens(line.strip()[len(label) :])
    raise WrongError(f"has {label!r}, which is not in what is printed:\n{came}")


def compare_values(shown: str, paragraph: str, came: str) -> None:
    """Raise unless a paragraph has all values, and a command printed them."""
    for value in shown.split(";"):
        label, _, number = value.strip().rpartition(": ")
        if number not in " ".join(paragraph.split()):
            raise WrongError(f"does not have {number!r}")
        lines = [labelled(came, label)] if label else [tokens(each) for each in came.splitlines()]
        if not any(holds(line, tokens(number)) for line in lines):
            raise WrongError(f"has {value!r}, which is not in what is printed:\n{came}")


def cells(row: str) -> list[str]:
    """Return the cells of a table's row."""
    return [cell.strip() for cell in row.strip("|").split("|")]
