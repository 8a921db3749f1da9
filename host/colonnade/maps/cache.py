"""Caches the encoded maps of environments, each by itself, because encoding takes seconds."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common import cache
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.environment.model import Environment
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import AttributeImage, Words, encode_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import LiveEncoder, encode_still

#: File name in a cache entry.
FILE = "room.npz"

#: The arrays of an environment that a part of its maps is made of. So other lights, which change the colours that a
#: room reflects, leave its normals and surfaces.
_INPUTS = {
    "albedo": ("albedo",),
    "normals": ("normals",),
    "planes": ("depth", "normals"),
    "bounding": ("depth", "normals", "albedo"),
}


def encoded_environment(
    environment: Environment, layout: AttributeLayout, folder: Path | None = None, encoder: Encoder | None = "offline"
) -> AttributeImage:
    """Encode an environment, or take it from the cache ``folder``, by default the project's.

    The maps of the live encoder are not cached.

    Raises:
        UserError: The live encoder does not support the layout.
    """
    if encoder == "live" or (encoder is None and LiveEncoder.writes(layout)):
        return encode_still(environment, layout)
    rooms = folder or cache_directory(project_root()) / "rooms"

    def keep(part: str, make: Callable[[], Words]) -> Words:
        entry = rooms / _key(part, environment, layout)
        with cache.entry(entry, "room") as empty:
            if empty is not None:
                words: dict[str, Any] = make()
                np.savez(empty / FILE, **words)
        with np.load(entry / FILE) as stored:
            return {name: stored[name] for name in stored.files}

    return encode_environment(environment, layout, keep)


def _key(part: str, environment: Environment, layout: AttributeLayout) -> str:
    """Hash of the inputs of a part of the maps, and of the encoders' source files."""
    digest = hashlib.sha256(encoder_sources())
    digest.update(repr((part, astuple(layout))).encode())
    for name in _INPUTS[part]:
        array = getattr(environment, name)
        digest.update(repr(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    if "depth" in _INPUTS[part]:
        camera = environment.camera
        digest.update(repr((camera.fx, camera.fy, camera.cx, camera.cy)).encode())
        digest.update(np.ascontiguousarray(camera.to_world).tobytes())
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
