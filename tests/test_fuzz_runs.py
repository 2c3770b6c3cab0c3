"""Run directories damaged in any way, and command lines of any words: the law of fuzz.py."""

from __future__ import annotations

import functools
import os
import shutil
import tempfile
import zlib
from pathlib import Path

import fuzz_damage
import numpy as np
import pyarrow.parquet
import pytest
from fuzz import Bench, Law, both_forms
from fuzz_damage import Damage
from fuzz_inputs import jsons, mutated
from hypothesis import strategies as st
from sealed import seal
from shell import ELLIPSE

from fivebar_sim import rollout
from fivebar_sim.recording import check
from fivebar_sim.recording.check import read_through
from fivebar_sim.report import over_time, single
from fivebar_sim.report.draw import Drawn
from fivebar_sim.runs.recording_file import RECORDING
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.scenario import Scenario


@functools.cache
def contents() -> dict[str, bytes]:
    """Return the files of a sound run."""
    settings = ["duration=0.8", "limits.tracking.rms=1e-3"]
    with tempfile.TemporaryDirectory() as folder:
        place = rollout.run(Scenario.load("rail-landing", settings)).write(Path(folder) / "mine")
        return {name: (place / name).read_bytes() for name in fuzz_damage.FILES}


@pytest.fixture
def bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Bench:
    (tmp_path / "short.toml").write_text(ELLIPSE, encoding="utf-8")
    _restore(tmp_path / "mine")
    return Bench(tmp_path, monkeypatch, capfd)


def _restore(place: Path) -> None:
    """Make a run directory whole."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for name, content in contents().items():
        (place / name).write_bytes(content)


def _damaged(place: Path, damage: Damage) -> None:
    """Do to a run directory what a damage says."""
    file = place / damage.file
    other = place / damage.other
    if damage.how == "swapped":
        file.write_bytes(contents()[damage.other])
        other.write_bytes(contents()[damage.file])
    else:
        _replaced(file, damage)
    if damage.sealed:
        seal(place)


def _replaced(file: Path, damage: Damage) -> None:
    """Put something else in a file's place."""
    file.unlink()
    make = {
        "missing": lambda: None,
        "empty": file.touch,
        "foreign": lambda: file.write_bytes(b"PAR1 and nothing of it"),
        "directory": file.mkdir,
        "link": lambda: file.symlink_to(damage.other),
        "loop": lambda: file.symlink_to(file.name),
        "dangling": lambda: file.symlink_to("nowhere"),
        "device": lambda: file.symlink_to("/dev/zero"),
        "pipe": lambda: os.mkfifo(file),
    }
    make.get(damage.how, lambda: file.write_bytes(damage.content))()


def any_replay(bench: Bench, damage: Damage) -> None:
    place = bench.folder / "mine"
    _restore(place)
    _damaged(place, damage)
    with pytest.MonkeyPatch.context() as patch:
        if RECORDING not in (damage.file, damage.other):  # a process for each would take too long
            patch.setattr(check, "reads", _reads_here)
        said = bench.lawful("replay", "mine")
    assert said.status == 2  # no screen, at the best
    if "no screen here" in said.err:
        bench.seen["read"] += 1
        read_through(place / RECORDING)
        if not damage.sealed:
            _check_record(place)


def _reads_here(path: Path, run: str) -> bool:
    return read_through(path) == run


def _check_record(place: Path) -> None:
    """Fail if a record that was taken for sound is another one than was written."""
    read = pyarrow.parquet.read_table(place / "rollout.parquet")
    sound = pyarrow.parquet.read_table(pyarrow.BufferReader(contents()["rollout.parquet"]))
    for name in sound.column_names:
        np.testing.assert_array_equal(read[name].to_numpy(), sound[name].to_numpy(), name)


def in_brief(run: StoredRun) -> list[Drawn]:
    """Return one figure of a run."""
    return [over_time.tracking_error(run)]


def any_report(bench: Bench, damage: Damage) -> None:
    place = bench.folder / "mine"
    page = bench.folder / "page.html"
    _restore(place)
    _damaged(place, damage)
    with pytest.MonkeyPatch.context() as patch:
        # Drawing takes a hundred times as long as a refusal: one figure, and of SOUND alone. All
        # twelve of a sound run are drawn by tests/test_report.py.
        patch.setattr(single, "figures", in_brief if damage == SOUND else lambda run: [])
        said = bench.lawful("report", "mine", "--out", "page.html", "--quiet")
    assert (said.status == 0) == page.exists()
    if page.exists():
        bench.seen["reported"] += 1
        assert page.read_bytes().endswith(b"</html>\n")
        if not damage.sealed:
            _check_record(place)
        page.unlink()


def _read_by_all(bench: Bench, name: str, content: bytes) -> None:
    """Let every reader have a run directory with other content of one of its files."""
    place = bench.folder / "mine"
    _restore(place)
    _restore(bench.folder / "other")
    (place / name).write_bytes(content)
    seal(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(check, "reads", _reads_here)
        said = bench.lawful("replay", "mine")
    assert said.status == 2
    sound = "no screen here" in said.err
    bench.seen["read"] += sound
    if sound and zlib.crc32(content) % DRAWN:
        return  # drawing takes a hundred times as long as a refusal
    for command in (["report", "mine"], ["report", "other", "mine"]):
        said = bench.lawful(*command, "--out", "page.html", "--quiet")
        assert (said.status == 0) == sound
        assert (bench.folder / "page.html").exists() == sound
        (bench.folder / "page.html").unlink(missing_ok=True)


def any_metrics(bench: Bench, content: bytes) -> None:
    _read_by_all(bench, "metrics.json", content)


def any_record(bench: Bench, content: bytes) -> None:
    _read_by_all(bench, "rollout.parquet", content)


def any_recording(bench: Bench, content: bytes) -> None:
    place = bench.folder / "mine"
    if not (place / "metrics.json").exists():
        _restore(place)
    (place / RECORDING).write_bytes(content)
    said = bench.lawful("replay", "mine")
    assert "no screen here" in said.err  # whatever it was, it is one that can be read now
    read_through(place / RECORDING)
    kept = (place / RECORDING).read_bytes() == content
    bench.seen["kept" if kept else "rebuilt"] += 1


def any_rerun(bench: Bench, damage: Damage) -> None:
    _restore(bench.folder / "mine")
    _damaged(bench.folder / "mine", damage)
    bench.run("mine/scenario.toml")


def any_words(bench: Bench, words: list[str]) -> None:
    if "--web" in words or "render" in words:
        return  # one serves until it is stopped, the other draws pictures
    bench.lawful(*words)
    for path in bench.folder.iterdir():
        if path.name not in ("short.toml", "mine", "other"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


class Long(bytes):
    """Bytes that are not printed: Hypothesis warns of a megabyte of them."""

    def __repr__(self) -> str:
        return f"<{len(self)} bytes>"


DRAWN = 256
"""Of the run directories that are sound, one in so many is drawn."""
SOUND = Damage("recording.rrd", "missing", b"", "metrics.json")
SOME = st.deferred(lambda: fuzz_damage.damages(contents()))
METRICS = st.deferred(lambda: jsons(contents()["metrics.json"]))
RECORDS = st.deferred(lambda: fuzz_damage.records(contents()["rollout.parquet"]))
RECORDINGS = st.deferred(lambda: mutated(contents()[RECORDING]).map(Long))
LAWS = {
    "replay": Law(SOUND, SOME, any_replay, 5, 0.04),
    "report": Law(SOUND, SOME, any_report, 6, 0.01),
    "rerun": Law(SOUND, SOME, any_rerun, 4, 0.01),
    "words": Law(["run", "short.toml"], fuzz_damage.arguments, any_words, 25, 0.02),
    "metrics": Law(b"{}", METRICS, any_metrics, 16, 0.03),
    "records": Law(b"PAR1", RECORDS, any_record, 12, 0.03),
    "recordings": Law(b"RRF2", RECORDINGS, any_recording, 1, 0.005),
}


test_few_inputs_keep_the_law, test_many_inputs_keep_the_law = both_forms(LAWS)
