"""The model backend: renders the hardware's frame bit by bit, without its timing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest, field_places
from colonnade.scene_image.file import SceneImage

#: Rows rendered between two reports of progress.
BAND_ROWS = 16


def new_model(manifest: Manifest) -> Any:
    """A ``colonnade._core.Model`` of the manifest's design with empty memories."""
    from colonnade import _core

    config = manifest.config
    numbers = {
        **manifest.numbers,
        "stackDepth": config["columnBvhMemory"]["stackDepth"],
        "bvh": int(config["geometry"]["bvh"]),
    }
    limits = {name: register.limit for name, register in manifest.registers.items() if register.limit is not None}
    return _core.Model(numbers, field_places(manifest.layouts), limits)


def load_scene(model: Any, image: SceneImage) -> None:
    """Load a scene image's records into the model's column memory."""
    model.load(image.records)


def load_environment(model: Any, image: SceneImage, manifest: Manifest) -> None:
    """Add a physical-attribute memory to the model and load the room of a scene image into it."""
    assert manifest.attributes is not None
    model.add_environment(dict(manifest.attributes.sizes), field_places(manifest.attributes.layouts))
    for section in image.attributes:
        if not section.memory.startswith(("texture.", "light.")):
            model.load_environment(section.memory, section.words)


def load_textures(model: Any, image: SceneImage, manifest: Manifest) -> None:
    """Add a texture memory to the model and load the atlas of a scene image into it."""
    assert manifest.texture is not None
    model.add_texture(dict(manifest.texture.sizes), field_places(manifest.texture.layouts))
    for section in image.attributes:
        if section.memory.startswith("texture."):
            model.load_texture(section.memory, section.words)


def render_model(
    manifest: Manifest,
    image: SceneImage,
    registers: Mapping[str, int],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Frame:
    """Render one frame: `loaded_model`, then `model_frame`."""
    return model_frame(loaded_model(manifest, image), registers, progress)


def loaded_model(manifest: Manifest, image: SceneImage) -> Any:
    """A model whose memories hold a scene image."""
    model = new_model(manifest)
    load_scene(model, image)
    if image.header.room is not None:
        load_environment(model, image, manifest)
    if manifest.texture is not None:
        load_textures(model, image, manifest)
    for section in image.attributes:
        if section.memory == "light.cube":
            model.load_cube(section.words)
    return model


def model_frame(
    model: Any,
    registers: Mapping[str, int],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Frame:
    """Render a frame with a loaded model, which can render any number of frames.

    Args:
        model: From `loaded_model`.
        registers: All rw registers by name.
        progress: Called with the number of finished rows and of all rows.
    """
    model.start(dict(registers))
    height = registers["frame.height"]
    bands = []
    for first in range(0, height, BAND_ROWS):
        bands.append(model.rows(first, min(first + BAND_ROWS, height)))
        progress(min(first + BAND_ROWS, height), height)
    pixels = {key: np.concatenate([band[key] for band in bands]) for key in bands[0]}
    return Frame(
        colour=pixels["colour"],
        is_object=pixels["is_object"],
        triangle=pixels["triangle"],
        instance=pixels["instance"],
        distance=pixels["distance"],
        counters=model.counters(),
        errors=[name for name, is_set in model.errors().items() if is_set],
        ratio=pixels["ratio"] if registers.get("environment.enabled", 0) else None,
    )
