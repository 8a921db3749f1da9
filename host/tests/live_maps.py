"""A room's maps by the encoder of a moving camera: in less than a second, where the offline encoder needs 20."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.maps.encoded import EncodedEnvironment, layout_of
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import encode_still
from colonnade.maps.slic import encode_slic

#: A design with maps of 96 by 72 pixels.
SMALL_MAPS = tuple(
    f"physicalAttributeMemory.{size}" for size in "width=96 height=72 mapBytes=4096 planeBytes=4096".split()
)


_MADE: dict[tuple[Path, AttributeLayout], EncodedEnvironment] = {}


def live_maps(room: Path, manifest: Manifest) -> EncodedEnvironment:
    """The maps of the room in a folder, made once; in a design with SLIC maps only the planes are the encoder's."""
    key = room, layout_of(manifest)
    if key not in _MADE:
        _MADE[key] = _made(room, manifest)
    return _MADE[key]


def _made(room: Path, manifest: Manifest) -> EncodedEnvironment:
    environment, layout = load_environment(room), layout_of(manifest)
    if layout.encoding == "twoLevel":
        return EncodedEnvironment.of(environment, manifest, "live")
    live = encode_still(environment, replace(layout, encoding="twoLevel"))
    superpixels = {
        "albedo": encode_slic(environment.albedo, live.albedo_space, layout).memories(),
        "normals": encode_slic(environment.normals, live.normal_space, layout).memories(),
    }
    image = AttributeImage.from_memories(layout, {**live.memories(), **superpixels}, live.depth_unit)
    return EncodedEnvironment(environment, image)
