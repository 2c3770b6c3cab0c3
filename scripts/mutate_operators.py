"""mutmut with the operators of scripts/mutate.py, which runs it; `make` only makes the mutants.

Texts are not mutated: they are messages, and names of columns whose loss any test sees. Functions
of numbers are exchanged as well: sin and cos, min and max, any and all.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import libcst as cst
from mutmut.__main__ import cli, create_mutants
from mutmut.mutation import file_mutation, mutators
from mutmut.utils.file_utils import copy_also_copy_files, copy_src_dir

PAIRS = (
    ("sin", "cos"),
    ("minimum", "maximum"),
    ("min", "max"),
    ("argmin", "argmax"),
    ("any", "all"),
    ("floor", "ceil"),
    ("zeros", "ones"),
)
SWAPPED = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}


def swapped(node: cst.Attribute) -> Iterator[cst.Attribute]:
    """Yield a function's or method's name exchanged for its counterpart's."""
    if node.attr.value in SWAPPED:
        yield node.with_changes(attr=cst.Name(SWAPPED[node.attr.value]))


if __name__ == "__main__":
    kept = [each for each in mutators.mutation_operators if each[0] is not cst.BaseString]
    operators = [*kept, (cst.Attribute, swapped)]
    file_mutation.mutation_operators = operators  # pyright: ignore[reportPrivateImportUsage]
    if sys.argv[1:] == ["make"]:
        Path("mutants").mkdir(exist_ok=True)
        copy_src_dir()
        copy_also_copy_files()
        create_mutants(1)
    else:
        cli()
