"""The pictures of a study as data URIs, each content once.

Pictures are lossless, so that difference maps are exact, while all of them fit into `MAX_BYTES`. Beyond, the pictures
of whole workloads are lossy, those with the most bytes first: pictures of one workload are compared, so they are
either all exact or all lossy.
"""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from numpy.typing import NDArray

from colonnade_lab.common.parallel import in_order, processors
from colonnade_lab.report.explorer.study import Study

#: 8-bit sRGB, [height, width, 3].
Pixels = NDArray[np.uint8]

#: Bytes of all pictures; base64 makes 24 MB of them.
MAX_BYTES = 18_000_000

#: Quality of lossy WebP.
QUALITY = 90


@dataclass(frozen=True)
class Encoded:
    """A picture as WebP."""

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
        uri = f"data:image/webp;base64,{base64.b64encode(self.data).decode()}"
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
    by_workload = {workload: _encode(folder, paths, _lossless) for workload, paths in paths_of(study).items()}
    total = sum(map(_size, by_workload.values()))
    for workload in sorted(by_workload, key=lambda name: -_size(by_workload[name])):
        if total <= max_bytes:
            break
        total -= _size(by_workload[workload])
        by_workload[workload] = _encode(folder, list(by_workload[workload]), _lossy)
        total += _size(by_workload[workload])
    return {path: picture for pictures in by_workload.values() for path, picture in pictures.items()}


def _size(pictures: Mapping[str, Encoded]) -> int:
    """Bytes of the different pictures."""
    return sum({picture.key: len(picture.data) for picture in pictures.values()}.values())


def _encode(folder: Path, paths: Sequence[str], encode: Callable[[Pixels], Encoded]) -> dict[str, Encoded]:
    """The encoded pictures by their path. Designs often differ in speed only, so equal pictures are encoded once."""
    pixels = {path: _read(folder, path) for path in paths}
    digests = {path: (each.shape, hashlib.sha256(each.tobytes()).digest()) for path, each in pixels.items()}
    different = {digest: pixels[path] for path, digest in digests.items()}
    encoded = dict(zip(different, in_order(encode, list(different.values()), processors()), strict=True))
    return {path: encoded[digest] for path, digest in digests.items()}


def _read(folder: Path, path: str) -> Pixels:
    if not (folder / path).resolve().is_relative_to(folder.resolve()):
        raise UserError(f"the study names the picture {path}, which is outside of {folder}")
    return read_picture(folder / path)


def _lossless(pixels: Pixels) -> Encoded:
    return _encoded(pixels, is_lossy=False, lossless=True, quality=60, method=4)


def _lossy(pixels: Pixels) -> Encoded:
    return _encoded(pixels, is_lossy=True, quality=QUALITY, method=4)


def _encoded(pixels: Pixels, *, is_lossy: bool, **options: Any) -> Encoded:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="WEBP", **options)
    height, width = pixels.shape[:2]
    return Encoded(stream.getvalue(), width, height, is_lossy)
