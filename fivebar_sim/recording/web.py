"""A recording in the browser: one HTTP server on the loopback with a fixed table of pages.

Rerun's own page loads fonts and news from other hosts; this one does not, and its policy forbids
the viewer to do so.
"""

from __future__ import annotations

import socket
import socketserver
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from html import escape
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any, NamedTuple

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ConfigError
from fivebar_sim.recording.viewer import LOOPBACK, web_files

POLICY = "; ".join(
    (
        "default-src 'none'",
        # Without wasm-unsafe-eval a browser compiles no WebAssembly, and so no viewer.
        "script-src 'self' 'wasm-unsafe-eval'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""The Content-Security-Policy: nothing is loaded from, or sent to, any other host."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<link rel="icon" href="/favicon.ico">
<link rel="stylesheet" href="/page.css">
</head>
<body>
<p id="status">Loading the viewer ...</p>
<canvas id="the_canvas_id"></canvas>
<script src="/re_viewer.js"></script>
<script src="/page.js"></script>
</body>
</html>
"""

STYLE = """
html, body { margin: 0; height: 100%; overflow: hidden; background: #0d1011; }
p { position: absolute; top: 50%; width: 100%; text-align: center; color: #cad8de; }
canvas { position: absolute; top: 0; left: 0; width: 100%; height: 100%; visibility: hidden; }
canvas.visible { visibility: visible; }
"""

SCRIPT = """
"use strict";
/* The viewer tells in thousands of lines how it translates its shaders, and starts later by it. */
console.debug = () => {};
const say = (text) => { document.getElementById("status").textContent = text; };
async function start() {
  const canvas = document.getElementById("the_canvas_id");
  await wasm_bindgen({ module_or_path: "/re_viewer_bg.wasm" });
  const viewer = new wasm_bindgen.WebHandle({
    url: [new URL("/recording.rrd", location.href).href],
    hide_welcome_screen: true,
    enable_history: false,
    persist: false,
  });
  await viewer.start(canvas);
  canvas.classList.add("visible");
  say("");
  setInterval(() => {
    if (viewer.has_panicked()) {
      canvas.classList.remove("visible");
      say("The viewer has crashed: " + viewer.panic_message());
    }
  }, 1000);
}
start().catch((error) => say("The viewer did not start: " + error));
"""

LONGEST = 60.0
"""How long a connection may last [s]: on this machine a recording takes a second."""


class Page(NamedTuple):
    """A page to serve: its media type and its bytes."""

    kind: str
    body: bytes


class Server(socketserver.ThreadingTCPServer):
    """Serves a table of pages to browsers on this machine.

    Attributes:
        pages: The pages by path; nothing else is served.
    """

    # A port whose last connections are still closing may be taken at once.
    allow_reuse_address = True
    # A browser that keeps its connection open does not keep the program alive.
    daemon_threads = True
    # How many connections may wait to be accepted; with Python's own 5 the next ones wait seconds.
    request_queue_size = 1024

    def __init__(self, port: int) -> None:
        """Take a port, 0 for a free one.

        Raises:
            ArgumentError: Unless 0 <= port <= 65535.
            ConfigError: The port is taken, or needs rights that we lack.
        """
        check_number("--port", port, "", low=0, high=65535)
        self.pages: Mapping[str, Page] = {}
        self._begun: dict[socket.socket, float] = {}
        try:
            super().__init__((LOOPBACK, port), Handler)
        except OSError as error:
            raise ConfigError(f"--port must be free, got {port}: {error.strerror}") from None

    @property
    def port(self) -> int:
        """The port on which it listens."""
        return self.server_address[1]

    @property
    def url(self) -> str:
        """The address for a browser."""
        return f"http://{LOOPBACK}:{self.port}/"

    @property
    def hosts(self) -> tuple[str, str]:
        """The Host headers that are answered."""
        # A foreign page can point its own host name at the loopback, to read what is served here.
        return f"{LOOPBACK}:{self.port}", f"localhost:{self.port}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a connection in a thread of its own, and remember when it began."""
        self._begun[request] = time.monotonic()
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self._begun.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """End connections that last too long: a slow drip would hold its thread for ever."""
        for request, begun in list(self._begun.items()):
            if time.monotonic() - begun > LONGEST:
                # Its thread finds it ended, and closes it.
                with suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing if a connection was lost; other errors as Python does."""
        # Browsers end connections as they like; that is no error of ours.
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD for the paths of the table, if the Host is a loopback name."""

    server: Server  # pyright: ignore[reportIncompatibleVariableOverride]
    server_version = "fivebar"
    sys_version = ""
    # A client that connects and says nothing must not hold a thread for ever.
    timeout = 30.0

    def do_GET(self) -> None:
        """Send a page."""
        page = self._page()
        if page:
            self.wfile.write(page.body)

    def do_HEAD(self) -> None:
        """Send a page's headers."""
        self._page()

    def _page(self) -> Page | None:
        """Send the headers of the requested page and return it, or send an error."""
        page = self.server.pages.get(self.path.partition("?")[0])
        # All Host headers at once, so that none and two are refused too.
        if self.headers.get_all("Host", []) not in [[host] for host in self.server.hosts]:
            self.send_error(HTTPStatus.FORBIDDEN)
        elif page is None:
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", page.kind)
            self.send_header("Content-Length", str(len(page.body)))
            self.end_headers()
            return page

        return None

    def end_headers(self) -> None:
        """Send the headers that every answer has."""
        # Here, and not in `_page`, so that errors carry the policy too.
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the terminal is the user's."""


def pages(recording: Path, title: str) -> dict[str, Page]:
    """Return the pages for a recording: a page with this title, the viewer, and the recording.

    Raises:
        ViewerMissingError: The installed Rerun gives no web viewer.
        OSError: The recording cannot be read.
    """
    viewer = web_files()
    return {
        "/": Page("text/html; charset=utf-8", PAGE.format(title=escape(title)).encode()),
        "/page.css": Page("text/css; charset=utf-8", STYLE.encode()),
        "/page.js": Page("text/javascript; charset=utf-8", SCRIPT.encode()),
        "/re_viewer.js": Page("text/javascript; charset=utf-8", viewer["re_viewer.js"]),
        "/re_viewer_bg.wasm": Page("application/wasm", viewer["re_viewer_bg.wasm"]),
        "/favicon.ico": Page("image/x-icon", viewer["favicon.ico"]),
        "/recording.rrd": Page("application/octet-stream", recording.read_bytes()),
    }
