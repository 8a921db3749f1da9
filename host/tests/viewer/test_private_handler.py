"""The server of a view answers its own page: other requests get a line, and none costs it threads, memory or words."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from colonnade.viewer.server import ViewServer
from colonnade.viewer.session import Session

#: A request is a line, headers and a body; PAGE, HOST and PORT stand for the server's.
JSON = "Content-Type: application/json"
CAMERA = '{"position": [1, 2, 3], "target": [0, 0, 0]}'
NO_CAMERA = "six numbers describe a camera"
NOT_HTTP = "this is no request of HTTP/1.1"
OTHERS = "this server answers its own page"
NO_PAGE = "this is not the page's address"


def get(path: str, *headers: str, host: str = "HOST") -> str:
    return "\n".join([f"GET PAGE{path} HTTP/1.1", f"Host: {host}", *headers, "", ""])


def post(body: str, *headers: str, kind: str = JSON) -> str:
    lengths = [] if any("-Length" in one or "-Encoding" in one for one in headers) else [f"Content-Length: {len(body)}"]
    return "\n".join(["POST PAGEcamera HTTP/1.1", "Host: HOST", kind, *lengths, *headers, "", body])


REFUSED = {
    # Whose request it is
    "host-other": (get("", host="elsewhere.example:PORT"), 403, OTHERS),
    "host-none": ("GET PAGE HTTP/1.1\n\n", 403, OTHERS),
    "host-none-1.0": ("GET PAGE HTTP/1.0\n\n", 403, OTHERS),
    "host-ipv6": (get("", host="[::1]:PORT"), 403, OTHERS),
    "host-short": (get("", host="127.1:PORT"), 403, OTHERS),
    "host-twice": (get("", "Host: elsewhere.example"), 400, NOT_HTTP),
    "host-twice-reversed": (get("", "Host: HOST", host="elsewhere.example"), 400, NOT_HTTP),
    "origin-other": (get("frame", "Origin: http://elsewhere.example"), 403, OTHERS),
    "origin-null": (get("frame", "Origin: null"), 403, OTHERS),
    "origin-https": (get("", "Origin: https://HOST"), 403, OTHERS),
    "origin-no-scheme": (get("", "Origin: HOST"), 403, OTHERS),
    "origin-port": (get("", "Origin: http://127.0.0.1:1"), 403, OTHERS),
    "origin-alias": (get("", "Origin: http://localhost:PORT"), 403, OTHERS),
    "origin-twice": (get("", "Origin: http://HOST", "Origin: http://elsewhere.example"), 400, NOT_HTTP),
    "site-cross": (get("", "Sec-Fetch-Site: cross-site"), 403, "no other site"),
    "site-same": (get("orbit.js", "Sec-Fetch-Site: same-site"), 403, "no other site"),
    "site-twice": (get("", "Sec-Fetch-Site: none", "Sec-Fetch-Site: cross-site"), 400, NOT_HTTP),
    "post-origin": (post(CAMERA, "Origin: http://elsewhere.example"), 403, OTHERS),
    "websocket": (get("events", "Upgrade: websocket", "Origin: http://elsewhere.example"), 403, OTHERS),
    "preflight": ("OPTIONS PAGEcamera HTTP/1.1\nHost: HOST\nOrigin: http://elsewhere.example\n\n", 403, OTHERS),
    # Without the token
    "no-token": ("GET / HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "no-token-frame": ("GET /frame HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "no-token-events": ("GET /events HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "no-token-script": ("GET /orbit.js HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "no-token-save": (post(CAMERA).replace("PAGE", "/"), 403, NO_PAGE),
    "token-wrong": ("GET /AAAAAAAAAAAAAAAAAAAAAA/frame HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "token-latin": ("GET /\xe9/frame HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "absolute-other": ("GET http://elsewhere.example/frame HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "absolute-broken": ("GET http://[/ HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "slashes": ("GET //etc/passwd HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    "star": ("GET * HTTP/1.1\nHost: HOST\n\n", 403, NO_PAGE),
    # Paths and methods
    "traversal": (get("../scene.toml"), 404, "nothing is here"),
    "traversal-encoded": (get("%2e%2e/scene.toml"), 404, "nothing is here"),
    "traversal-file": (get("live.js/../server.py"), 404, "nothing is here"),
    "nul": (get("live.js\0"), 404, "nothing is here"),
    "bracket": (get("//[x"), 404, "nothing is here"),
    "put": (post(CAMERA).replace("POST", "PUT"), 404, "nothing is here"),
    "delete": (get("").replace("GET", "DELETE"), 404, "nothing is here"),
    "markup": (get("").replace("GET", "<script>alert(1)</script>"), 404, "nothing is here"),
    "post-events": (post("").replace("camera", "events"), 404, "nothing is here"),
    "get-camera": (get("camera"), 404, "nothing is here"),
    "moment-text": (get("frame?at=now"), 400, "a number from 0 to 1"),
    "moment-nan": (get("frame?at=nan"), 400, "a number from 0 to 1"),
    "moment-after": (get("frame?at=1.01"), 400, "a number from 0 to 1"),
    # Framing
    "length-negative": (post(CAMERA, "Content-Length: -1"), 400, "Content-Length is no number"),
    "length-text": (post(CAMERA, "Content-Length: abc"), 400, "Content-Length is no number"),
    "length-hex": (post(CAMERA, "Content-Length: 0x10"), 400, "Content-Length is no number"),
    "length-plus": (post(CAMERA, "Content-Length: +5"), 400, "Content-Length is no number"),
    "length-underscore": (post(CAMERA, "Content-Length: 1_0"), 400, "Content-Length is no number"),
    "length-superscript": (post(CAMERA, "Content-Length: \xb2"), 400, "Content-Length is no number"),
    "length-empty": (post(CAMERA, "Content-Length: "), 400, "Content-Length is no number"),
    "length-digits": (post(CAMERA, f"Content-Length: {'9' * 5000}"), 413, "4,096 bytes"),
    "length-10GB": (post(CAMERA, "Content-Length: 10000000000"), 413, "4,096 bytes"),
    "length-4097": (post("x" * 4097), 413, "4,096 bytes"),
    "length-twice": (post(CAMERA, "Content-Length: 2", "Content-Length: 40"), 400, NOT_HTTP),
    "length-of-get": (get("", "Content-Length: -1"), 400, "Content-Length is no number"),
    "chunked": (post("5\nhello\n0\n\n", "Transfer-Encoding: chunked"), 411, "give Content-Length"),
    "chunked-and-length": (post(CAMERA, "Transfer-Encoding: chunked", "Content-Length: 2"), 411, "give Content-Length"),
    "space-before-colon": (post(CAMERA, "Content-Length : 2"), 400, NOT_HTTP),
    "no-colon": (get("", "nonsense", "Origin: http://elsewhere.example"), 400, NOT_HTTP),
    "folded-first": ("GET PAGE HTTP/1.1\n folded\nHost: HOST\n\n", 400, NOT_HTTP),
    "empty": ("\n", 400, NOT_HTTP),
    "garbage": ("\x16\x03\x01\x02\0\x01\xfc\x03\x03\n", 400, NOT_HTTP),
    "one-word": ("GET\n", 400, NOT_HTTP),
    "four-words": ("GET PAGE x HTTP/1.1\n\n", 400, NOT_HTTP),
    "version-0.9": ("GET PAGE\n", 400, NOT_HTTP),
    "version-2": (get("").replace("/1.1", "/2.0"), 505, "HTTP Version Not Supported"),
    "version-9.9": (get("").replace("/1.1", "/9.9"), 505, "HTTP Version Not Supported"),
    "version-1.1.1": (get("").replace("/1.1", "/1.1.1"), 400, "Bad Request"),
    "version-digits": (get("").replace("/1.1", f"/1.{'1' * 5000}"), 400, "Bad Request"),
    "version-text": (get("").replace("HTTP/1.1", "HTCPCP/1.0"), 400, "Bad Request"),
    "long-line": (get("a" * 70_000), 414, "16,384 bytes"),
    "long-header": (get("", f"X: {'a' * 70_000}"), 431, "16,384 bytes"),
    "long-headers": (get("", *[f"X{index}: {'a' * 1000}" for index in range(20)]), 431, "16,384 bytes"),
    "many-headers": (get("", *[f"X{index}: 1" for index in range(200)]), 431, "Request Header Fields Too Large"),
    # Cameras
    "form": (post(CAMERA, kind="Content-Type: application/x-www-form-urlencoded"), 404, "nothing is here"),
    "plain": (post(CAMERA, kind="Content-Type: text/plain"), 404, "nothing is here"),
    "no-type": (post(CAMERA, kind="X: y"), 404, "nothing is here"),
    "json-empty": (post(""), 400, NO_CAMERA),
    "json-null": (post("null"), 400, NO_CAMERA),
    "json-list": (post("[1]"), 400, NO_CAMERA),
    "json-text": (post('"x"'), 400, NO_CAMERA),
    "json-half": (post(CAMERA[:-1]), 400, NO_CAMERA),
    "json-deep": (post("[" * 4000), 400, NO_CAMERA),
    "json-deep-objects": (post('{"position":' * 300), 400, NO_CAMERA),
    "json-nan": (post(CAMERA.replace("3", "NaN")), 400, NO_CAMERA),
    "json-inf": (post(CAMERA.replace("3", "1e999")), 400, NO_CAMERA),
    "json-beyond": (post(CAMERA.replace("3", "1e13")), 400, NO_CAMERA),
    "json-digits": (post(CAMERA.replace("3", "9" * 3000)), 400, NO_CAMERA),
    "json-texts": (post('{"position": "123", "target": "456"}'), 400, NO_CAMERA),
    "json-boolean": (post(CAMERA.replace("1", "true")), 400, NO_CAMERA),
    "json-objects": (post('{"position": {"0": 1, "1": 2, "2": 3}, "target": [0, 0, 0]}'), 400, NO_CAMERA),
    "json-four": (post(CAMERA.replace("3", "3, 4")), 400, NO_CAMERA),
    "json-latin": (post("\xff\xfe\xfd"), 400, NO_CAMERA),
    "json-utf-16": (post("\0".join(CAMERA) + "\0"), 400, NO_CAMERA),
    "query-five": (get("frame?camera=1,2,3,4,5"), 400, NO_CAMERA),
    "query-seven": (get("frame?camera=1,2,3,4,5,6,7"), 400, NO_CAMERA),
    "query-nan": (get("frame?camera=nan,0,0,0,0,0"), 400, NO_CAMERA),
    "query-inf": (get("frame?camera=1e400,0,0,0,0,0"), 400, NO_CAMERA),
    "query-digits": (get(f"frame?camera={'9' * 5000},0,0,0,0,0"), 400, NO_CAMERA),
    "query-line-end": (get("frame?camera=%0d%0aX:y"), 400, NO_CAMERA),
    "query-place": (get("frame?camera=0,0,0,0,0,0"), 422, "the camera's position is its target"),
    "query-far": (get("frame?still=1&camera=1e5,0,0,0,0,0"), 422, "the camera is"),
}


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewServer]:
    """A server for many requests."""
    file = tmp_path_factory.mktemp("view") / "scene.toml"
    file.write_text('mesh.name = "octahedron"\n')
    server = ViewServer(Session(file, "tiny", size=(48, 36)))
    server.start()
    yield server
    server.stop()


def sent(server: ViewServer, request: str) -> socket.socket:
    """A connection with a request."""
    port = str(server.server_address[1])
    page = server.address.split(port)[1]
    text = request.replace("PAGE", page).replace("HOST", f"127.0.0.1:{port}").replace("PORT", port)
    head, end, body = text.partition("\n\n")
    connection = socket.create_connection(server.server_address[:2])
    with contextlib.suppress(ConnectionError):  # a long request is refused before its end
        connection.sendall(head.replace("\n", "\r\n").encode("latin-1") + end.replace("\n", "\r\n").encode())
        connection.sendall(body.encode("latin-1"))
    return connection


def answer_of(connection: socket.socket) -> tuple[int, str, str]:
    """Status, headers and content of an answer, after which the server closes."""
    with connection, connection.makefile("rb") as stream:
        status = stream.readline().split()
        head, _, content = stream.read().partition(b"\r\n\r\n")
    return int(status[1]), head.decode("latin-1"), content.decode()


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_is_a_status_and_a_line(held: ViewServer, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    request, status, line = REFUSED[name]
    before = held.session.file.read_text()
    connection = sent(held, request)
    if status == 422:  # the connection stays
        connection.shutdown(socket.SHUT_WR)
    found, head, content = answer_of(connection)
    assert (found, content.count("\n")) == (status, 0) and line in content
    assert "frame-ancestors 'none'" in head and "nosniff" in head
    assert held.session.file.read_text() == before
    assert capfd.readouterr() == ("", "")


def test_every_answer_keeps_other_sites_out(held: ViewServer) -> None:
    for path in ("", "live.js", "orbit.js", "style.css", "frame", "frame?still=1", "events"):
        with urlopen(held.address + path) as answer:
            headers = answer.headers
            assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
            assert headers["Cross-Origin-Resource-Policy"] == "same-origin" and headers["Cache-Control"] == "no-store"
            assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
            if path == "events":
                assert b'"triangles": 8' in answer.readline()
    for name in ("localhost", "127.0.0.1"):
        host = f"{name}:{held.server_address[1]}"
        own = Request(held.address, headers={"Host": host, "Origin": f"http://{host}", "Sec-Fetch-Site": "same-origin"})
        urlopen(own).close()


def test_a_link_leads_to_the_page_once(server: ViewServer) -> None:
    with urlopen(server.link) as answer:
        assert answer.url == server.address and b"live.js" in answer.read()
    with pytest.raises(HTTPError, match="403"):
        urlopen(server.link)
    others = Session(server.session.file, "tiny", size=(48, 36))
    assert ViewServer(others).token != server.token


def test_a_bug_is_one_line(
    server: ViewServer, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    right = server.session.frame

    def wrong(*_: object) -> None:
        raise ZeroDivisionError("of\na test")

    monkeypatch.setattr(server.session, "frame", wrong)
    assert answer_of(sent(server, get("frame")))[0] == 500
    assert capfd.readouterr().err == "colonnade: error: ZeroDivisionError: of a test (internal error)\n"
    monkeypatch.setattr(server.session, "frame", right)
    urlopen(f"{server.address}frame").close()


def test_a_slow_client_is_dropped(server: ViewServer, monkeypatch: pytest.MonkeyPatch) -> None:
    handler = server.RequestHandlerClass
    assert 1 < (handler.timeout or 0) <= 60
    monkeypatch.setattr(handler, "timeout", 0.2)
    for request in ("GET / HT", get("").rstrip(), post(CAMERA, "Content-Length: 100")):
        with sent(server, request) as connection, contextlib.suppress(ConnectionError):
            assert connection.recv(1) == b""


def test_clients_that_wait_cost_no_threads(server: ViewServer) -> None:
    before = threading.active_count()
    with contextlib.ExitStack() as clients:
        for _ in range(300):
            clients.enter_context(sent(server, "GET / HT"))
        urlopen(f"{server.address}frame").close()
        while threading.active_count() > before + 70:
            time.sleep(0.01)


def test_a_body_without_end_is_not_read(server: ViewServer) -> None:
    with sent(server, post("", "Content-Length: -1")) as connection, pytest.raises(ConnectionError):
        for _ in range(64):
            connection.sendall(bytes(1 << 20))


def test_pages_are_limited_and_come_back(server: ViewServer, file: Path) -> None:
    with contextlib.ExitStack() as pages:
        streams = [pages.enter_context(sent(server, get("events"))) for _ in range(80)]
        firsts = [stream.recv(12)[-3:] for stream in streams]
        assert firsts.count(b"200") == 64 and firsts.count(b"503") == 16
        assert answer_of(sent(server, get("frame")))[0] == 503
    while True:  # each stream learns that it was closed when it writes
        file.write_text(f"{file.read_text()}#\n")
        with contextlib.suppress(HTTPError):
            urlopen(f"{server.address}frame").close()
            return
        time.sleep(0.05)


def test_clients_that_read_nothing_stop_no_frame(server: ViewServer) -> None:
    with contextlib.ExitStack() as clients:
        for _ in range(20):
            client = clients.enter_context(sent(server, get("frame") * 50))
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        with urlopen(f"{server.address}frame") as answer:
            assert json.loads(answer.headers["X-Frame"])["width"] == 48
