"""The firmware's source: small, without libm, without warnings, and not for -ffast-math."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from firmware_bits import digests
from firmware_builds import HERE, M4F, need, run, source

from fivebar_sim.certify import dialogue, judge, suite

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror")

MOST_BYTES = 2048
"""Size of inverse and forward together for a Cortex-M4F at -Os."""

SAFE = ("-fsanitize=undefined,address,float-cast-overflow", "-fno-sanitize-recover=all")


# GCC follows what variables hold only while it optimises, in both languages alike; all else that
# it or Clang warns of is seen in the syntax, in a tenth of the time.
@pytest.mark.parametrize(
    "compiler",
    [
        ("cc", "-std=c99", "-O1"),
        ("c++", "-std=c++11", "-xc++", "-fsyntax-only"),
        ("clang", "-std=c99", "-fsyntax-only"),
        ("clang++", "-std=c++11", "-xc++", "-fsyntax-only"),
    ],
    ids=lambda words: words[0],
)
@pytest.mark.parametrize("double", [(), ("-DFIVEBAR_DOUBLE", "-DFIVEBAR_SQRT_BY_DIGITS")])
def test_it_compiles_without_warnings(
    compiler: tuple[str, ...], double: tuple[str, ...], tmp_path: Path
) -> None:
    need(compiler[0])
    run(*compiler, *WARNINGS, *double, "-c", source(), "-o", tmp_path / "leg.o")


@pytest.mark.parametrize(
    "double", [(), pytest.param(("-DFIVEBAR_DOUBLE",), marks=pytest.mark.long)]
)
def test_cppcheck_finds_nothing(double: tuple[str, ...]) -> None:
    need("cppcheck")
    what = "--enable=warning,style,performance,portability"
    # One configuration at a time: cppcheck would mix the lengths of float and double.
    one = ("-DFIVEBAR_SQRT_BY_DIGITS", *double)
    run("cppcheck", "--quiet", "--error-exitcode=1", "--std=c99", what, *one, source())


BY_DIGITS = ("-DFIVEBAR_SQRT_BY_DIGITS",)
"""The other way that the source has of a square root."""


@pytest.mark.parametrize("switch", [(), pytest.param(BY_DIGITS, marks=pytest.mark.long)])
def test_sanitizers_find_nothing(switch: tuple[str, ...], tmp_path: Path) -> None:
    need("cc")
    program = tmp_path / "bits"
    include = f"-I{source().parent}"
    parts = (HERE / "bits.c", HERE / "main.c", source())
    run("cc", "-O0", "-ffp-contract=off", *SAFE, *switch, include, *parts, "-o", program)
    # Nothing else compares the bits of a leg that is not optimised at all.
    assert run(program, "0", "3000", "3000").split() == digests(0, 3000, 3000)


@pytest.mark.parametrize("switch", [BY_DIGITS, pytest.param((), marks=pytest.mark.long)])
def test_sanitizers_find_nothing_over_the_conformance_set(
    switch: tuple[str, ...], tmp_path: Path
) -> None:
    need("cc")
    program = tmp_path / "certified"
    include = f"-I{source().parent}"
    speaker = Path(__file__).parent / "leg_programs" / "firmware.c"
    run("cc", "-O0", *SAFE, *switch, include, speaker, source(), "-o", program)
    legs = suite.load()
    # What a sanitizer finds ends the program, and its answers with it.
    report = judge.judge(legs, dialogue.ask([str(program)], judge.questions(legs), 60.0))
    assert (report.right, report.troubles) == (report.asked, [])


def test_inverse_and_forward_are_small_on_a_cortex_m4f(tmp_path: Path) -> None:
    need("arm-none-eabi-gcc")
    linked = tmp_path / "leg.elf"
    sections = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
    roots = ("-Wl,-e,fivebar_inverse", "-Wl,-u,fivebar_forward")
    # Without any library at all: what is called must be in the source.
    run("arm-none-eabi-gcc", "-Os", *M4F, *sections, "-nostdlib", *roots, source(), "-o", linked)
    text, data, bss = run("arm-none-eabi-size", linked).splitlines()[1].split()[:3]
    assert (data, bss) == ("0", "0")
    names = run("arm-none-eabi-nm", linked)
    assert "fivebar_inverse" in names
    assert "fivebar_forward" in names
    assert 1000 < int(text) <= MOST_BYTES


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only", "-Ofast"])
def test_arithmetic_that_is_not_ieee_is_refused(flag: str, tmp_path: Path) -> None:
    need("cc")
    command = ("cc", flag, "-c", source(), "-o", tmp_path / "leg.o")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "needs IEEE arithmetic" in done.stderr
