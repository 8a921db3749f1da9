"""Downloads a package's archive from the user's package index, without running code from it.

pip names the index; pip itself would run the build of a source archive to learn its metadata. The index answers by the
simple repository API in JSON (PEP 691).
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from urllib.parse import urljoin

from colonnade.common import processes
from colonnade.common.errors import UserError

#: Seconds without an answer.
TIMEOUT = 20


def download_package(project: str, sha256: str, folder: Path) -> Path:
    """Download the archive of a package that has this SHA-256.

    Args:
        project: Name of the package, in lower case with hyphens.
        sha256: Digest of the archive.
        folder: Where the archive is written.

    Raises:
        UserError: The index does not answer in JSON, has no such archive, or sends another file.
    """
    page = f"{_index().rstrip('/')}/{project}/"
    try:
        files = json.loads(_retrieved(page, None, folder, "page.json").read_bytes())["files"]
        url = next((str(file["url"]) for file in files if file["hashes"].get("sha256") == sha256), None)
    except (ValueError, KeyError, TypeError, AttributeError):
        raise UserError(f"the package index does not answer in JSON (PEP 691) for {project}") from None
    if url is None:
        raise UserError(f"the package index has no file of {project} with the SHA-256 {sha256[:12]}…")
    return _retrieved(urljoin(page, url), f"sha256:{sha256}", folder, "archive")


def _retrieved(url: str, known_hash: str | None, folder: Path, name: str) -> Path:
    import pooch

    pooch.get_logger().setLevel("ERROR")
    certificates = _setting("cert")
    downloader = pooch.HTTPDownloader(
        timeout=TIMEOUT,
        headers={"Accept": "application/vnd.pypi.simple.v1+json, */*;q=0.1"},
        **({} if certificates is None else {"verify": certificates}),
    )
    try:
        return Path(pooch.retrieve(url, known_hash, name, folder, downloader=downloader))
    except Exception as error:  # network, disk, hash
        reason = "its SHA-256 is another one" if isinstance(error, ValueError) else type(error).__name__
        raise UserError(f"{url.rpartition('@')[2]} cannot be downloaded: {reason}") from None


def _index() -> str:
    """The index that pip would use; its default is known by pip alone, which prints it in its help."""
    configured = _setting("index-url")
    if configured is not None:
        return configured
    text = " ".join(_pip("download", "--help").split())
    found = re.search(r"--index-url <url> Base URL .*?\(default (\S+)\)", text)
    if found is None:
        raise UserError("pip does not name its package index: set PIP_INDEX_URL")
    return found.group(1)


def _setting(name: str) -> str | None:
    """A setting of pip, from its environment variable or its files."""
    value = os.environ.get(f"PIP_{name.upper().replace('-', '_')}") or _pip("config", "get", f"global.{name}").strip()
    return value or None


def _pip(*arguments: str) -> str:
    """What pip prints; nothing if it fails."""
    environment = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_NO_INPUT": "1", "COLUMNS": "1000"}
    done = processes.run([sys.executable, "-m", "pip", *arguments], env=environment)
    return done.stdout if done.returncode == 0 else ""
