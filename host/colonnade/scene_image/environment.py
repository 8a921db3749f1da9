"""Adds a room's maps to a scene image, as contents of the physical-attribute memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.design.manifest import Manifest
from colonnade.maps.encoded import EncodedEnvironment, layout_of
from colonnade.maps.image import SOURCE_BYTES_PER_PIXEL, AttributeImage, memory_words
from colonnade.maps.layout import POINTER_BITS
from colonnade.maps.plane_map import PLANE_MODES
from colonnade.maps.two_level import MODES
from colonnade.scene_image.file import LoadSection, SceneImage
from colonnade.scene_image.header import EnvironmentHeader, ImageHeader, LoadedMemory


def with_environment(image: SceneImage, environment: EncodedEnvironment, manifest: Manifest) -> SceneImage:
    """Add a room's maps to a mesh's image, or replace another room's.

    Raises:
        ValueError: The words do not fit the manifest's memories.
    """
    sections = map_sections(environment.image, manifest)
    memories = tuple(LoadedMemory(section.memory, *section.words.shape) for section in sections)
    header = EnvironmentHeader(environment.environment.name, environment.image.depth_unit, memories)
    textures = (each for each in image.attributes if each.memory not in map_memories(manifest))
    return replace(image, header=replace(image.header, room=header), attributes=(*sections, *textures))


def map_memories(manifest: Manifest) -> list[str]:
    """The names of the memories of a room's maps, by load target; empty for a design without a room."""
    maps = ("albedo.", "normals.", "planes.")
    names = [name for name in manifest.memories if name.startswith(maps)]
    return sorted(names, key=lambda name: int(manifest.memories[name]["target"]))


def map_sections(image: AttributeImage, manifest: Manifest) -> list[LoadSection]:
    """The encoded maps of a room as contents of a design's memories.

    Raises:
        ValueError: The words do not fit the manifest's memories.
    """
    sections = []
    for memory, words in memory_words(image):
        shape = manifest.memories[memory]
        word_bytes = -(-int(shape["bits"]) // 8)
        if len(words) != int(shape["depth"]) or words[:, word_bytes:].any():
            raise ValueError(f"{memory}: {words.shape} bytes do not fit {shape['depth']} words of {shape['bits']} bits")
        sections.append(LoadSection(memory, np.ascontiguousarray(words[:, :word_bytes])))
    return sections


def tiles_beyond_heap(image: SceneImage) -> dict[str, int]:
    """Count the tiles of each map that point beyond its heap; maps without a heap are left out.

    The device reads words beyond the heap as 0, and reports an error for a ray that looks them up.
    """
    words = {section.memory: section.words for section in image.attributes}
    counts = {}
    for name, modes in (("albedo", MODES), ("normals", MODES), ("planes", PLANE_MODES)):
        descriptors, heap = words.get(f"{name}.descriptors"), words.get(f"{name}.heap")
        if descriptors is None or heap is None:
            continue
        low = descriptors[:, 0].astype(np.int64) | descriptors[:, 1].astype(np.int64) << 8
        lengths = np.zeros(8, dtype=np.int64)
        lengths[: len(modes)] = [mode.words for mode in modes]
        length, pointer = lengths[low & 7], (low >> 3) & ((1 << POINTER_BITS) - 1)
        counts[name] = int(((length > 0) & (pointer + length > len(heap))).sum())
    return counts


def environment_use(header: ImageHeader, manifest: Manifest) -> dict[str, dict[str, float]]:
    """Memory bytes of each map, bytes of the source map, and their ratio; empty without a room."""
    if header.room is None:
        return {}
    layout = layout_of(manifest)
    source = layout.width * layout.height * SOURCE_BYTES_PER_PIXEL
    map_bytes, plane_bytes = layout.map_memory_bytes, layout.plane_memory_bytes
    counts = {"albedo": map_bytes, "normals": map_bytes, "planes": plane_bytes}
    return {name: {"bytes": count, "source_bytes": source, "ratio": source / count} for name, count in counts.items()}
