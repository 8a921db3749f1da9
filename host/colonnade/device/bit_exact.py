"""The bit-exact model as a backend: the frame the hardware renders, without its timing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest, RecordLayout
from colonnade.scene_image.file import SceneImage

ROWS_AT_ONCE = 16


def new_model(manifest: Manifest) -> Any:
    """A ``colonnade._core.Model`` of the manifest's design, with empty memories."""
    from colonnade import _core

    config = manifest.config
    numbers = {
        **manifest.numbers,
        "arity": config["geometry"]["arity"],
        "trianglesPerRecord": config["geometry"]["trianglesPerRecord"],
        "stackDepth": config["columnBvhMemory"]["stackDepth"],
        "bvh": int(config["geometry"]["bvh"]),
    }
    limits = {name: register.limit for name, register in manifest.registers.items() if register.limit is not None}
    return _core.Model(numbers, field_places(manifest.layouts), limits)


def field_places(layouts: Mapping[str, RecordLayout]) -> dict[str, dict[str, tuple[int, int, bool]]]:
    """Where the fields of words lie: offset, width, signed; by kind of word and name."""
    return {
        name: {field.name: (field.offset, field.width, field.signed) for field in layout.fields.values()}
        for name, layout in layouts.items()
    }


def load_scene(model: Any, image: SceneImage) -> None:
    """Fills the model's column memory."""
    model.load(image.records)


def load_environment(model: Any, image: SceneImage, manifest: Manifest) -> None:
    """Gives the model a physical-attribute memory and fills it with the image's room."""
    assert manifest.attributes is not None
    model.add_environment(dict(manifest.attributes.sizes), field_places(manifest.attributes.layouts))
    for section in image.attributes:
        model.load_environment(section.memory, section.words)


def render_model(
    manifest: Manifest,
    image: SceneImage,
    registers: Mapping[str, int],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Frame:
    """Renders one frame; see `loaded_model` and `model_frame`."""
    return model_frame(loaded_model(manifest, image), registers, progress)


def loaded_model(manifest: Manifest, image: SceneImage) -> Any:
    """A model with a scene image in its memories."""
    model = new_model(manifest)
    load_scene(model, image)
    if image.attributes:
        load_environment(model, image, manifest)
    return model


def model_frame(
    model: Any,
    registers: Mapping[str, int],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Frame:
    """A frame of what a model has loaded; any number may follow each other.

    Args:
        model: Of `loaded_model`.
        registers: Every rw register by name (``placement.placement``).
        progress: Called with (rows done, rows in all).
    """
    model.start(dict(registers))
    height = registers["frame.height"]
    bands = []
    for first in range(0, height, ROWS_AT_ONCE):
        bands.append(model.rows(first, min(first + ROWS_AT_ONCE, height)))
        progress(min(first + ROWS_AT_ONCE, height), height)
    pixels = {key: np.concatenate([band[key] for band in bands]) for key in bands[0]}
    return Frame(
        colour=pixels["colour"],
        is_object=pixels["is_object"],
        triangle=pixels["triangle"],
        distance=pixels["distance"],
        counters=model.counters(),
        errors=[name for name, is_set in model.errors().items() if is_set],
        ratio=pixels["ratio"] if registers.get("room.isThere", 0) else None,
    )
