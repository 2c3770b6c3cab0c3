"""What scripts/check_docs.py and shown.py let pass of the documentation, and what not."""

from __future__ import annotations

import dataclasses
import re
import runpy
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from fivebar_sim import FiveBar, geometry

SCRIPTS = Path(__file__).parents[1] / "scripts"
PRINTED = """run: classic leg
 metric           value      limit  verdict
 ────────────────────────────────────────
 tracking RMS  1.1921 mm  <= 1.3 mm  pass
 tracking max  1.566 mm
 branch flips         0
"""
PAGE = """
```toml title="a/b.toml"
x = 1.5
```

```sh
test -f a/b.toml && test -d scenarios
```

```console
$ cat a/b.toml
x = 1.5
```

<!-- status: 3 -->

```sh
exit 3
```

```python
y = 2.5
```

<!-- printed by: printf 'tracking RMS\\t\\t%s mm' {1} -->

| settings | tracking RMS [mm] | |
| --- | --- | --- |
| 1.25 | 1.25 | a remark |

<!-- printed by: echo limits={} && printf '| a | b |\\n| 1.254 | x |\\n' -->

| a | b |
| --- | --- |
| 1.25 | x |

```python
print(y)
```

<!-- printed by: python -->

```text
2.5
```

<!-- not checked: a law -->

```text
F = 0.5 x
```

<!-- long: it fails -->

```sh
false
```
"""


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    sys.path.insert(0, str(SCRIPTS))
    try:
        return runpy.run_path(str(SCRIPTS / "check_docs.py"))
    finally:
        sys.path.remove(str(SCRIPTS))


@pytest.fixture
def wrong(script: dict[str, Any], tmp_path: Path):
    """Return what is wrong in a page of this text."""

    def check(text: str, *, long: bool = False) -> list[str]:
        folder = tmp_path / "page"
        folder.mkdir()
        page = script["Page"](text, folder, long=long)
        found = []
        page.lay()
        for item in page.items:
            try:
                page.check(item)
            except script["WrongError"] as error:
                found.append(f"{item.line}: {error}")
        return found

    return check


@pytest.mark.parametrize(
    ("shown", "came", "same"),
    [
        ("1.19", "1.1921", True),
        ("1.20", "1.1921", True),  # three digits: off by one in the last is another machine's
        ("1.21", "1.1921", False),
        ("1.3", "1.1921", False),
        ("1", "1.1921", True),
        ("0", "0.6", False),
        ("42", "43", False),
        ("-0.5", "0.5", False),
        ("2.23e+04", "22300", True),
        ("339,000", "338999.7", True),
        ("4e-14", "3e-13", True),  # rounding errors, at most ten times as large
        ("4e-14", "5e-13", False),
        ("4e-14", "0.1", False),
    ],
)
def test_numbers_as_close_as_they_are_shown(
    script: dict[str, Any], shown: str, came: str, same: bool
) -> None:
    assert script["alike"]([shown], [came]) is same


def test_lines_in_order(script: dict[str, Any]) -> None:
    compare = script["compare_lines"]
    error = script["WrongError"]
    compare(" tracking RMS  1.192 mm  <= 1.3 mm  pass\n branch flips 0", PRINTED)
    compare("tracking RMS ... pass", PRINTED)
    for lines in (
        "tracking RMS  1.195 mm  <= 1.3 mm  pass",  # a number
        "tracking RMS  1.192 um  <= 1.3 mm  pass",  # a unit
        "tracking RMS  1.192 mm",  # half a line
        "branch flips 0\ntracking max 1.566 mm",  # the other way round
        "tracking RMS ... fail",
        "",
    ):
        with pytest.raises(error, match="shows"):
            compare(lines, PRINTED)


def test_values_of_a_paragraph(script: dict[str, Any]) -> None:
    compare = script["compare_values"]
    error = script["WrongError"]
    compare("tracking RMS: 1.19 mm; 1.566 mm", "It is 1.19 mm, at\nmost 1.566 mm.", PRINTED)
    for values, text in (
        ("tracking RMS: 1.19 mm", "It is 1.20 mm."),  # the paragraph says another
        ("tracking max: 1.19 mm", "It is 1.19 mm."),  # another line's
        ("1.19 um", "It is 1.19 um."),
        ("tracking mean: 1.19 mm", "It is 1.19 mm."),  # no such line
    ):
        with pytest.raises(error):
            compare(values, text, PRINTED)


def test_a_page_that_is_so(wrong: Any) -> None:
    assert wrong(PAGE) == []


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("```sh\nfalse\n```", "ends with status 1, not 0"),
        ("<!-- long: slow -->\n\n```sh\nfalse\n```", "ends with status 1, not 0"),
        ("<!-- status: 1 -->\n\n```sh\ntrue\n```", "ends with status 0, not 1"),
        ("```console\n$ echo 1.5\n1.7\n```", "1.7"),
        ("```sh\nfivebar check nothing.toml\ntouch here\n```", "nothing.toml: No such file"),
        ("```sh\n.venv/bin/fivebar \\\n  check nothing.toml # this\n```", "ends with status 2"),
        ("```python\n1 / 0\n```", "line 2, in <module>"),  # the page's own line
        ("```text\n1.5 mm\n```", "no comment says what prints them"),
        ("| a |\n| --- |\n| 1.5 |", "no comment says what prints them"),
        ("<!-- printed by: echo 1.5 => 1.7 -->\n\nIt is 1.7.", "not in what is printed"),
        (
            "<!-- printed by: printf 'rms\\t\\t1.5' {1} -->\n\n| s | rms |\n| - | - |\n| x | 1.7 |",
            "rms 1.7, printed is 1.5",
        ),
        ("<!-- printed by: echo '| 1.5 |' -->\n\n| a |\n| - |\n| 1.5 |", "shows\n    | a |"),
        ("<!-- printed by: printf '| a |\\n| 1.5 |' -->\n\n| a |\n| - |\n| 1.7 |", "| 1.5 |"),
        ("<!-- printed by: echo 1.5 -->\n\nIt is 1.5.", "says no values"),
    ],
)
def test_a_page_that_is_not_so(wrong: Any, page: str, said: str) -> None:
    (found,) = wrong(page, long=True)
    assert said in found


@pytest.mark.parametrize(
    ("line", "args"),
    [
        ('.venv/bin/fivebar run a --set "x=[0, 1]"  # why', ["run", "a", "--set", "x=[0, 1]"]),
        ("fivebar run a > log", None),
        ("fivebar run a --set leg=$PWD/b.toml", None),
        ("X=1 fivebar run a", None),
        ("./fivebar run a", None),
        ("fivebar run 'a", None),
        ("# fivebar run a", None),
    ],
)
def test_what_needs_no_shell(script: dict[str, Any], line: str, args: list[str] | None) -> None:
    assert script["fivebar_args"](line) == args


def test_plain_commands_are_called_without_a_shell(script: dict[str, Any], tmp_path: Path) -> None:
    text = "```sh\n# two\nfivebar check no.toml\nfivebar check none.toml\n```"
    page = script["Page"](text, tmp_path, long=False)
    page.shell = None
    said = page.block(page.items[0].text).text
    assert "no.toml" in said
    assert "none.toml" not in said  # as in `bash -e`, nothing follows what fails


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("text\n\n<!-- printed: echo -->\n", "line 3: no such comment"),
        ("text\n\n<!-- long: it has\nno end", "line 3: no such comment"),
        ("text\n\n```sh\nfalse\n", "line 3: a block without an end"),
    ],
)
def test_a_page_that_is_not_understood(script: dict[str, Any], page: str, said: str) -> None:
    with pytest.raises(script["WrongError"], match=said):
        list(script["items"](page))


PLACE = (
    r"`((?:controllers|docs|examples|fivebar_sim|models|scenarios|scripts|tests|\.ci)/[\w.*/-]*)"
)


@pytest.mark.parametrize(
    "page", sorted((SCRIPTS.parent / "docs").rglob("*.md")), ids=lambda path: path.stem
)
def test_files_that_pages_name_exist(page: Path) -> None:
    places = re.findall(PLACE, page.read_text(encoding="utf-8"))
    assert [place for place in places if not any(SCRIPTS.parent.glob(place.rstrip("/")))] == []


def test_pages_are_reached_from_the_navigation() -> None:
    """A page that no nav entry names would be built, and never found."""
    root = SCRIPTS.parent
    named: set[str] = set()

    def walk(entry: Any) -> None:
        if isinstance(entry, str):
            named.add(entry)
        else:
            for each in entry.values() if isinstance(entry, dict) else entry:
                walk(each)

    walk(tomllib.loads((root / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"])
    assert named == {str(p.relative_to(root / "docs")) for p in (root / "docs").rglob("*.md")}


def test_keys_of_a_leg_are_those_of_its_page() -> None:
    text = (SCRIPTS.parent / "docs" / "reference" / "geometry.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in row.split("|")[1:4]] for row in re.findall(r"^\| `.*", text, re.M)
    ]
    fields = dataclasses.fields(FiveBar)
    assert rows == [
        [f"`{field.name}`", geometry.UNITS.get(field.name, ""), str(field.default)]
        for field in fields
    ]
