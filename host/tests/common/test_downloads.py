"""Published files: fetched once by their SHA-256, from a server on this machine or a folder."""

from __future__ import annotations

import hashlib
import io
import tarfile
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from colonnade.common.downloads import Download, cache_folder, fetched, is_at_hand
from colonnade.common.errors import UserError

CONTENT = bytes(range(256)) * 20
SHA256 = hashlib.sha256(CONTENT).hexdigest()


class Server(ThreadingHTTPServer):
    """Serves `files` by name; an answer has at most `limit` bytes of what its header states."""

    files: dict[str, bytes]
    limit: int | None
    asked: list[str | None]
    has_ranges: bool

    def download(self, name: str = "mesh.obj", sha256: str = SHA256, member: str | None = None) -> Download:
        return Download(f"http://127.0.0.1:{self.server_port}/folder/{name}", sha256, member)


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        content, asked = self.server.files.get(Path(self.path).name), self.headers["Range"]
        self.server.asked.append(asked)
        if content is None:
            self.send_error(404)
            return
        begin = int(asked[len("bytes=") : -1]) if asked and self.server.has_ranges else 0
        self.send_response(206 if begin else 200)
        self.send_header("Content-Length", str(len(content) - begin))
        self.end_headers()
        self.wfile.write(content[begin:][: self.server.limit])

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("COLONNADE_DOWNLOADS", raising=False)
    with Server(("127.0.0.1", 0), Handler) as started:
        started.files, started.limit, started.asked, started.has_ranges = {"mesh.obj": CONTENT}, None, [], True
        thread = threading.Thread(target=started.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield started
        started.shutdown()
        thread.join()


def test_a_file_is_fetched_once(server: Server) -> None:
    download = server.download()
    assert not is_at_hand(download)
    file = fetched(download, "the mesh")
    assert (file.read_bytes(), file.name) == (CONTENT, "mesh.obj")
    assert is_at_hand(download)
    assert fetched(download, "the mesh") == file
    assert len(server.asked) == 1
    file.write_bytes(b"damaged")
    assert fetched(download, "the mesh").read_bytes() == CONTENT
    assert len(server.asked) == 2


@pytest.mark.parametrize("has_ranges", [True, False])
def test_a_broken_transfer_goes_on_where_it_ended(server: Server, has_ranges: bool) -> None:
    server.limit, server.has_ranges = 2000, has_ranges
    download = server.download()
    if not has_ranges:
        # Each transfer begins again, and ends early again
        with pytest.raises(UserError, match=r"cannot fetch the mesh: the transfer ended after 2,000 of 5,120 bytes"):
            fetched(download, "the mesh")
        server.limit = None
    assert fetched(download, "the mesh").read_bytes() == CONTENT
    ranges = [None, "bytes=2000-", "bytes=4000-"]
    assert server.asked == (ranges if has_ranges else [None, "bytes=2000-", "bytes=2000-", "bytes=2000-"])


def _archive(kind: str) -> bytes:
    stream = io.BytesIO()
    if kind == "zip":
        with zipfile.ZipFile(stream, "w") as zipped:
            zipped.writestr("bob/readme.txt", "of bob")
            zipped.writestr("bob/mesh.obj", CONTENT)
    else:
        with tarfile.open(fileobj=stream, mode="w:gz") as tar:
            entry = tarfile.TarInfo("bob/mesh.obj")
            entry.size = len(CONTENT)
            tar.addfile(entry, io.BytesIO(CONTENT))
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["zip", "tar.gz"])
def test_a_file_is_taken_out_of_its_archive(
    server: Server, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.files[f"bob.{kind}"] = _archive(kind)
    download = server.download(f"bob.{kind}", member="mesh.obj")
    file = fetched(download, "the mesh")
    assert [each.name for each in file.parent.iterdir()] == ["mesh.obj"]
    assert file.read_bytes() == CONTENT
    file.unlink()
    (tmp_path / f"bob.{kind}").write_bytes(server.files.pop(f"bob.{kind}"))
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    assert fetched(download, "the mesh").read_bytes() == CONTENT
    with pytest.raises(UserError, match=r"the archive has no other\.obj"):
        fetched(server.download(f"bob.{kind}", member="other.obj"), "the mesh")


def test_a_folder_serves_without_the_network(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "mesh.obj"
    own.write_bytes(CONTENT)
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    assert is_at_hand(server.download())
    assert fetched(server.download(), "the mesh") == own
    assert not server.asked
    own.write_bytes(b"another")
    with pytest.raises(
        UserError, match=r"mesh\.obj, from COLONNADE_DOWNLOADS, is another file than the mesh: put http"
    ):
        fetched(server.download(), "the mesh")


def test_a_failure_says_what_from_where_and_what_to_do(server: Server) -> None:
    missing = server.download("gone.obj")
    wanted = rf"put {missing.url} into a folder and name that in COLONNADE_DOWNLOADS \(gone\.obj, SHA-256 {SHA256}\)"
    with pytest.raises(UserError, match=f"cannot fetch the mesh: the server answers 404: {wanted}$"):
        fetched(missing, "the mesh")
    other = hashlib.sha256(b"").hexdigest()
    with pytest.raises(UserError, match=r"the mesh has another SHA-256 than mesh\.obj: put http"):
        fetched(server.download(sha256=other), "the mesh")
    assert not list(cache_folder().rglob("*.part"))
    server.server_close()
    closed = Download("http://127.0.0.1:9/mesh.obj", "0" * 64)
    with pytest.raises(UserError, match=r"cannot fetch the mesh: .*refused: put http"):
        fetched(closed, "the mesh")
