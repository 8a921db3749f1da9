"""The pictures of a study as data URIs, each content once.

Pictures are lossless, so that difference maps are exact, while all of them fit into `MAX_BYTES`. Beyond, the pictures
of whole workloads are lossy, those with the most bytes first: pictures of one workload are compared, so they are
either all exact or all lossy.
"""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.report.explorer.study import Study

#: Bytes of all pictures; base64 makes 24 MB of them.
MAX_BYTES = 18_000_000

#: Quality of lossy WebP.
QUALITY = 90


@dataclass(frozen=True)
class Encoded:
    """An encoded picture. ``kind`` is its media type."""

    kind: str
    data: bytes
    width: int
    height: int
    is_lossy: bool

    @property
    def key(self) -> str:
        """A name by content."""
        return hashlib.sha256(self.data).hexdigest()[:16]

    def as_json(self) -> dict[str, Any]:
        """The picture for the page's script, with its data URI."""
        uri = f"data:{self.kind};base64,{base64.b64encode(self.data).decode()}"
        return {"uri": uri, "width": self.width, "height": self.height, "lossy": self.is_lossy}


def paths_of(study: Study) -> dict[str, list[str]]:
    """The paths of the pictures of each workload, the reference first."""
    paths: dict[str, list[str]] = {}
    for workload in study["workloads"]:
        measured = [point["workloads"].get(workload["name"]) or {} for point in study["points"]]
        found = [workload["reference"], *(each.get("picture") for each in measured)]
        paths[workload["name"]] = [path for path in dict.fromkeys(found) if path]
    return paths


def load(study: Study, folder: Path, max_bytes: int = MAX_BYTES) -> dict[str, Encoded]:
    """The encoded pictures of a study by their path.

    Args:
        study: The study.
        folder: The study's folder.
        max_bytes: Limit of all pictures together, beyond which workloads become lossy.

    Raises:
        UserError: A picture is missing, unreadable, or outside of `folder`.
    """
    by_workload = {
        workload: {path: _lossless(_read(folder, path)) for path in paths}
        for workload, paths in paths_of(study).items()
    }
    total = sum(map(_size, by_workload.values()))
    for workload in sorted(by_workload, key=lambda name: -_size(by_workload[name])):
        if total <= max_bytes:
            break
        total -= _size(by_workload[workload])
        by_workload[workload] = {path: _lossy(_read(folder, path)) for path in by_workload[workload]}
        total += _size(by_workload[workload])
    return {path: picture for pictures in by_workload.values() for path, picture in pictures.items()}


def _size(pictures: Mapping[str, Encoded]) -> int:
    return sum(len(picture.data) for picture in pictures.values())


def _read(folder: Path, path: str) -> NDArray[np.uint8]:
    if not (folder / path).resolve().is_relative_to(folder.resolve()):
        raise UserError(f"the study names the picture {path}, which is outside of {folder}")
    return read_picture(folder / path)


def _lossless(pixels: NDArray[np.uint8]) -> Encoded:
    """The smaller of lossless WebP and PNG."""
    webp = _encoded(pixels, "WEBP", lossless=True, quality=60, method=4, exact=True)
    png = _encoded(pixels, "PNG", optimize=True)
    return webp if len(webp.data) < len(png.data) else png


def _lossy(pixels: NDArray[np.uint8]) -> Encoded:
    return _encoded(pixels, "WEBP", is_lossy=True, quality=QUALITY, method=4)


def _encoded(pixels: NDArray[np.uint8], form: str, *, is_lossy: bool = False, **options: Any) -> Encoded:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format=form, **options)
    height, width = pixels.shape[:2]
    return Encoded(f"image/{form.lower()}", stream.getvalue(), width, height, is_lossy)
