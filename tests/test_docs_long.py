"""What the documentation shows of commands that take minutes is what they print."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LONG = re.compile(r"^<!-- (printed by, )?long: ", re.M)
PAGES = [
    str(page.relative_to(ROOT))
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if LONG.search(page.read_text(encoding="utf-8"))
]


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES)
def test_pages_show_what_takes_minutes(page: str) -> None:
    done = subprocess.run(
        [sys.executable, "scripts/check_docs.py", "--long", page],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
