"""A room as part of the scene image: what each memory of the hardware's physical-attribute memory is loaded with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.design.manifest import Manifest
from colonnade.environment.encoded import EncodedEnvironment, layout_of
from colonnade.environment.encoding.image import SOURCE_BYTES_PER_PIXEL, memory_words
from colonnade.environment.encoding.layout import POINTER_BITS
from colonnade.environment.encoding.plane_map import PLANE_MODES
from colonnade.environment.encoding.two_level import MODES
from colonnade.scene_image.file import EnvironmentHeader, ImageHeader, LoadedMemory, LoadSection, SceneImage


def with_environment(image: SceneImage, environment: EncodedEnvironment, manifest: Manifest) -> SceneImage:
    """A mesh's image with a room's maps.

    Raises:
        ValueError: Words do not fit the manifest's memories.
    """
    sections = []
    for memory, words in memory_words(environment.image):
        place = manifest.memories[memory]
        word_bytes = -(-int(place["bits"]) // 8)
        if len(words) != int(place["depth"]) or words[:, word_bytes:].any():
            raise ValueError(f"{memory}: {words.shape} bytes do not fit {place['depth']} words of {place['bits']} bits")
        sections.append(LoadSection(memory, np.ascontiguousarray(words[:, :word_bytes])))
    memories = tuple(LoadedMemory(section.memory, *section.words.shape) for section in sections)
    header = EnvironmentHeader(environment.environment.name, environment.image.depth_unit, memories)
    return replace(image, header=replace(image.header, room=header), attributes=tuple(sections))


def tiles_beyond_heap(image: SceneImage) -> dict[str, int]:
    """Tiles of each map whose words do not all lie in its heap: the device reads those as 0, and reports an error if a
    ray asks for one. None of a map without a heap.
    """
    words = {section.memory: section.words for section in image.attributes}
    counts = {}
    for name, modes in (("albedo", MODES), ("normals", MODES), ("planes", PLANE_MODES[:5])):
        descriptors, heap = words.get(f"{name}.descriptors"), words.get(f"{name}.heap")
        if descriptors is None or heap is None:
            continue
        low = descriptors[:, :2].astype(np.int64) @ np.array([1, 256])
        lengths = np.zeros(8, dtype=np.int64)
        lengths[: len(modes)] = [mode.words for mode in modes]
        length, pointer = lengths[low & 7], (low >> 3) & ((1 << POINTER_BITS) - 1)
        counts[name] = int(((length > 0) & (pointer + length > len(heap))).sum())
    return counts


def environment_use(header: ImageHeader, manifest: Manifest) -> dict[str, dict[str, float]]:
    """Bytes of memory that each of an image's maps takes, and how much less than the map as it comes; none without a
    room.
    """
    if header.room is None:
        return {}
    layout = layout_of(manifest)
    source = layout.width * layout.height * SOURCE_BYTES_PER_PIXEL
    of_map, planes = layout.map_memory_bytes, layout.plane_memory_bytes
    counts = {"albedo": of_map, "normals": of_map, "planes": planes}
    return {name: {"bytes": count, "source_bytes": source, "ratio": source / count} for name, count in counts.items()}
