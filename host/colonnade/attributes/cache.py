"""Keeps encoded rooms, because encoding one takes seconds."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import astuple
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.attributes.image import AttributeImage, encode_room
from colonnade.attributes.layout import AttributeLayout
from colonnade.files import locked, replacing
from colonnade.room.room import Room
from colonnade.toolchain import cache_directory, project_root


def encoded_room(room: Room, layout: AttributeLayout, folder: Path | None = None) -> AttributeImage:
    """`encode_room`, or what it made of the same maps before; kept in ``folder``, by default in the project's cache."""
    place = folder or cache_directory(project_root()) / "rooms"
    file = place / f"{_key(room, layout)}.npz"
    with locked(file.with_suffix(".lock")):
        kept = _read(file, layout)
        if kept is None:
            kept = encode_room(room, layout)
            _write(file, kept)
    return kept


def _key(room: Room, layout: AttributeLayout) -> str:
    """Of all that the encoders look at, and of the encoders."""
    digest = hashlib.sha256(_sources())
    camera = room.camera
    digest.update(repr((astuple(layout), camera.fx, camera.fy, camera.cx, camera.cy)).encode())
    for array in (room.albedo, room.normals, room.depth, camera.to_world):
        digest.update(repr(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]


@cache
def _sources() -> bytes:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()


def _read(file: Path, layout: AttributeLayout) -> AttributeImage | None:
    """The kept image; None if there is none, or none that can be read."""
    try:
        with np.load(file) as stored:
            memories: dict[str, dict[str, Any]] = {}
            for name in stored.files:
                part, _, memory = name.partition(".")
                if memory:
                    memories.setdefault(part, {})[memory] = stored[name]
            return AttributeImage.from_memories(layout, memories, float(stored["depth_unit"]))
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
        return None


def _write(file: Path, image: AttributeImage) -> None:
    arrays: dict[str, Any] = {
        f"{part}.{name}": words for part, group in image.memories().items() for name, words in group.items()
    }
    with replacing(file) as stream:
        np.savez(stream, depth_unit=np.float64(image.depth_unit), **arrays)
