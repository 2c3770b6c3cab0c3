"""From run directories to files: where a report lies, what it refuses, and how it gets there."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from fivebar_sim.errors import ArgumentError, RunDirectoryError
from fivebar_sim.files import whole_file
from fivebar_sim.report import comparison, look, single
from fivebar_sim.runs import stored


def place_of(runs: Sequence[Path]) -> Path:
    """Return where a report lies by default: in its run directory, or here that of several."""
    return runs[0] / "report.html" if len(runs) == 1 else Path("comparison.html")


def write(runs: Sequence[Path], out: Path | None = None, png: Path | None = None) -> list[Path]:
    """Write the report of one run, or the comparison of several; return the files, the page last.

    The same runs give the same bytes. Every file is written beside its place, then renamed; an
    older one of its name is replaced.

    Args:
        runs: Run directories, at least one.
        out: The page, .html; None is `place_of`.
        png: A folder for the figures as single pictures; None is nowhere.

    Raises:
        RunDirectoryError: No complete run directory, a damaged one, or a place that cannot be
            written.
        ArgumentError: No run, one of them twice, or more than can be told apart.
    """
    _check_runs(runs)
    place = place_of(runs) if out is None else out
    if place.suffix.lower() != ".html":
        raise RunDirectoryError(f"cannot write {place}: a report must end in .html")
    if place.is_dir():
        raise RunDirectoryError(f"cannot write {place}: a directory is there")

    read = [stored.read(path) for path in runs]
    files: dict[Path, bytes] = {}
    with look.styled():
        drawn = single.figures(read[0]) if len(read) == 1 else comparison.figures(read)
        page = single.page(read[0], drawn) if len(read) == 1 else comparison.page(read, drawn)
        if png is not None:
            files |= {png / f"{one.key}.png": look.png(one.figure) for one in drawn}
        files[place] = page.encode("utf-8", "backslashreplace")

    for path, content in files.items():
        whole_file.write(path, content)
    return list(files)


def _check_runs(runs: Sequence[Path]) -> None:
    """Raise unless there is a run, none twice, and not too many."""
    if not 1 <= len(runs) <= comparison.MOST:
        raise ArgumentError(f"a report is of 1 to {comparison.MOST} runs, got {len(runs)}")
    seen: set[str] = set()
    for run in runs:
        place = os.path.realpath(run)
        if place in seen:
            raise ArgumentError(f"the run {run} is given twice")
        seen.add(place)
