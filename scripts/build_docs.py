"""./.venv/bin/python scripts/build_docs.py: builds the documentation site into build/site.

A warning fails: what Zensical finds with --strict, and what Griffe says of docstrings, which
--strict does not count.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from fivebar_sim import page

ROOT = Path(__file__).resolve().parent.parent
FINE = "No issues found"


def main() -> int:
    """Build the site; return 1 unless nothing is wrong with it."""
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, check=False)
    sys.stderr.write(done.stderr)
    if done.returncode != 0 or done.stderr.strip() != FINE:
        return 1
    # What docs/play.md shows in a frame.
    page.write("classic", ROOT / "build" / "site" / "leg.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
