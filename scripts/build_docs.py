"""./.venv/bin/python scripts/build_docs.py [--serve]: builds the documentation into build/site.

A warning fails: what Zensical finds with --strict, and what Griffe says of docstrings, which
--strict does not count. The site opens from disk; --serve shows it on loopback until Ctrl-C.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import http.server
import subprocess
import sys
from pathlib import Path

from fivebar_sim import page

ROOT = Path(__file__).resolve().parent.parent
SITE = ROOT / "build" / "site"
FINE = "No issues found"


def main() -> int:
    """Build the site, show it if asked to; return 1 unless nothing is wrong with it."""
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("--serve", action="store_true", help="show it until Ctrl-C")
    options = parser.parse_args()

    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    done = subprocess.run(command, cwd=ROOT, stderr=subprocess.PIPE, text=True, check=False)
    sys.stderr.write(done.stderr)
    if done.returncode != 0 or done.stderr.strip() != FINE:
        return 1

    # What docs/play.md shows in a frame.
    page.write("classic", SITE / "leg.html")
    # A page that is opened from disk may not read a file, but run it.
    index = (SITE / "search.json").read_text(encoding="utf-8")
    (SITE / "search.js").write_text(f"var __index = {index};\n", encoding="utf-8")
    if options.serve:
        serve()
    return 0


def serve() -> None:
    """Show the site at a free port of this machine until Ctrl-C."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(SITE))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        print(f"http://127.0.0.1:{server.server_port}/ until Ctrl-C", flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()


if __name__ == "__main__":
    sys.exit(main())
