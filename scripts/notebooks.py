"""./.venv/bin/python scripts/notebooks.py [--write]: runs the notebooks and compares their output.

Each notebook in notebooks/ runs from its first cell to its last. What a cell prints must be what
the notebook shows of it: numbers of three digits and more may be off by one in the last digit.
Pictures and tables must be there, but are not compared. --write keeps what came instead.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from shown import WrongError, compare_lines

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"


def main() -> int:
    """Run all notebooks; return 1 if one fails or shows something else."""
    parser = argparse.ArgumentParser(description="Run the notebooks.")
    parser.add_argument("--write", action="store_true", help="keep what came")
    options = parser.parse_args()
    wrong = []
    for path in sorted(FOLDER.glob("*.ipynb")):
        shown = nbformat.read(path, as_version=4)
        try:
            came = run(path)
        except CellExecutionError as error:
            wrong.append(f"{path.name}: {error}")
            continue
        if options.write:
            nbformat.write(came, path)
        wrong += [f"{path.name}: {each}" for each in differences(shown, came)]
        print(f"{path.name}: {len(came.cells)} cells", flush=True)

    print(*wrong, sep="\n", end="\n" if wrong else "")
    return int(bool(wrong) and not options.write)


def run(path: Path) -> Any:
    """Return a notebook with what its cells give, run anew; equal runs give equal files."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=300, record_timing=False, coalesce_streams=True)
    # No port is opened.
    client.create_kernel_manager().transport = "ipc"
    client.execute()
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.execution_count = None
            for output in cell.outputs:
                if output.output_type == "execute_result":
                    output.execution_count = None
    return notebook


def differences(shown: Any, came: Any) -> list[str]:
    """Return what cells give that a notebook does not show, or shows otherwise."""
    found = []
    for number, (old, new) in enumerate(zip(shown.cells, came.cells, strict=True), 1):
        if kinds(old) != kinds(new):
            found.append(f"cell {number}: gives {kinds(new)}, the notebook shows {kinds(old)}")
        elif printed(old):
            try:
                compare_lines(printed(old), printed(new))
            except WrongError as error:
                found.append(f"cell {number}: {error}")
    return found


def printed(cell: Any) -> str:
    """Return the text that a cell prints."""
    return "".join(o.text for o in cell.get("outputs", []) if o.output_type == "stream")


def kinds(cell: Any) -> list[str]:
    """Return the kinds of a cell's outputs, "stream" or those of what it shows."""
    outputs = cell.get("outputs", [])
    return [",".join(sorted(o.data)) if "data" in o else o.name for o in outputs]


if __name__ == "__main__":
    sys.exit(main())
