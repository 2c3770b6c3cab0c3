"""./.venv/bin/python scripts/build_wasm.py: compiles the page's leg.wasm from the firmware.

Needs clang and lld (Debian: clang, lld). Equal versions of them give equal bytes, wherever the
checkout lies; fivebar_sim/page/leg.wasm.txt says which version made those that ship.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "fivebar_sim" / "page"

FLAGS = (
    "--target=wasm32",
    "-std=c99",
    "-O2",
    "-ffreestanding",
    "-nostdlib",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wl,--no-entry",
    "-Wl,--strip-all",
    "-Wl,-z,stack-size=8192",
)
"""A stack of 8 kB: the deepest call takes some hundred bytes."""


def compiler() -> str:
    """Return the first line of what clang says of its version."""
    said = subprocess.run(["clang", "--version"], capture_output=True, text=True, check=True)
    return said.stdout.splitlines()[0]


def build(place: Path) -> None:
    """Compile to a file."""
    # Relative names: a path of this machine must not get into the bytes.
    command = ["clang", *FLAGS, "-Ifirmware", "-o", str(place), "fivebar_sim/page/leg.c"]
    subprocess.run(command, check=True, cwd=ROOT)


if __name__ == "__main__":
    build(PAGE / "leg.wasm")
    (PAGE / "leg.wasm.txt").write_text(compiler() + "\n", encoding="utf-8")
    print(f"wrote leg.wasm: {(PAGE / 'leg.wasm').stat().st_size} B, by {compiler()}")
