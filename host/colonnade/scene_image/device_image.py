"""The device image: a scene image in the form that the AXI4 shell reads (docs/bus-shell.md), words of 32 bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from colonnade.design.manifest import Manifest
from colonnade.maps.image import AttributeImage
from colonnade.scene_image.environment import map_sections
from colonnade.scene_image.file import Loads, LoadSection

MAGIC = b"CLNDLOAD"
VERSION = 1

#: The header and the whole image are multiples of this; so is its address.
ALIGNMENT = 128

_HEADER_WORDS = ALIGNMENT // 4


def device_image(image: Loads, manifest: Manifest) -> bytes:
    """The image that a shell with this manifest loads.

    With a cache the scene lies in DRAM, and the image has the environment's maps only.
    """
    sections = [_section(0, image.records)] if not manifest.config["columnBvhMemory"]["cache"] else []
    return _image([*sections, *_attributes(image.attributes, manifest)], manifest)


def maps_image(image: AttributeImage, manifest: Manifest) -> bytes:
    """The image with the encoded maps of a room alone, which a shell loads between two frames of a scene."""
    return _image(_attributes(map_sections(image, manifest), manifest), manifest)


def load_cycles(image: AttributeImage, manifest: Manifest) -> int:
    """Cycles in which the load port takes a room's maps: one for each word of a record, and one for the record."""
    return sum(len(section) - 4 + int(section[1]) for section in _attributes(map_sections(image, manifest), manifest))


def _image(sections: Sequence[npt.NDArray[np.uint32]], manifest: Manifest) -> bytes:
    body = np.concatenate(sections) if sections else np.zeros(0, dtype="<u4")
    words = _HEADER_WORDS * (1 + -(-len(body) // _HEADER_WORDS))
    content = np.zeros(words, dtype="<u4")
    content[:2] = np.frombuffer(MAGIC, dtype="<u4")
    content[2:4] = VERSION, 4 * words
    content[4:12] = manifest.format_words
    content[12] = len(sections)
    content[_HEADER_WORDS : _HEADER_WORDS + len(body)] = body
    return content.tobytes()


def _attributes(sections: Sequence[LoadSection], manifest: Manifest) -> list[npt.NDArray[np.uint32]]:
    return [_section(int(manifest.memories[each.memory]["target"]), each.words) for each in sections]


def _section(target: int, records: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """Target, number of records, and the records, each in whole words. ``records`` is uint8 [records, bytes]."""
    count, size = records.shape
    padded = np.zeros((count, -(-size // 4) * 4), dtype=np.uint8)
    padded[:, :size] = records
    return np.concatenate([np.array([target, count, 0, 0], dtype="<u4"), padded.reshape(-1).view("<u4")])
