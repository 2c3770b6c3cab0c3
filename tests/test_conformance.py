"""`scripts/conformance.py` and the format of what it writes."""

from __future__ import annotations

import importlib.util
from collections import deque
from pathlib import Path
from typing import Any

import pytest

from fivebar_sim.certify import suite
from fivebar_sim.errors import ConfigError

ROOT = Path(__file__).resolve().parents[1]


def test_files_are_what_the_script_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every question of a leg is that of the file, and so is every fifth answer."""
    spec = importlib.util.spec_from_file_location("written", ROOT / "scripts" / "conformance.py")
    assert spec
    assert spec.loader
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    legs = script.legs()
    stored = suite.load()
    assert sorted(legs) == [leg.name for leg in stored]
    seed = sorted(legs).index("exact")
    questions: list[tuple[Any, ...]] = []
    write = script.line
    monkeypatch.setattr(script, "line", lambda *question: questions.append(question))
    list(script.cases("exact", legs["exact"], script.drawn(seed)))

    left = deque(stored[seed].cases)
    assert len(left) > 400
    for k, question in enumerate(questions):
        _, trap, kind, signs, values = question
        inputs = (*map(str, signs), *script.written(values))
        if not left or (left[0].trap, left[0].kind, left[0].inputs) != (trap, kind, inputs):
            assert write(*question) is None
            continue
        other = left.popleft()
        # Neither the four modes of a point nor the seven questions about a pose keep step with it.
        if k % 5 == 0:
            one = suite.case("exact", write(*question).split())
            # Its arctan2 gives the answer, whose last bits are the processor's.
            assert one == other._replace(answer=one.answer, within=one.within)
            assert one.within == pytest.approx(other.within, rel=0.1)
            assert one.answer == pytest.approx(other.answer, rel=0.0, abs=0.1 * other.within[1])
    assert not left
    text = (ROOT / suite.FOLDER / "exact.txt").read_text(encoding="utf-8")
    assert f"\nleg exact {' '.join(stored[seed].numbers)}\n{write(*questions[0])}\n" in text


@pytest.mark.parametrize("line", ["x inverse 1 1 0 0 = ok 1", "x what 1 = ok 1", "nonsense"])
def test_line_that_is_not_in_the_format_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "a.txt").write_text(f"# head\n{line}\n")
    with pytest.raises(ConfigError, match=r"a\.txt, line 2: not in the format"):
        suite.load(tmp_path)
