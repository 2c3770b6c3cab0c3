"""Print what the firmware costs: time per inverse against libm on this machine, and bytes of flash.

Run: .venv/bin/python scripts/bench_firmware.py

The same formulas are timed with libm's sqrtf and atan2f, in the same program and in turn; the least
of 15 tries counts. Bytes are of a Cortex-M4F at -Os, what is not called left out by the linker.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fivebar_sim.files import resources

BENCH = Path(__file__).with_name("bench_firmware.c")
M4F = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
SMALL = ("-Os", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostdlib")

FUNCTIONS = {
    "inverse": ("inverse",),
    "inverse and forward": ("inverse", "forward"),
    "jacobian and torque": ("jacobian", "torque"),
    "nearest": ("nearest",),
    "hip inverse and forward": ("hip_inverse", "hip_forward"),
    "servo command": ("servo_command",),
}


def times(level: str, folder: Path) -> tuple[float, float]:
    """Return the nanoseconds of one inverse: ours, and by libm."""
    program = folder / "bench"
    include = f"-I{resources.file('firmware', 'fivebar_leg.c').parent}"
    command = ["cc", "-std=gnu11", level, include, str(BENCH), "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    printed = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    ours, libm, _ = printed.split()
    return float(ours), float(libm)


def size(functions: tuple[str, ...], folder: Path) -> int:
    """Return the bytes of some functions with all that they call."""
    linked = folder / "leg.elf"
    roots = [f"-Wl,-u,fivebar_{name}" for name in functions]
    entry = f"-Wl,-e,fivebar_{functions[0]}"
    source = str(resources.file("firmware", "fivebar_leg.c"))
    command = ["arm-none-eabi-gcc", *M4F, *SMALL, entry, *roots, source, "-o", str(linked)]
    subprocess.run(command, check=True)
    sizes = ["arm-none-eabi-size", str(linked)]
    printed = subprocess.run(sizes, check=True, capture_output=True, text=True).stdout
    return int(printed.splitlines()[1].split()[0])


def main() -> int:
    """Print both tables; return 1 if libm is faster."""
    status = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for level in ("-O2", "-Os"):
            ours, libm = times(level, folder)
            print(f"inverse, cc {level}: {ours:.0f} ns, by libm {libm:.0f} ns: {ours / libm:.2f}")
            status = max(status, int(ours > libm))

        if shutil.which("arm-none-eabi-gcc") is None:
            print("bytes on a Cortex-M4F: needs gcc-arm-none-eabi")
            return status
        for title, functions in FUNCTIONS.items():
            print(f"{title}: {size(functions, folder)} bytes")
    return status


if __name__ == "__main__":
    sys.exit(main())
