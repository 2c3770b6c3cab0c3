"""Write reports: read the run directories, draw, and write the page and its pictures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from fivebar_sim.errors import ArgumentError, RunDirectoryError
from fivebar_sim.files import whole_file
from fivebar_sim.report import comparison, look, robot, single
from fivebar_sim.runs import recorded, stored
from fivebar_sim.runs.kept import REPORT


def place_of(runs: Sequence[Path]) -> Path:
    """Return the default place: RUN_DIR/report.html, or comparison.html here for several runs."""
    return runs[0] / REPORT if len(runs) == 1 else Path("comparison.html")


def write(runs: Sequence[Path], out: Path | None = None, png: Path | None = None) -> list[Path]:
    """Write the report of one run, or the comparison of several; return the files, the page last.

    The same runs give the same bytes. Every file is written atomically and replaces an older one.

    Args:
        runs: Run directories, at least one.
        out: The page, .html; None: `place_of`.
        png: Folder for the figures as separate pictures; None: no pictures.

    Raises:
        RunDirectoryError: A run directory is missing, incomplete or damaged, or a file cannot be
            written.
        ArgumentError: No run, the same run twice, or more runs than `comparison.MOST`.
    """
    _check_runs(runs)
    place = place_of(runs) if out is None else out
    if place.suffix.lower() != ".html":
        raise RunDirectoryError(f"cannot write {place}: a report must end in .html")
    if place.is_dir():
        raise RunDirectoryError(f"cannot write {place}: a directory is there")

    read = [stored.read(path) for path in runs]
    # All content is ready before the first file is written; the page comes last.
    files: dict[Path, bytes] = {}
    with look.project_style():
        robots = recorded.all_of_robots(read)
        kind = robot if robots else single
        overlaid = robot.compared if robots else comparison.figures
        drawn = kind.figures(read[0]) if len(read) == 1 else overlaid(read)
        page = kind.page(read[0], drawn) if len(read) == 1 else comparison.page(read, drawn)
        if png is not None:
            files |= {png / f"{one.key}.png": look.png(one.figure) for one in drawn}
        files[place] = page.encode("utf-8", "backslashreplace")

    for path, content in files.items():
        whole_file.write(path, content)
    return list(files)


def _check_runs(runs: Sequence[Path]) -> None:
    """Raise unless there is a run, none is given twice, and there are not too many."""
    if not 1 <= len(runs) <= comparison.MOST:
        raise ArgumentError(f"a report needs 1 to {comparison.MOST} runs, got {len(runs)}")
    seen: set[str] = set()
    for run in runs:
        # Two paths may lead to one directory, through links or "..".
        place = os.path.realpath(run)
        if place in seen:
            raise ArgumentError(f"the run {run} is given twice")
        seen.add(place)
