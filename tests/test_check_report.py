"""JUnit XML and Markdown of a check: they parse back, whatever the names and messages are."""

from __future__ import annotations

import html
import re
from xml.etree import ElementTree

from hypothesis import example, given
from hypothesis import strategies as st

from fivebar_sim.metrics import Limit
from fivebar_sim.regression.baseline import Recorded
from fivebar_sim.regression.ci_files import NO_XML, junit, markdown
from fivebar_sim.regression.comparison import BETTER, FAIL, NEW, PASS, Checked, Compared

RECORDED = Recorded(1e-3, 1e-9, 0.005)
LIMIT = Limit("tracking.rms", 0.0, 1.3e-3, 1.1e-3, True)
ROWS = [
    Compared("tracking.rms", LIMIT, RECORDED, 1.1e-3, FAIL, "tracking RMS: worse"),
    Compared("tracking.max", None, RECORDED, 1e-3, PASS, ""),
    Compared("closure.max", None, RECORDED, 0.5e-3, BETTER, "loop gap max: less"),
    Compared("closure.rms", None, RECORDED, 0.5e-3, NEW, "loop gap RMS: moved"),
    Compared("load.share_A", Limit("load.share_A", 0.4, 0.6, None, False), None, None, FAIL, "why"),
]
CHECKED = [
    Checked("one", ROWS, "", ["mind"]),
    Checked("two", [], "it broke", []),
    Checked("three", [], "", []),
]
ODD = st.text(st.characters(exclude_categories=()), min_size=1)  # lone surrogates too


def cells(line: str) -> list[str]:
    """Return the cells of a line of a Markdown table."""
    assert line.startswith("| ")
    assert line.endswith(" |")
    return [html.unescape(cell.strip()) for cell in line[1:-1].split("|")]


def test_junit_has_a_case_for_each_run_and_metric() -> None:
    suites = ElementTree.fromstring(junit(CHECKED))
    assert (suites.tag, [each.tag for each in suites]) == ("testsuites", ["testsuite"])
    cases = {(case.get("classname"), case.get("name")): case for case in suites[0]}
    assert list(cases) == [
        ("one", "run"),
        *(("one", row.key) for row in ROWS),
        ("two", "run"),
        ("three", "run"),
    ]
    assert set(suites[0].attrib) == {"name", "tests", "failures", "errors", "skipped"}
    counts = [suites[0].get(name) for name in ("tests", "failures", "skipped")]
    assert counts == ["8", "3", "1"]
    skipped = {key: each.get("message") for key, c in cases.items() for each in c.iter("skipped")}
    assert skipped == {("three", "run"): "not judged (guards hold)"}
    failures = {key: f.get("message") for key, c in cases.items() for f in c.iter("failure")}
    assert failures == {
        ("one", "tracking.rms"): "tracking RMS: worse",
        ("one", "load.share_A"): "why",
        ("two", "run"): "it broke",
    }
    said = {key: out.text for key, case in cases.items() for out in case.iter("system-out")}
    assert said == {
        ("one", "run"): "better than its baseline: loop gap max (run); --update records it\nmind",
        ("one", "closure.max"): "loop gap max: less",
        ("one", "closure.rms"): "loop gap RMS: moved",
    }


@given(name=ODD, why=ODD, note=ODD)
@example(name='<a&"b">|', why="]]>\x00\ufffe\ud800", note="é\u2028\U0001f9bf")
def test_any_text_is_valid_xml(name: str, why: str, note: str) -> None:
    text = junit([Checked(name, [ROWS[0]._replace(why=why)], why, [note])])
    suite = ElementTree.fromstring(text.encode())[0]
    failure = suite[0].find("failure")
    assert failure is not None
    assert suite[0].get("classname") == NO_XML.sub("\ufffd", name)
    assert failure.get("message") == NO_XML.sub("\ufffd", why)


def test_markdown_tells_failures_first_and_every_metric() -> None:
    lines = markdown(CHECKED).splitlines()
    assert lines[0] == "## fivebar check: 2 of 3 failed, 1 not judged"
    assert lines[2:7] == [
        "- **FAIL** one: tracking RMS: worse",
        "- **FAIL** one: why",
        "- **note** one: better than its baseline: loop gap max (run); --update records it",
        "- **note** one: mind",
        "- **FAIL** two: it broke",
    ]
    table = [cells(line) for line in lines if line.startswith("| ")]
    assert table[0] == ["scenario", "metric", "limit", "baseline", "now", "change", "verdict"]
    assert table[2] == [
        *("one", "tracking RMS", "0 to 1.3 mm", "1 mm", "1.1 mm", "+10.0 %", "**FAIL**")
    ]
    assert table[3] == ["one", "tracking max", "", "1 mm", "1 mm", "0.0 %", "pass"]
    assert table[-3] == ["one", "load share A", "40 to 60 %", "", "undefined", "", "**FAIL**"]
    assert table[-2:] == [
        ["two", "run", "", "", "", "", "**FAIL**"],
        ["three", "run", "", "", "", "", "not judged (guards hold)"],
    ]
    assert markdown(CHECKED[:1]).startswith("## fivebar check: 1 of 1 failed\n")
    assert markdown(CHECKED[2:]).startswith("## fivebar check: 0 of 1 failed, 1 not judged\n")
    assert markdown([Checked("good", ROWS[1:2], "", [])]).startswith("## fivebar check: all 1 pass")


@given(name=ODD)
@example(name="a|b")
@example(name="<script>@all #1 $x$ `x` *x* _x_ [x](y) \\|")
def test_no_name_breaks_the_table(name: str) -> None:
    lines = markdown([Checked(name, ROWS, "", [])]).splitlines()
    table = [line for line in lines if line.startswith("| ")]
    assert len(table) == 2 + len(ROWS)
    assert {len(cells(line)) for line in table} == {7}
    first = table[2].split(" | ")[0]
    assert not re.search(r"[<>@#$`*_\[\]\\]", re.sub(r"&#\d+;", "", first))
