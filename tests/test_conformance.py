"""`scripts/conformance.py` and the format of what it writes."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from fivebar_sim.certify import suite
from fivebar_sim.errors import ConfigError

ROOT = Path(__file__).resolve().parents[1]


def test_files_are_what_the_script_writes() -> None:
    spec = importlib.util.spec_from_file_location("written", ROOT / "scripts" / "conformance.py")
    assert spec
    assert spec.loader
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    legs = script.legs()
    loaded = suite.load()
    assert sorted(legs) == [leg.name for leg in loaded]
    seed = sorted(legs).index("exact")
    lines = [each for each in script.cases("exact", legs["exact"], script.drawn(seed)) if each]
    stored = loaded[seed].cases
    written = [suite.case("exact", line.split()) for line in lines]
    assert len(written) == len(stored) > 400
    for one, other in zip(written, stored, strict=True):
        # Its arctan2 gives the answer, whose last bits are the processor's.
        assert one == other._replace(answer=one.answer, within=one.within)
        assert one.within == pytest.approx(other.within, rel=0.1)
        assert one.answer == pytest.approx(other.answer, rel=0.0, abs=0.1 * other.within[1])
    text = (ROOT / suite.FOLDER / "exact.txt").read_text(encoding="utf-8")
    assert f"\nleg exact {' '.join(loaded[seed].numbers)}\n{lines[0]}\n" in text


@pytest.mark.parametrize("line", ["x inverse 1 1 0 0 = ok 1", "x what 1 = ok 1", "nonsense"])
def test_line_that_is_not_in_the_format_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "a.txt").write_text(f"# head\n{line}\n")
    with pytest.raises(ConfigError, match=r"a\.txt, line 2: not in the format"):
        suite.load(tmp_path)
