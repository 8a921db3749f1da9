"""A server of one user's pages: on this machine, at an address that nobody else knows."""

from __future__ import annotations

import contextlib
import secrets
import socket
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.terminal_text import one_line

HOST = "127.0.0.1"
#: Connections that wait for a request, and requests that are answered, at a time.
_MAX_CONNECTIONS = 64


class Refused(Exception):
    """A request that gets a status and a line; its connection is closed.

    Args:
        status: Of HTTP.
        line: Text for a reader.
    """

    def __init__(self, status: int, line: str) -> None:
        super().__init__(line)
        self.status = status


class PrivateServer(ThreadingHTTPServer):
    """A server whose pages have a random token in their address.

    Args:
        port: TCP port of 127.0.0.1; 0: a free one.
        handler: Answers requests.

    Raises:
        UserError: The port is in use.
    """

    daemon_threads = True
    request_queue_size = 2 * _MAX_CONNECTIONS

    def __init__(self, port: int, handler: type[BaseHTTPRequestHandler]) -> None:
        self.token = secrets.token_urlsafe(16)
        self._link: str | None = secrets.token_urlsafe(16)
        self._guard = threading.Lock()
        self._waiting: dict[Any, None] = {}
        self._answered: set[Any] = set()
        try:
            super().__init__((HOST, port), handler)
        except OSError as error:
            raise UserError(f"port {port} of {HOST} cannot be used: {error.strerror}: give another --port") from None

    @property
    def hosts(self) -> tuple[str, str]:
        """The names of the server in requests."""
        port = self.server_address[1]
        return f"{HOST}:{port}", f"localhost:{port}"

    @property
    def address(self) -> str:
        """The page's."""
        return f"http://{self.hosts[0]}/{self.token}/"

    @property
    def link(self) -> str:
        """Leads to the page once: every user of the machine can read the command lines of browsers."""
        return f"http://{self.hosts[0]}/{self._link}"

    def opens(self, word: str) -> bool:
        """Whether a word is the one of `link`, which is then used up."""
        with self._guard:
            is_link = self._link is not None and secrets.compare_digest(word.encode(), self._link.encode())
            if is_link:
                self._link = None
        return is_link

    def wait(self, connection: Any) -> None:
        """Note that a connection waits for a request; of too many, the one that has waited longest is closed."""
        with self._guard:
            self._answered.discard(connection)
            self._waiting[connection] = None
            oldest = next(iter(self._waiting)) if len(self._waiting) > _MAX_CONNECTIONS else None
            self._waiting.pop(oldest, None)
        if oldest is not None:
            with contextlib.suppress(OSError):
                oldest.shutdown(socket.SHUT_RDWR)

    def take_up(self, connection: Any) -> None:
        """Note that a request of the page is answered; it is `Refused` if there are too many."""
        with self._guard:
            if len(self._answered) >= _MAX_CONNECTIONS:
                raise Refused(503, "too many pages are open: close some")
            self._waiting.pop(connection, None)
            self._answered.add(connection)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._guard:
            self._waiting.pop(request, None)
            self._answered.discard(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say a bug in one line, and nothing of a page that was closed."""
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            print(one_line(f"colonnade: error: {type(error).__name__}: {error} (internal error)"), file=sys.stderr)
