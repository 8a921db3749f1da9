"""Adds textures to a scene image, as contents of the texture memory (docs/textures.md)."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from colonnade.common import cache
from colonnade.common.types import Floats
from colonnade.design.manifest import AttributeFormats, Manifest
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.maps.cache import encoder_sources
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import words_of
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import encode_colours
from colonnade.maps.two_level import TwoLevelMap
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace
from colonnade.scene_image.atlas import Atlas
from colonnade.scene_image.file import LoadSection, SceneImage
from colonnade.scene_image.header import LoadedMemory, TextureHeader

#: Rounds of the encoder, and the last of them, in which tiles share words: 1 to 2 dB. More of both gain 0.2 dB at most.
_ROUNDS, _SHARED_ROUNDS = 3, 1
#: File name in a cache entry.
_FILE = "atlas.npz"


def layout_of_texture(formats: AttributeFormats) -> AttributeLayout:
    """The layout of a design's texture memory."""
    sizes = formats.sizes
    return AttributeLayout(
        width=sizes["width"],
        height=sizes["height"],
        tile_size=1 << sizes["tileLog"],
        palette_size=sizes["paletteSize"],
        map_bytes=sizes["mapBytes"],
    )


def with_textures(
    image: SceneImage, atlas: Atlas | None, textures: int, manifest: Manifest, encoder: Encoder | None = None
) -> SceneImage:
    """Add an atlas to a mesh's image, or zeros without one; the image itself for a design without textures.

    Args:
        image: The image.
        atlas: The atlas of its mesh.
        textures: Number of its textures.
        manifest: The design's manifest.
        encoder: Of the atlas.
    """
    if manifest.texture is None:
        return image
    layout = layout_of_texture(manifest.texture)
    sections = []
    encode = _encoded if encoder == "offline" else encode_colours
    encoded = None if atlas is None else encode(atlas.colours, layout)
    for name, shape in manifest.memories.items():
        if not name.startswith("texture."):
            continue
        word_bytes = -(-int(shape["bits"]) // 8)
        words = np.zeros((int(shape["depth"]), word_bytes), dtype=np.uint8)
        if encoded is not None:
            words = np.ascontiguousarray(words_of(encoded.memories()[name.partition(".")[2]])[:, :word_bytes])
        sections.append(LoadSection(name, words))
    memories = tuple(LoadedMemory(section.memory, *section.words.shape) for section in sections)
    header = TextureHeader(
        textures,
        0.0 if atlas is None else atlas.scale,
        0 if atlas is None else atlas.source_bytes,
        memories,
    )
    return replace(image, header=replace(image.header, texture=header), attributes=(*image.attributes, *sections))


def _encoded(colours: Floats, layout: AttributeLayout) -> TwoLevelMap:
    """Encode an atlas, or take it from the project's cache."""
    digest = hashlib.sha256(encoder_sources())
    digest.update(repr((layout, _ROUNDS, _SHARED_ROUNDS)).encode() + np.ascontiguousarray(colours).tobytes())
    folder = cache_directory(project_root()) / "textures" / digest.hexdigest()[:32]
    with cache.entry(folder, "texture") as empty:
        if empty is not None:
            found = encode_two_level(colours, AlbedoSpace(layout.field_bits), layout, _ROUNDS, _SHARED_ROUNDS)
            with (empty / _FILE).open("wb") as stream:
                np.savez(stream, descriptors=found.descriptors, palette=found.palette, heap=found.heap)
    with np.load(folder / _FILE) as stored:
        return TwoLevelMap(stored["descriptors"], stored["palette"], stored["heap"])
