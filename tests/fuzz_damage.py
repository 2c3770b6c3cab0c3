"""Damages of run directories, and command lines of any words; strategies."""

from __future__ import annotations

from typing import NamedTuple

from fuzz_inputs import Strategy, jsons, mutated
from hypothesis import strategies as st

DAMAGE = [
    *("bits", "bits", "bits", "cut", "empty", "missing", "swapped", "foreign", "directory"),
    *("link", "loop", "dangling", "device", "pipe", "values"),
]
"""What may have happened to a file of a run directory."""

FILES = ["scenario.toml", "metrics.json", "rollout.parquet", "recording.rrd"]


class Damage(NamedTuple):
    """One thing that happened to a run directory.

    Attributes:
        file: To which file of it.
        how: One of `DAMAGE`.
        content: What is there instead, for "bits" and "values".
        other: The other file of "swapped" and "link".
    """

    file: str
    how: str
    content: bytes
    other: str


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
        content = draw(jsons(content) if file == "metrics.json" else mutated(content))
    if how == "cut":
        content = content[: draw(st.integers(0, len(content) - 1))]
    return Damage(file, how, content, other)


ARGUMENTS = [
    *("run", "check", "replay", "report", "render", "view", "workspace", "fly"),
    *("--out", "--set", "--quiet", "--json", "--junit", "--summary", "--keep", "--update"),
    *("--port", "--png", "--fps", "--speed", "--width", "--at", "--path", "--live-at", "--help"),
    *("short.toml", "no.toml", ".", "mine", "out", "out/deep", "a.html", "a.png", "classic", "--"),
    *("leg.L1=0", "leg.L2=0.065", "duration=1e9", "sim.timestep=1e-12", "=", "a=b", "", " ", "-"),
    *("é", "\udcff", "\u202e", "\x1b[31m", "x" * 300, "0", "-1", "nan", "1e308", "70000"),
    *("localhost:1", "127.0.0.1:0", "nobody:1", "--no-such", "-q", "--set=leg.L1=1", "--out="),
]
"""Words of a command line; none of them names a place outside of the folder."""

arguments: Strategy = st.one_of(
    st.lists(st.sampled_from(ARGUMENTS), max_size=6),
    st.tuples(st.sampled_from(ARGUMENTS[:7]), st.lists(st.sampled_from(ARGUMENTS), max_size=5)).map(
        lambda pair: [pair[0], *pair[1]]
    ),
)
