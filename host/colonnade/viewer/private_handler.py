"""Checks the requests to a `PrivateServer`, and answers them: HTTP/1.1, short, of its own page."""

from __future__ import annotations

import contextlib
import re
import secrets
import socket
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from io import BytesIO
from typing import NoReturn

from colonnade.common.errors import UserError
from colonnade.viewer.private_server import PrivateServer, Refused

#: Bytes of a request before its body, and of the body.
_MAX_HEAD = 1 << 14
_MAX_BODY = 1 << 12
#: Reads of 64 KiB after a refusal.
_MAX_DRAINED = 64
_NOT_HTTP = "this is no request of HTTP/1.1"
#: Headers that a request may have once.
_SINGLE = ("Host", "Origin", "Content-Length", "Content-Type", "Sec-Fetch-Site")
#: Headers of every answer: a page runs its own scripts alone, and no other site embeds, frames or reads anything.
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
    " img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class PrivateHandler(BaseHTTPRequestHandler):
    """Refuses what is no request of the server's own page, and passes on the others."""

    server: PrivateServer
    protocol_version = default_request_version = request_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    timeout = 30.0

    def respond(self, target: str, query: str, body: bytes) -> None:
        """Answer a request by `answer`.

        Args:
            target: The method, and the path after the token, such as ``GET frame``.
            query: After the question mark.
            body: Content.

        Raises:
            Refused: It cannot be answered.
            UserError: What it asks for is refused (status 422).
        """
        raise NotImplementedError

    def handle_one_request(self) -> None:
        """Answer or refuse a request."""
        try:
            self.server.wait(self.connection)
            self._read_head()
            self._admit()
        except Refused as refused:
            with contextlib.suppress(OSError):
                self._refuse(refused)
        except (ConnectionError, TimeoutError):
            self.close_connection = True
        except Exception:
            self.server.handle_error(self.connection, self.client_address)
            with contextlib.suppress(OSError):
                self._refuse(Refused(500, "an error of the server: its terminal has more"))

    def answer(self, status: int, content: bytes, kind: str = "text/plain", headers: Mapping[str, str] = {}) -> None:
        """Send an answer; text is UTF-8."""
        self.begin(status, kind, {"Content-Length": str(len(content)), **headers})
        self.wfile.write(content)

    def begin(self, status: int, kind: str, headers: Mapping[str, str] = {}) -> None:
        """Send the part of an answer before its content."""
        self.send_response(status)
        charset = "; charset=utf-8" if kind.startswith("text/") else ""
        closing = {"Connection": "close"} if self.close_connection else {}
        for name, value in {"Content-Type": kind + charset, **headers, **closing, **_HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> NoReturn:
        """Refuse what the base class refuses, without its page of HTML."""
        raise Refused(code, HTTPStatus(code).phrase)

    def log_request(self, code: int | str = "-", size: int | str = "-") -> None:
        """Standard error is for errors of the command."""

    def _read_head(self) -> None:
        """Parse a request up to its body."""
        lines: list[bytes] = []
        left = _MAX_HEAD
        while lines[-1:] not in ([b"\r\n"], [b"\n"]):
            line = self.rfile.readline(left)
            left -= len(line)
            if not line.endswith(b"\n"):
                if left > 0:
                    raise ConnectionError("closed")
                raise Refused(431 if lines else 414, f"a request may have {_MAX_HEAD:,} bytes before its body")
            lines.append(line)
            if len(lines[0].split()) != 3:
                raise Refused(400, _NOT_HTTP)
        self.raw_requestline = lines[0]
        stream, self.rfile = self.rfile, BytesIO(b"".join(lines[1:]))
        try:
            self.parse_request()
        finally:
            self.rfile = stream
        if self.headers.defects or any(len(self.headers.get_all(name, ())) > 1 for name in _SINGLE):
            raise Refused(400, _NOT_HTTP)

    def _admit(self) -> None:
        """Pass on a request of the page, which knows the token."""
        host = self.headers.get("Host")
        if host not in self.server.hosts or self.headers.get("Origin", f"http://{host}") != f"http://{host}":
            raise Refused(403, "this server answers its own page")
        if self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise Refused(403, "this server answers no other site: paste its address into the browser's address bar")
        path, _, query = self.path.removeprefix("/").partition("?")
        token, _, name = path.partition("/")
        if self.server.opens(path):
            self.close_connection = True
            return self.answer(303, b"", headers={"Location": f"/{self.server.token}/"})
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            raise Refused(403, "this is not the page's address: open the one that the command printed")
        self.server.take_up(self.connection)
        body = self._body()
        try:
            self.respond(f"{self.command} {name}", query, body)
        except UserError as error:
            self.answer(422, str(error).encode(errors="replace"))

    def _body(self) -> bytes:
        if "Transfer-Encoding" in self.headers:
            raise Refused(411, "Transfer-Encoding is not read: give Content-Length")
        length = self.headers.get("Content-Length", "0")
        if re.fullmatch("[0-9]+", length) is None:
            raise Refused(400, "Content-Length is no number of bytes")
        if len(length) > 9 or int(length) > _MAX_BODY:
            raise Refused(413, f"the content of a request may have {_MAX_BODY:,} bytes")
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            raise ConnectionError("closed")
        return body

    def _refuse(self, refused: Refused) -> None:
        """Answer, then read on for some time: closing with unread bytes would take the answer away."""
        self.close_connection = True
        self.answer(refused.status, str(refused).encode())
        self.connection.shutdown(socket.SHUT_WR)
        self.connection.settimeout(1.0)
        for _ in range(_MAX_DRAINED):
            if not self.connection.recv(1 << 16):
                break
