"""Fetches published files once, by their SHA-256, into the user's cache or from a folder of the user's.

The environment variable COLONNADE_DOWNLOADS names the folder; it has files of the same names and content, for
machines without the network. A transfer that broke goes on where it ended. `published` lists the files.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tarfile
import urllib.error
import urllib.request
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from typing import IO, TypeVar
from urllib.parse import urlsplit

from colonnade.common import notes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError, reason_of
from colonnade.common.input_files import sha256_of
from colonnade.common.locks import locked

#: Names the folder that is searched before the network.
VARIABLE = "COLONNADE_DOWNLOADS"

#: Seconds without an answer, and how often a broken transfer goes on.
TIMEOUT, TRIES = 30, 3

_BLOCK = 1 << 20

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Download:
    """A published file.

    Attributes:
        url: Where the file is, or an archive (tar, zip) that has it.
        sha256: Digest of the file itself.
        member: Name of the file in the archive, without folders; None if `url` is the file.
    """

    url: str
    sha256: str
    member: str | None = None

    @property
    def name(self) -> str:
        """The file's name, in the cache and in the user's folder."""
        return self.member or self.published

    @property
    def published(self) -> str:
        """The last part of the address."""
        return PurePosixPath(urlsplit(self.url).path).name


def fetched(download: Download, what: str) -> Path:
    """The file on this machine, fetched if it is not there yet.

    Args:
        download: The file.
        what: What it is, in messages.

    Raises:
        UserError: It is in no folder and cannot be fetched, or has another digest; the message says what to do.
    """
    own = _in_folder(download, what)
    if own is not None:
        return own
    folder = cache_folder() / download.sha256[:16]
    file = folder / download.name
    with locked(cache_folder() / f"{download.sha256[:16]}.lock", what):
        if not (file.is_file() and sha256_of(file) == download.sha256):
            folder.mkdir(parents=True, exist_ok=True)
            part = folder / f"{download.published}.part"
            notes.tell(f"fetching {what} from {download.url}")
            _attempt(download, what, lambda: _transfer(download.url, part))
            try:
                _attempt(download, what, lambda: _place(download, part, file, what))
            finally:
                part.unlink(missing_ok=True)
    return file


def is_at_hand(download: Download) -> bool:
    """Whether the file is in the user's folder or in the cache, by its name."""
    base = os.environ.get(VARIABLE)
    folders = [cache_folder() / download.sha256[:16], *([Path(base)] if base else [])]
    return any((folder / name).is_file() for folder in folders for name in {download.name, download.published})


def cache_folder() -> Path:
    """The folder of fetched files in the user's cache."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "colonnade" / "downloads"


def _in_folder(download: Download, what: str) -> Path | None:
    """The file in the user's folder; taken out of the archive into the cache if the folder has that."""
    base = os.environ.get(VARIABLE)
    if not base:
        return None
    file, archive = Path(base) / download.name, Path(base) / download.published
    if file.is_file():
        if _attempt(download, what, lambda: sha256_of(file)) != download.sha256:
            raise UserError(f"{file}, from {VARIABLE}, is another file than {what}: {_wanted(download)}")
        return file
    if download.member is None or not archive.is_file():
        return None
    kept = cache_folder() / download.sha256[:16] / download.name
    kept.parent.mkdir(parents=True, exist_ok=True)
    _attempt(download, what, lambda: _place(download, archive, kept, what))
    return kept


def _transfer(url: str, part: Path) -> None:
    """Fetch a file, from where an earlier transfer ended."""
    for left in reversed(range(TRIES)):
        have = part.stat().st_size if part.exists() else 0
        request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
                goes_on = have > 0 and answer.status == 206
                length = answer.headers.get("Content-Length")
                with part.open("ab" if goes_on else "wb") as stream:
                    shutil.copyfileobj(answer, stream, _BLOCK)
                    got = stream.tell() - (have if goes_on else 0)
            if length is not None and got < int(length):
                raise ConnectionError(f"the transfer ended after {got:,} of {int(length):,} bytes")
            return
        except urllib.error.HTTPError as error:
            if error.code == 416 and have:  # nothing is left, or the part is of another file
                return
            raise
        except (OSError, HTTPException) as error:
            if not left or isinstance(error, urllib.error.URLError):
                raise


def _place(download: Download, source: Path, file: Path, what: str) -> None:
    """Write the file whose content or archive is `source`, if its digest is right."""
    digest = hashlib.sha256()
    with _content(source, download.member) as stream, replacing(file) as written:
        while block := stream.read(_BLOCK):
            digest.update(block)
            written.write(block)
        if digest.hexdigest() != download.sha256:
            raise UserError(f"{what} has another SHA-256 than {download.name}: {_wanted(download)}")


@contextlib.contextmanager
def _content(source: Path, member: str | None) -> Iterator[IO[bytes]]:
    """A file, or the member of a tar or zip archive that has this name, without folders."""
    if member is None:
        with source.open("rb") as stream:
            yield stream
        return
    with contextlib.ExitStack() as opened:
        inside: IO[bytes] | None = None
        if zipfile.is_zipfile(source):
            zipped = opened.enter_context(zipfile.ZipFile(source))
            entry = next((each for each in zipped.namelist() if PurePosixPath(each).name == member), None)
            inside = None if entry is None else opened.enter_context(zipped.open(entry))
        else:
            tar = opened.enter_context(tarfile.open(source))
            found = next((each for each in tar if each.isfile() and PurePosixPath(each.name).name == member), None)
            inside = None if found is None else tar.extractfile(found)
        if inside is None:
            raise OSError(f"the archive has no {member}")
        yield inside


def _attempt(download: Download, what: str, action: Callable[[], _Result]) -> _Result:
    """Do something with files and the network; failures say where the file is and what to do."""
    try:
        return action()
    except urllib.error.HTTPError as error:
        reason = f"the server answers {error.code}"
    except urllib.error.URLError as error:
        reason = reason_of(error.reason) if isinstance(error.reason, OSError) else str(error.reason)
    except OSError as error:
        reason = reason_of(error)
    except (HTTPException, tarfile.TarError, zipfile.BadZipFile, EOFError, ValueError, zlib.error) as error:
        reason = str(error) or type(error).__name__
    raise UserError(f"cannot fetch {what}: {reason}: {_wanted(download)}")


def _wanted(download: Download) -> str:
    """What the user puts where."""
    part = f", {download.member} of it," if download.member else ""
    return (
        f"put {download.url}{part} into a folder and name that in {VARIABLE}"
        f" ({download.name}, SHA-256 {download.sha256})"
    )
