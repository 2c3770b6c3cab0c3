"""Damages of run directories, and command lines of any words; strategies."""

from __future__ import annotations

import io
import tomllib
from typing import Any, NamedTuple

import numpy as np
import pyarrow
import pyarrow.parquet
import tomli_w
from fuzz_inputs import SCALARS, Strategy, changed, jsons, mutated
from hypothesis import strategies as st

DAMAGE = [
    *("bits", "bits", "bits", "cut", "empty", "missing", "swapped", "foreign", "directory"),
    *("link", "loop", "dangling", "device", "pipe", "values"),
]
"""What may have happened to a file of a run directory."""

SEALED = ("bits", "cut", "swapped", "values")
"""What leaves files whose checksums can be written."""

FILES = ["scenario.toml", "metrics.json", "rollout.parquet", "recording.rrd"]


class Damage(NamedTuple):
    """One thing that happened to a run directory.

    Attributes:
        file: To which file of it.
        how: One of `DAMAGE`.
        content: What is there instead, for "bits" and "values".
        other: The other file of "swapped" and "link".
        sealed: Whether the record then gets the checksums of what is there: they would be refused
            before anything reads the rest.
    """

    file: str
    how: str
    content: bytes
    other: str
    sealed: bool = False

    def __repr__(self) -> str:
        """Return it without the content: Hypothesis warns of a megabyte."""
        sealed = ", sealed" if self.sealed else ""
        return f"Damage({self.file}, {self.how}, {len(self.content)} bytes, {self.other}{sealed})"


@st.composite
def damages(draw: st.DrawFn, contents: dict[str, bytes]) -> Damage:
    """Return a damage to a run directory whose files hold the given contents."""
    file = draw(st.sampled_from(FILES))
    how = draw(st.sampled_from(DAMAGE))
    content = contents[file]
    other = draw(st.sampled_from([f for f in FILES if f != file]))
    if how == "bits":
        at = draw(st.one_of(st.integers(0, len(content) - 1), st.integers(1, 3000)))
        where = at if at < len(content) and draw(st.booleans()) else max(0, len(content) - at)
        turned = bytearray(content)
        turned[min(where, len(content) - 1)] ^= 1 << draw(st.integers(0, 7))
        content = bytes(turned)
    if how == "values":
        content = draw(_values(file, content))
    if how == "cut":
        content = content[: draw(st.integers(0, len(content) - 1))]
    sealed = how in SEALED and draw(st.booleans())
    return Damage(file, how, content, other, sealed)


def _values(file: str, content: bytes) -> Strategy:
    """Return what may be a file's content with other values."""
    if file == "metrics.json":
        return jsons(content)
    if file == "rollout.parquet":
        return records(content)
    if file == "recording.rrd":
        return mutated(content)
    table = tomllib.loads(content.decode())
    # Their keys have dots, which stand for tables elsewhere.
    dotted = {name: table.pop(name) for name in ("limits", "converge") if name in table}
    others = changed(table).map(lambda new: tomli_w.dumps(new | dotted).encode())
    return st.one_of(mutated(content), others)


NUMBERS = [value for value in SCALARS if type(value) is float]
OTHERS: list[Any] = [None, "x", True, 1, "\x1b[31m"]


@st.composite
def records(draw: st.DrawFn, content: bytes) -> bytes:
    """Return what may be a record: sound Parquet of other columns, rows, types or numbers."""
    if draw(st.integers(0, 3)) == 0:
        return draw(mutated(content))
    table = pyarrow.parquet.read_table(pyarrow.BufferReader(content))
    columns: dict[str, Any] = {name: table[name].to_numpy() for name in table.column_names}
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(list(columns)))
        how = draw(st.sampled_from("one one all size other gone more rows".split()))
        if how == "gone" and len(columns) > 1:
            del columns[name]
        elif how == "other":
            columns[name] = [draw(st.sampled_from(OTHERS))] * len(columns[name])
        elif how == "more":
            columns[draw(st.sampled_from(["x", "\x1b[31m", "belt_x", ""]))] = columns[name]
        elif how == "rows":
            most = draw(st.integers(0, len(columns[name])))
            columns = {each: values[:most] for each, values in columns.items()}
        elif len(columns[name]) and isinstance(columns[name], np.ndarray):
            columns[name] = _changed(draw, columns[name], how)
    stream = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), stream, write_page_checksum=True)
    return stream.getvalue()


def _changed(draw: st.DrawFn, column: Any, how: str) -> Any:
    """Return a column with one number exchanged, or all of them, or all of another size."""
    if how == "size":
        with np.errstate(over="ignore"):
            return column * 10.0 ** draw(st.integers(-300, 300))
    number = draw(st.one_of(st.sampled_from(NUMBERS), st.floats(width=64)))
    at = slice(None) if how == "all" else draw(st.integers(0, len(column) - 1))
    new = column.copy()
    new[at] = number
    return new


ARGUMENTS = [
    *("run", "check", "replay", "report", "render", "view", "workspace", "fly"),
    *("--out", "--set", "--quiet", "--json", "--junit", "--summary", "--keep", "--update"),
    *("--port", "--png", "--fps", "--speed", "--width", "--at", "--path", "--live-at", "--help"),
    *("short.toml", "no.toml", ".", "mine", "out", "out/deep", "a.html", "a.png", "classic", "--"),
    *("leg.L1=0", "leg.L2=0.065", "duration=1e9", "sim.timestep=1e-12", "=", "a=b", "", " ", "-"),
    *("é", "\udcff", "\u202e", "\x1b[31m", "x" * 300, "0", "-1", "nan", "1e308", "70000"),
    *("--o\x1b[31mut", "a\u2028b", "\x9b31m", "[red]x", ":apple:", "leg.name=\x07", "\x1b=1"),
    *("localhost:1", "127.0.0.1:0", "nobody:1", "--no-such", "-q", "--set=leg.L1=1", "--out="),
]
"""Words of a command line; none of them names a place outside of the folder."""

arguments: Strategy = st.one_of(
    st.lists(st.sampled_from(ARGUMENTS), max_size=6),
    st.tuples(st.sampled_from(ARGUMENTS[:7]), st.lists(st.sampled_from(ARGUMENTS), max_size=5)).map(
        lambda pair: [pair[0], *pair[1]]
    ),
)
