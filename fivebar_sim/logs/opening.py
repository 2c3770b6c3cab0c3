"""Opening a log: its format is told by its first bytes, not by its name."""

from __future__ import annotations

from pathlib import Path

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import input_file
from fivebar_sim.logs import json_lines, mcap_file, parquet, text
from fivebar_sim.logs.raw import Raw, Source, stream

LARGEST = 20_000_000_000
"""Largest log [bytes]."""


def open_file(source: Source, where: str = "") -> Raw:
    """Return what is in a file: CSV and its kin, JSON lines, Parquet or MCAP, told by its bytes.

    Args:
        source: The file.
        where: Its name, for messages; "" for its path.

    Raises:
        ConfigError: It cannot be read, or is not a table; says what it is and what would help.
    """
    name = where or (str(source) if isinstance(source, Path) else "log")
    head = _head(source, name)
    if head.startswith(b"PAR1"):
        return parquet.open_file(source, name)
    if head.startswith(b"\x89MCAP0\r\n"):
        return mcap_file.open_file(source, name)
    for magic, said in FOREIGN.items():
        if head.startswith(magic):
            raise ConfigError(f"{name} is {said}")

    if head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"["):
        return json_lines.open_file(source, name, head)

    return text.open_file(source, name, head)


SAMPLE = 1 << 16
"""Bytes of a file by which its format is told."""

FOREIGN = {
    b"PK\x03\x04": "an Excel workbook or another zip file: save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save the sheet as CSV",
    b"MATLAB 5.0": "a MATLAB file: write the table with writetable(T, 'log.csv')",
    b"\x89HDF": "an HDF5 or MATLAB 7.3 file: write the table as CSV or Parquet",
    b"#ROSBAG": "a ROS 1 bag: export it, `rostopic echo -b FILE -p /joint_states > log.csv`",
    b"SQLite": "an SQLite file, as ROS 2 bags are: convert it to MCAP with JSON, or to CSV",
    b"ULog": "a PX4 log: export it, `ulog2csv FILE`",
    b"\x1f\x8b": "compressed: unpack it with gunzip",
    b"(\xb5/\xfd": "compressed: unpack it with unzstd",
    b"ARROW1": "an Arrow or Feather file: write it as Parquet",
    b"\x93NUMPY": "a NumPy array without names: write it as CSV with a header",
}
"""How files begin that are something else, and what would help."""


def _head(source: Source, name: str) -> bytes:
    """Return the beginning of a file, up to `SAMPLE` bytes."""
    try:
        if isinstance(source, Path):
            input_file.check(source, LARGEST)
        with stream(source) as file:
            head = file.read(SAMPLE)
    except OSError as error:
        raise ConfigError(f"cannot read log {name}: {error.strerror}") from None
    if not head.strip():
        raise ConfigError(f"{name} is empty: a log needs a header and rows")
    return head
