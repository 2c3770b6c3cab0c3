"""What a CI job shows of a check: JUnit XML for its list of tests, Markdown for its page."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree

from fivebar_sim.metrics.measured import NOT_JUDGED
from fivebar_sim.regression.comparison import BETTER, FAIL, Checked, Compared

UNJUDGED = f"{NOT_JUDGED} (guards hold)"
"""Verdict of a run without limits and baseline."""

NO_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 has no way to write."""

MARKDOWN = re.compile(r"[\\`*_\[\]<>|~&#@$]")
"""Characters that Markdown, on a CI job's page, may read as more than themselves."""


def junit(checked: Sequence[Checked]) -> str:
    """Return JUnit XML: one suite, a test case for each run and each metric that was judged."""
    # No element has a time: equal checks give equal files.
    suites = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(suites, "testsuite", name="fivebar check")
    for each in checked:
        broke = [each.broke] if each.broke else []
        # Readers of JUnit count what is skipped apart from what passed.
        skipped = "" if each.judged else UNJUDGED
        _case(suite, each.name, "run", broke, each.remarks, skipped)
        for row in each.rows:
            whys = [row.why] if row.why else []
            failed = row.verdict == FAIL
            _case(suite, each.name, row.key, *((whys, []) if failed else ([], whys)))

    counts = {
        "tests": len(suite),
        "failures": len(suite.findall("testcase/failure")),
        "errors": 0,
        "skipped": len(suite.findall("testcase/skipped")),
    }
    for element in (suites, suite):
        element.attrib.update({key: str(count) for key, count in counts.items()})

    ElementTree.indent(suites)
    text = ElementTree.tostring(suites, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _case(
    suite: ElementTree.Element,
    run: str,
    name: str,
    whys: Sequence[str],
    remarks: Sequence[str],
    skipped: str = "",
) -> None:
    """Append a test case, failed or skipped if there is a reason, with its remarks as output."""
    case = ElementTree.SubElement(suite, "testcase", classname=_xml(run), name=name)
    if skipped:
        ElementTree.SubElement(case, "skipped", message=skipped)
    for why in whys:
        ElementTree.SubElement(case, "failure", message=_xml(why), type="check").text = _xml(why)
    if remarks:
        ElementTree.SubElement(case, "system-out").text = _xml("\n".join(remarks))


def _xml(text: str) -> str:
    return NO_XML.sub("\ufffd", text)


def markdown(checked: Sequence[Checked]) -> str:
    """Return a summary in Markdown: failures and remarks, then every metric, folded away."""
    failed = sum(bool(each.failures) for each in checked)
    unjudged = sum(not each.judged for each in checked)
    verdict = f"{failed} of {len(checked)} failed" if failed else f"all {len(checked)} pass"
    if unjudged:
        verdict = f"{failed} of {len(checked)} failed, {unjudged} not judged"

    lines = [f"## fivebar check: {verdict}", ""]
    for each in checked:
        failures = [("FAIL", line) for line in each.failures]
        remarks = [("note", line) for line in each.remarks]
        lines += [
            f"- **{word}** {_md(each.name)}: {_md(line)}" for word, line in [*failures, *remarks]
        ]
    lines += ["", "<details><summary>every metric</summary>", "", *_table(checked), ""]
    return "\n".join([*lines, "</details>", "", ""])


def _table(checked: Sequence[Checked]) -> Iterator[str]:
    """Yield the lines of the table of all metrics."""
    yield "| scenario | metric | limit | baseline | now | change | verdict |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | --- |"
    for each in checked:
        # Without a row of its own, a run that broke would be missing from the table.
        if each.broke or not each.rows:
            verdict = f"**{FAIL}**" if each.broke else UNJUDGED
            yield f"| {_md(each.name)} | run | | | | | {verdict} |"
        for row in each.rows:
            yield f"| {' | '.join([_md(each.name), *_cells(row)])} |"


def _cells(row: Compared) -> list[str]:
    """Return the cells of one metric's row."""
    verdict = f"**{row.verdict}**" if row.verdict in (FAIL, BETTER) else row.verdict
    return [*map(html.escape, row.cells), verdict]


def _md(text: str) -> str:
    """Return a text in which no character means anything to Markdown or HTML."""
    return MARKDOWN.sub(lambda found: f"&#{ord(found[0])};", " ".join(text.split()))
