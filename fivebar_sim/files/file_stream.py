"""A recording on its way into a file, through a pipe: so it never lies in memory as a whole.

Rerun itself would write the file too, but report a full disk only in its log.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    import rerun as rr

DESCRIPTORS = Path("/dev/fd")
"""Where systems that have it give a name to a pipe."""

PIECE = 1 << 20
"""Most bytes that are copied at once."""


@contextmanager
def into(stream: rr.RecordingStream, file: BinaryIO) -> Iterator[None]:
    """Within, what is logged to a stream that has no output yet is written to a file.

    Raises:
        OSError: The file cannot be written, said at the end.
    """
    if not DESCRIPTORS.is_dir():
        with _whole(stream, file):
            yield
        return

    end, begin = os.pipe()
    copy = _Copy(end, file)
    try:
        stream.save(DESCRIPTORS / str(begin))
        yield
    finally:
        # Once Rerun has closed its own end of the pipe, this was the last one.
        stream.disconnect()
        os.close(begin)
        copy.join()
    if copy.error is not None:
        raise copy.error


@contextmanager
def _whole(stream: rr.RecordingStream, file: BinaryIO) -> Iterator[None]:
    """Do what `into` does, where a pipe has no name: in memory."""
    output = stream.binary_stream()
    try:
        yield
    finally:
        # Read also when a signal breaks in: Rerun warns of bytes that nobody has read.
        data = output.read()
    assert data is not None
    file.write(data)


class _Copy(threading.Thread):
    """Copies what comes through a pipe into a file, and closes the pipe.

    Attributes:
        error: Why the file could not be written, if so; the pipe is read to its end all the same.
    """

    def __init__(self, end: int, file: BinaryIO) -> None:
        super().__init__(daemon=True)
        self.error: OSError | None = None
        self._end = end
        self._file = file
        self.start()

    def run(self) -> None:
        """Copy until nobody holds the other end of the pipe."""
        with open(self._end, "rb", buffering=0) as pipe:
            while piece := pipe.read(PIECE):
                try:
                    if self.error is None:
                        self._file.write(piece)
                except OSError as error:
                    self.error = error
