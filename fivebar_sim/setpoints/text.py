"""A table of setpoints as a C header or as CSV."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.setpoints.commands import Commands
from fivebar_sim.setpoints.rows import Rows

KINDS = (".h", ".csv")


def write(place: Path, table: Rows, sent: Commands) -> None:
    """Write a table, .h or .csv.

    Raises:
        ConfigError: Another kind of file, or one that cannot be written.
    """
    kind = place.suffix.lower()
    if kind not in KINDS:
        raise ConfigError(f"cannot write {place}: a table must end in {' or '.join(KINDS)}")
    whole_file.write(place, header(table, sent) if kind == ".h" else csv(table, sent))


def header(table: Rows, sent: Commands) -> str:
    """Return the table as a C header: a const array, its rows and its rate."""
    name = c_name(table.name)
    count = len(sent.values)
    again = "the first row comes again after the last" if table.periodic else "it ends there"
    lines = [
        # A name may hold what would end the comment.
        f"/* {_plain(table.name)}, leg {_plain(table.leg)}, by fivebar export.",
        f" * (A, E): {sent.said}; {count} rows at {table.rate:.9g} Hz, {again}. */",
        f"#ifndef {name.upper()}_H",
        f"#define {name.upper()}_H",
        "",
        "#include <stdint.h>",
        "",
        f"#define {name.upper()}_ROWS {count}",
        f"#define {name.upper()}_RATE {_float(table.rate)} /* [Hz] */",
        f"#define {name.upper()}_PERIODIC {int(table.periodic)}",
        "",
        f"static const {_type(sent)} {name}[{name.upper()}_ROWS][2] = {{",
        *(f"    {{{', '.join(_number(v) for v in row)}}}," for row in sent.values.tolist()),
        "};",
        "",
        "#endif",
    ]

    return "\n".join(lines) + "\n"


def csv(table: Rows, sent: Commands) -> str:
    """Return the table as CSV: time, A and E, with their units in the first line."""
    unit = sent.unit if sent.unit in ("rad", "deg", "count", "us") else "whole_deg"
    lines = [f"time_s,A_{unit},E_{unit}"]
    for k, row in enumerate(sent.values.tolist()):
        lines.append(",".join([f"{k / table.rate:.9g}", *(f"{value:.9g}" for value in row)]))
    return "\n".join(lines) + "\n"


def c_name(name: str) -> str:
    """Return a name as C takes it: letters, digits and _, a letter first."""
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_").lower()
    return word if word[:1].isalpha() else f"gait_{word}".strip("_")


def _plain(text: str) -> str:
    return re.sub(r"[^ -~]|\*/|/\*", "?", text)


def _type(sent: Commands) -> str:
    """Return the smallest C type that holds the numbers."""
    if not np.issubdtype(sent.values.dtype, np.integer):
        return "float"
    low = int(sent.values.min())
    high = int(sent.values.max())
    if low >= 0:
        return next(t for t, most in _UNSIGNED.items() if high <= most)
    return "int16_t" if low >= -(2**15) and high < 2**15 else "int32_t"


_UNSIGNED = {"uint8_t": 2**8 - 1, "uint16_t": 2**16 - 1, "uint32_t": 2**32 - 1}


def _number(value: float | int) -> str:
    return str(value) if isinstance(value, int) else _float(value)


def _float(value: float) -> str:
    """Return a C float that is read as the nearest one."""
    text = f"{np.float32(value):.9g}"
    return f"{text}f" if re.search(r"[.e]", text) else f"{text}.0f"
