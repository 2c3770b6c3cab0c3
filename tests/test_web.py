"""The server of `replay --web`: what it serves, whom, and how; nothing of the disk but the run."""

from __future__ import annotations

import http.client
import socket
import struct
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.recording import web

FILES = {"re_viewer.js": b"js", "re_viewer_bg.wasm": b"\0asm", "favicon.ico": b"icon"}


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[web.Server]:
    monkeypatch.setattr(web, "web_files", lambda: FILES)
    (tmp_path / "a.rrd").write_bytes(b"RRF2 and more")
    with web.Server(0) as server:
        server.pages = web.pages(tmp_path / "a.rrd", "<b> & co")
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(
    server: web.Server, path: str = "/", method: str = "GET", host: str | None = None
) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    try:
        connection.putrequest(method, path, skip_host=host is not None)
        if host:
            connection.putheader("Host", host)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def test_pages_are_those_of_the_table(server: web.Server) -> None:
    assert set(server.pages) == {
        *("/", "/page.css", "/page.js", "/recording.rrd"),
        *(f"/{name}" for name in FILES),
    }
    for path, page in server.pages.items():
        status, headers, body = ask(server, path)
        assert (status, body) == (200, page.body)
        assert headers["Content-Type"] == page.kind
        status, headers, body = ask(server, path, "HEAD")
        assert (status, body) == (200, b"")
        assert headers["Content-Length"] == str(len(page.body))
    assert ask(server, "/recording.rrd?x=/../..")[2] == b"RRF2 and more"
    assert ask(server, "/re_viewer_bg.wasm")[1]["Content-Type"] == "application/wasm"
    assert b"<title>&lt;b&gt; &amp; co</title>" in ask(server)[2]


@pytest.mark.parametrize(
    "path",
    [
        *(
            "/index.html",
            "/.",
            "/..",
            "/../a.rrd",
            "/a.rrd",
            "/%2e%2e/a.rrd",
            "/recording.rrd/",
        ),
        *("/etc/passwd", "//etc/passwd", "/recording%2Errd", "*", "/\\..\\a"),
    ],
)
def test_nothing_else_is_served(server: web.Server, path: str) -> None:
    status, _, body = ask(server, path)
    assert status == 404
    assert b"RRF2" not in body


def test_only_the_loopback_names_are_answered(server: web.Server) -> None:
    port = server.port
    for host in (f"127.0.0.1:{port}", f"localhost:{port}"):
        assert ask(server, host=host)[0] == 200
    foreign = [f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", f"127.0.0.1:{port}.x"]
    for host in (*foreign, f"localhost.:{port}", f"[::1]:{port}", ""):
        for method in ("GET", "HEAD"):
            assert ask(server, "/recording.rrd", method, host=host)[0] == 403, host


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE", "X"])
def test_only_get_and_head_are_answered(server: web.Server, method: str) -> None:
    status, headers, body = ask(server, "/recording.rrd", method)
    assert status == 501
    assert b"RRF2" not in body
    assert "Access-Control-Allow-Origin" not in headers


@pytest.mark.parametrize("path", ["/", "/recording.rrd", "/nothing"])
def test_every_answer_keeps_the_page_to_itself(server: web.Server, path: str) -> None:
    _, headers, _ = ask(server, path)
    policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
    sources = {source for listed in policy.values() for source in listed.split()}
    assert sources == {"'none'", "'self'", "'wasm-unsafe-eval'"}
    assert policy["default-src"] == "'none'"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"


def test_page_names_no_other_host(server: web.Server) -> None:
    for path in ("/", "/page.css", "/page.js"):
        assert b"//" not in server.pages[path].body


def test_it_listens_on_the_loopback_alone(server: web.Server) -> None:
    assert server.socket.getsockname()[0] == "127.0.0.1"
    assert server.url == f"http://127.0.0.1:{server.port}/"


def test_port_that_cannot_be_had_is_refused(server: web.Server) -> None:
    with pytest.raises(ConfigError, match=f"^--port must be free, got {server.port}: Address"):
        web.Server(server.port)
    for port in (-1, 65536):
        with pytest.raises(ArgumentError, match=rf"^--port must be in \[0, 65535\], got {port}"):
            web.Server(port)


def test_a_lost_connection_prints_nothing(
    server: web.Server, capsys: pytest.CaptureFixture[str]
) -> None:
    for request in (b"", b"GET /recording.rrd HTTP/1.0\r\nHo"):
        connection = socket.create_connection(("127.0.0.1", server.port))
        connection.sendall(request)
        # Closed with a reset, as by a browser that is killed.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.close()
    assert ask(server)[0] == 200
    wait_until_idle(server)
    assert capsys.readouterr() == ("", "")


def wait_until_idle(server: web.Server) -> None:
    while server._begun:
        threading.Event().wait(0.01)


def test_an_error_of_ours_is_printed(
    server: web.Server, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(self: web.Handler) -> None:
        raise ValueError("ours")

    monkeypatch.setattr(web.Handler, "do_GET", fail)
    with pytest.raises(http.client.RemoteDisconnected):
        ask(server)
    wait_until_idle(server)
    assert "ValueError: ours" in capsys.readouterr().err


def test_a_slow_drip_is_ended(server: web.Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "LONGEST", 0.0)
    monkeypatch.setattr(web.Handler, "timeout", None)  # that of a single byte
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        connection.sendall(b"GET / HT")
        assert connection.recv(1) == b""


def test_many_at_once_are_served(server: web.Server) -> None:
    """Hundreds that say nothing, or half of it, before the server accepts any, and a crowd."""
    accept = server.get_request
    gate = threading.Event()

    def late() -> tuple[socket.socket, object]:
        gate.wait()
        return accept()

    server.get_request = late
    half = [socket.create_connection(("127.0.0.1", server.port), 10) for _ in range(300)]
    for each in half[::2]:
        each.sendall(b"GET / HT")
    gate.set()
    with ThreadPoolExecutor(50) as pool:
        answers = list(pool.map(lambda _: ask(server)[0], range(200)))
    assert answers == [200] * 200
    for each in half:
        each.close()
