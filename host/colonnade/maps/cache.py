"""Caches encoded environments, because encoding takes seconds."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common import cache
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.environment.model import Environment
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import AttributeImage, encode_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import encode_still

#: File name in a cache entry.
FILE = "room.npz"


def encoded_environment(
    environment: Environment, layout: AttributeLayout, folder: Path | None = None, encoder: Encoder = "offline"
) -> AttributeImage:
    """Encode an environment, or take it from the cache ``folder``, by default the project's.

    The maps of the live encoder are not cached.

    Raises:
        UserError: The live encoder does not support the layout.
    """
    if encoder == "live":
        return encode_still(environment, layout)
    rooms = folder or cache_directory(project_root()) / "rooms"

    def make(entry: Path) -> None:
        _write(entry / FILE, encode_environment(environment, layout))

    return _read(cache.entry(rooms / _key(environment, layout), make, "room") / FILE, layout)


def _key(environment: Environment, layout: AttributeLayout) -> str:
    """Hash of the encoders' inputs and of their source files."""
    digest = hashlib.sha256(encoder_sources())
    camera = environment.camera
    digest.update(repr((astuple(layout), camera.fx, camera.fy, camera.cx, camera.cy)).encode())
    for array in (environment.albedo, environment.normals, environment.depth, camera.to_world):
        digest.update(repr(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]


@functools.cache
def encoder_sources() -> bytes:
    """Digest of the encoders' source files."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    common = [here.parent / "common" / name for name in ("fixed_order.py", "srgb.py")]
    for file in [*sorted(here.glob("*.py")), *common]:
        digest.update(file.read_bytes())
    return digest.digest()


def _read(file: Path, layout: AttributeLayout) -> AttributeImage:
    with np.load(file) as stored:
        memories: dict[str, dict[str, Any]] = {}
        for name in stored.files:
            part, _, memory = name.partition(".")
            if memory:
                memories.setdefault(part, {})[memory] = stored[name]
        return AttributeImage.from_memories(layout, memories, float(stored["depth_unit"]))


def _write(file: Path, image: AttributeImage) -> None:
    arrays: dict[str, Any] = {
        f"{part}.{name}": words for part, group in image.memories().items() for name, words in group.items()
    }
    with file.open("wb") as stream:
        np.savez(stream, depth_unit=np.float64(image.depth_unit), **arrays)
