"""Which older processors this one can stand in for, one a line: its name, then the settings.

NumPy's newer instructions are switched off, OpenBLAS is given another kernel, and the C library's
sine and the like, which MuJoCo calls too, do without fused multiplication; .ci/processor and
scripts/determinism.py run things so. With --verify it says what is in force under the settings it
was started with; exit status 1 where one of them took no effect. What cannot be had here is said on
stderr.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import math
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

umath: Any = importlib.import_module("numpy._core._multiarray_umath")

OFF = "NPY_DISABLE_CPU_FEATURES"
KERNEL = "OPENBLAS_CORETYPE"
LIBC = "GLIBC_TUNABLES"
NO_FMA = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable"  # the last two: before 2.33

OLDEST = {"x86_64": ("Nehalem", "Prescott"), "aarch64": ("ARMV8",), "arm64": ("ARMV8",)}
"""OpenBLAS's kernels for the oldest processors; the first that is not in use here is taken."""

ALIASES = {"prescott": "katmai"}
"""What OpenBLAS calls a kernel where that is not the name it was asked for by."""


def dispatched() -> list[str]:
    """Return the features that NumPy uses here, and would do without on an older processor."""
    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]]


def kernel() -> str:
    """Return which kernel NumPy's OpenBLAS uses; "" where it has none that tells."""
    loaded = ctypes.CDLL(umath.__file__)
    for name in ("scipy_openblas_get_corename64_", "openblas_get_corename"):
        if hasattr(loaded, name):
            ask = getattr(loaded, name)
            ask.restype = ctypes.c_char_p
            return ask().decode().lower()
    return ""


def older_kernel() -> str:
    """Return a kernel of OpenBLAS for an older processor; "" where there is no other."""
    known = OLDEST.get(platform.machine(), ())
    others = [name for name in known if ALIASES.get(name.lower(), name.lower()) != kernel()]
    return others[0] if kernel() and others else ""


def libm() -> str:
    """Return a digest of what the C library makes of many angles; its last bits are in it."""
    values = (function(0.001 * i) for i in range(20_000) for function in (math.sin, math.cos))
    return hashlib.sha256(" ".join(map(float.hex, values)).encode()).hexdigest()[:8]


def libm_under(tunables: str) -> str:
    """Return the digest of a process with other settings of the C library."""
    command = [sys.executable, __file__, "--libm"]
    env = {**os.environ, LIBC: tunables}
    return subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout


def tiers() -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the older processors, each with the environment variables that make it one."""
    features = dispatched()
    new = [name for name in features if name == "X86_V4" or name.startswith("AVX512")]
    if new:
        yield "no AVX-512", {OFF: " ".join(new)}
    else:
        print("skipped: no AVX-512: NumPy uses none here", file=sys.stderr)

    settings = {}
    if features:
        settings[OFF] = " ".join(features)
    else:
        print("skipped: NumPy uses nothing newer than its baseline here", file=sys.stderr)

    if older_kernel():
        settings[KERNEL] = older_kernel()
    else:
        print("skipped: OpenBLAS has no other kernel here", file=sys.stderr)

    if libm_under(NO_FMA) != libm_under(""):
        settings[LIBC] = NO_FMA
    else:
        print("skipped: the C library computes no angle otherwise here", file=sys.stderr)

    if settings:
        yield "oldest", settings


def verify() -> int:
    """Print what is in force; return 1 if a setting took no effect."""
    on = " ".join(dispatched()) or "none"
    baseline = " ".join(umath.__cpu_baseline__)
    print(
        f"NumPy: {on}, besides its baseline {baseline}; OpenBLAS: {kernel() or 'not told'}", end=""
    )
    print(f"; C library's sines: {libm()}")
    stayed = set(os.environ.get(OFF, "").split()) & set(dispatched())
    asked = os.environ.get(KERNEL, "").lower()
    wrong = [f"{name} stayed on" for name in sorted(stayed)]

    if asked and kernel() != ALIASES.get(asked, asked):
        wrong.append(f"OpenBLAS uses {kernel()}, not {asked}")

    if os.environ.get(LIBC) and libm() == libm_under(""):
        wrong.append(f"the C library computes the same without {LIBC}")

    for each in wrong:
        print(f"processor: {each}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    if "--verify" in sys.argv[1:]:
        sys.exit(verify())
    if "--libm" in sys.argv[1:]:
        sys.exit(print(libm(), end=""))
    for title, settings in tiers():
        print("\t".join([title, *(f"{name}={value}" for name, value in settings.items())]))
