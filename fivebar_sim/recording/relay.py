"""Passes bytes between Rerun's client and a viewer, so that the connection can be cut.

Rerun's client waits without a limit for a viewer that does not read, and hears no signal meanwhile;
it only gives up a connection that ends.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any

from fivebar_sim.recording.viewer import LOOPBACK

PIECE = 1 << 16
"""Bytes passed on at a time."""

Pass = Callable[[socket.socket, socket.socket], None]
"""Passes bytes from one socket to another until one of them ends."""


class Relay:
    """Listens for a client and connects it to a viewer, until it is left.

    Attributes:
        address: HOST:PORT where it listens.
        moved: When the viewer took or sent bytes last, of `time.monotonic` [s].
        full: Whether the viewer is offered bytes that it does not take.
    """

    def __init__(self, viewer: str) -> None:
        """Begin to listen; the viewer is at HOST:PORT."""
        host, _, port = viewer.rpartition(":")
        self._viewer = (host.strip("[]"), int(port))
        self._server = socket.create_server((LOOPBACK, 0))
        self._open = [self._server]
        self._lock = threading.Lock()
        self._is_cut = False
        self.address = f"{LOOPBACK}:{self._server.getsockname()[1]}"
        self.moved = time.monotonic()
        self.full = False
        self._start(self._accept)

    def __enter__(self) -> Relay:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.cut()

    def cut(self) -> None:
        """End all connections, and accept no more."""
        with self._lock:
            self._is_cut = True
            for each in self._open:
                _end(each)

    def idle(self, since: float) -> float:
        """Return how long the viewer has moved no bytes [s].

        Args:
            since: The time from which that counts, unless it did not take what was there before, of
                `time.monotonic` [s].
        """
        return time.monotonic() - (self.moved if self.full else max(since, self.moved))

    def _start(self, work: Callable[..., None], *args: Any) -> None:
        # Daemons: none of them keeps the program alive.
        threading.Thread(target=work, args=args, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client = self._keep(self._server.accept()[0])
                viewer = self._keep(socket.create_connection(self._viewer))
                self._start(self._pass, self._give, client, viewer)
                self._start(self._pass, self._take, viewer, client)

    def _keep(self, each: socket.socket) -> socket.socket:
        """Remember a socket to be cut."""
        with self._lock:
            self._open.append(each)
            if self._is_cut:
                _end(each)
        return each

    def _pass(self, work: Pass, source: socket.socket, sink: socket.socket) -> None:
        """Pass bytes on in one direction; then end both sides."""
        with suppress(OSError):
            work(source, sink)
        # Each side learns that the other one has gone.
        _end(source)
        _end(sink)

    def _give(self, client: socket.socket, viewer: socket.socket) -> None:
        """Pass bytes on to the viewer until either side ends."""
        while data := client.recv(PIECE):
            self.full = True
            viewer.sendall(data)
            self.full = False
            self.moved = time.monotonic()

    def _take(self, viewer: socket.socket, client: socket.socket) -> None:
        """Pass bytes on from the viewer until either side ends."""
        while data := viewer.recv(PIECE):
            client.sendall(data)
            self.moved = time.monotonic()


def _end(each: socket.socket) -> None:
    """End a connection, also under a thread that waits for it."""
    # Closed alone, the socket would live on while a thread reads from it.
    with suppress(OSError):
        each.shutdown(socket.SHUT_RDWR)
    each.close()
