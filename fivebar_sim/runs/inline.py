"""The recording of a run within a notebook, where Rerun's viewer for notebooks is installed."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from fivebar_sim.recording import rrd
from fivebar_sim.runs import recorded
from fivebar_sim.scenario.run import Run

HEIGHT = 520
"""Height of the viewer [px]; it is as wide as the cell."""


def fits() -> bool:
    """Return whether this is a notebook that can show recordings: rerun-notebook is installed."""
    # Who has not imported IPython is not in a notebook.
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return hasattr(shell, "kernel") and find_spec("rerun_notebook") is not None


def show(run: Run) -> None:
    """Show the recording of a run below the cell.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    with rrd.session():
        from rerun import notebook

        stream = rrd.started(run.scenario.name)
        viewer = notebook.Viewer(width="auto", height=HEIGHT, recording=stream)
        recorded.send(stream, [run])
        stream.flush()
        viewer.display()
