"""MCAP as a log: the messages in JSON, a column a field, "TOPIC.FIELD"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO

import msgspec

from fivebar_sim.errors import ConfigError, ExtraError
from fivebar_sim.logs.json_lines import flat
from fivebar_sim.logs.raw import Block, Raw, Source, stream

if TYPE_CHECKING:
    from mcap.reader import McapReader

ROWS = 20_000
"""Messages that are read at once."""

CLOCK = "log_time"
"""The column of the time at which a message was written [ns]."""


def needed() -> Any:
    """Return the package mcap.

    Raises:
        ExtraError: It is not installed.
    """
    try:
        import mcap
        import mcap.reader
        import mcap.writer
    except ImportError:
        raise ExtraError("MCAP needs the extra logs: pip install 'fivebar-sim[logs]'") from None
    return mcap


def open_file(source: Source, where: str) -> Raw:
    """Return what is in an MCAP file.

    Raises:
        ConfigError: It is damaged, or no message of it is in JSON; names the topics.
        ExtraError: The package mcap is not installed.
    """
    needed()
    names: dict[str, None] = {CLOCK: None}
    foreign: dict[str, str] = {}
    units: dict[str, str] = {CLOCK: "ns"}
    seen: set[str] = set()
    for topic, encoding, data, _, schema in _messages(source, where):
        if encoding != "json":
            foreign[topic] = encoding
        elif topic not in seen:
            seen.add(topic)
            names |= dict.fromkeys(_fields(topic, data, where))
            units |= _units(topic, schema)
    if not seen:
        others = ", ".join(f"{topic} ({encoding})" for topic, encoding in foreign.items())
        raise ConfigError(
            f"{where}: no messages in JSON, only {others or 'none'}: export the topic as CSV, with "
            "PlotJuggler for one"
        )

    remarks = [
        f"the topic {topic} is in {encoding}, not in JSON, and is left out"
        for topic, encoding in foreign.items()
    ]
    said = f"MCAP: {', '.join(sorted(seen))}"
    return Raw(
        said,
        where,
        tuple(names),
        units,
        ".",
        lambda wanted: _blocks(source, where, wanted),
        remarks,
    )


def _blocks(source: Source, where: str, wanted: Sequence[str]) -> Iterator[Block]:
    """Yield columns, a row a message."""
    import pyarrow

    rows: list[dict[str, Any]] = []
    count = 0

    def block() -> Block:
        types = {name: pyarrow.int64() if name == CLOCK else pyarrow.string() for name in wanted}
        cells = {
            name: pyarrow.array(
                [_cell(row.get(name), text=name != CLOCK) for row in rows], types[name]
            )
            for name in wanted
        }
        return Block(count - len(rows) + 1, cells)

    for topic, encoding, data, time, _ in _messages(source, where):
        if encoding != "json":
            continue
        rows.append({CLOCK: time, **_fields(topic, data, where)})
        count += 1
        if len(rows) == ROWS:
            yield block()
            rows = []
    if rows:
        yield block()


def _cell(value: Any, *, text: bool) -> Any:
    return str(value) if text and value is not None else value


def _messages(source: Source, where: str) -> Iterator[tuple[str, str, bytes, int, bytes]]:
    """Yield topic, encoding, data, time and schema of each message, in the order of time."""
    try:
        with stream(source) as file:
            for schema, channel, message in _reader(file).iter_messages():
                told = b"" if schema is None else schema.data
                yield channel.topic, channel.message_encoding, message.data, message.log_time, told
    except ConfigError:
        raise
    # Damaged bytes end in errors of any kind, of the library and of those that decompress for it.
    except Exception as error:
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise ConfigError(f"{where} is damaged: {said:.120}: try `mcap recover`") from None


def _reader(file: BinaryIO) -> McapReader:
    from mcap.reader import make_reader

    return make_reader(file)


def _fields(topic: str, data: bytes, where: str) -> dict[str, Any]:
    """Return the fields of a message by "TOPIC.FIELD"."""
    try:
        value = msgspec.json.decode(data)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise ConfigError(f"{where}: a message of {topic} is not JSON: {error}") from None
    name = topic.strip("/")
    return {f"{name}.{key}" if key else name: part for key, part in flat(value)}


class _Property(msgspec.Struct):
    """A number in a JSON schema; `unit` is what `runs.mcap` writes there."""

    unit: str = ""


class _Schema(msgspec.Struct):
    """As much of a JSON schema as is read."""

    properties: dict[str, _Property] = {}


def _units(topic: str, schema: bytes) -> dict[str, str]:
    """Return the units of a topic's fields, as far as its schema has any."""
    try:
        found = msgspec.json.decode(schema, type=_Schema)
    # A schema only helps, and may be of any language.
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return {}
    front = topic.strip("/")
    return {f"{front}.{key}": each.unit for key, each in found.properties.items() if each.unit}
