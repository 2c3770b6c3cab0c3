"""The firmware's C code, compiled for many processors, and run under QEMU and Node."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from fivebar_sim.files import resources

HERE = Path(__file__).parent / "firmware"
M4F = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")


class Target(NamedTuple):
    """A processor.

    Attributes:
        needs: Programs without which it cannot be tested.
        build: Compiles the driver with some flags into a folder; returns the command that runs it.
    """

    needs: tuple[str, ...]
    build: Callable[[Path, Sequence[str]], list[str]]


def source() -> Path:
    """Return the firmware's source."""
    return resources.file("firmware", "fivebar_leg.c")


def run(*command: str | Path) -> str:
    """Return what a program prints; its errors fail the test."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}: {done.stderr or done.stdout}"
    return done.stdout


def need(*programs: str) -> None:
    """Skip the test unless some programs are installed."""
    missing = [program for program in programs if shutil.which(program) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)}, which .ci/packages installs")


def compile_leg(compiler: str, to: Path, flags: Sequence[str]) -> Path:
    """Return the object of the firmware's source, as its users compile it.

    In GNU C, whose GCC fuses multiplications and additions unless the source keeps it from that.
    """
    out = to / "leg.o"
    run(compiler, "-std=gnu11", "-O2", *flags, "-c", source(), "-o", out)
    return out


def compile_bits(compiler: str, to: Path, flags: Sequence[str]) -> Path:
    """Return the object of the driver, which must draw the same legs everywhere."""
    out = to / "bits.o"
    include = f"-I{source().parent}"
    exact = "-ffp-contract=off"
    # Not optimised: it takes longer to compile than to run. A -O among the flags is the leg's.
    given = [flag for flag in flags if not flag.startswith("-O")]
    run(compiler, "-std=gnu11", "-O0", exact, include, *given, "-c", HERE / "bits.c", "-o", out)
    return out


def _hosted(compiler: str, link: Sequence[str], runner: Sequence[str]) -> Target:
    """Return a target with a C library."""

    def build(to: Path, flags: Sequence[str]) -> list[str]:
        parts = [compile_leg(compiler, to, flags), compile_bits(compiler, to, flags)]
        program = to / "bits"
        run(compiler, *link, HERE / "main.c", *parts, "-o", program)
        return [*runner, str(program)]

    return Target((compiler, *runner), build)


def _cortex(*processor: str) -> Target:
    """Return a microcontroller; Linux's C library for ARM stands in for a board."""

    def build(to: Path, flags: Sequence[str]) -> list[str]:
        flags = [*flags, *processor]
        parts = [
            compile_leg("arm-none-eabi-gcc", to, flags),
            compile_bits("arm-none-eabi-gcc", to, flags),
        ]
        # Float arithmetic that the processor lacks comes from its own compiler's library.
        library = run("arm-none-eabi-gcc", *processor, "-print-libgcc-file-name").strip()
        joined = to / "joined.o"
        run("arm-none-eabi-ld", "-r", *parts, library, "-o", joined)
        # The linker refuses to join the M and A profiles; whole numbers are passed alike.
        run("arm-none-eabi-objcopy", "--remove-section", ".ARM.attributes", joined)
        program = to / "bits"
        link = ("-static", "-Wl,-z,noexecstack")
        run("arm-linux-gnueabihf-gcc", *link, HERE / "main.c", joined, "-o", program)
        return ["qemu-arm", str(program)]

    return Target(("arm-none-eabi-gcc", "arm-linux-gnueabihf-gcc", "qemu-arm"), build)


def _wasm(to: Path, flags: Sequence[str]) -> list[str]:
    """Build for WebAssembly."""
    flags = [*flags, "--target=wasm32", "-fno-builtin-memset"]
    parts = [compile_leg("clang", to, flags), compile_bits("clang", to, flags)]
    module = to / "bits.wasm"
    run("wasm-ld", "--no-entry", "--export=digest", *parts, "-o", module)
    return ["node", str(HERE / "bits.mjs"), str(module)]


TARGETS = {
    "host": _hosted("cc", (), ()),
    "clang": _hosted("clang", (), ()),
    "cortex-m4f": _cortex(*M4F),
    "cortex-m0": _cortex("-mcpu=cortex-m0", "-mthumb", "-mfloat-abi=soft"),
    "aarch64": _hosted("aarch64-linux-gnu-gcc", ("-static",), ("qemu-aarch64",)),
    "riscv64": _hosted("riscv64-linux-gnu-gcc", ("-static",), ("qemu-riscv64",)),
    "wasm": Target(("clang", "wasm-ld", "node"), _wasm),
}
"""Every processor on which the bits are compared."""
