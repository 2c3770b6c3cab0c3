"""`fivebar report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe, Paths, spinner


def report(
    run_dirs: Positional[Annotated[Paths, arg(metavar="RUN_DIR [RUN_DIR ...]")]],
    /,
    *,
    out: Annotated[Maybe[Path], arg(metavar="HTML")] = None,
    png: Annotated[Maybe[Path], arg(metavar="DIR")] = None,
    quiet: bool = False,
) -> int:
    """Explain a run, or compare several, on one self-contained HTML page.

    Args:
        run_dirs: Run directories that `fivebar run` wrote; several are compared with the first.
        out: The page (default: RUN_DIR/report.html, which the next run there writes anew; for
            several runs comparison.html).
        png: Folder for the figures as separate pictures.
        quiet: Print nothing but errors.
    """
    from fivebar_sim import report as reports

    with spinner("drawing", quiet=quiet):
        *pictures, page = reports.write(run_dirs, out, png)
    if not quiet:
        more = f", {len(pictures)} figures in {png}" if pictures else ""
        print(f"report of {len(run_dirs)} run{'s' * (len(run_dirs) > 1)} in {page}{more}")  # noqa: T201
    return 0
