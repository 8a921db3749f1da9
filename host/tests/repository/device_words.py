"""Prints a digest of each kind of words that the host computes in floats, for test_processors.

`python device_words.py`: small inputs. `python device_words.py ROOM …`: the maps of whole rooms, at their full size.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from conftest import manifest_data

from colonnade.design.manifest import Manifest
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.light_fit import fit_lights
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.maps.image import encode_environment, memory_words
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.packer import pack

ROOMS = Path(__file__).parents[3] / "scenes" / "rooms"
#: Every so many pixels of a room are left in small inputs.
STEP = 5
MESHES = ("teapot:4", "torus:12", "cylinder:20")


def small_room(name: str) -> Environment:
    """A room with every fifth pixel."""
    room = load_environment(ROOMS / name)
    camera = room.camera
    lens = {name: getattr(camera, name) / STEP for name in ("fx", "fy", "cx", "cy")}
    grid = np.s_[::STEP, ::STEP]
    maps = {name: np.ascontiguousarray(getattr(room, name)[grid]) for name in ("albedo", "normals", "depth", "photo")}
    return replace(room, camera=replace(camera, **lens), **maps)


def maps_of(room: Environment, **sizes: int) -> Iterator[tuple[str, bytes]]:
    """The words of a room's memories."""
    layout = AttributeLayout(width=room.width, height=room.height, **sizes)
    for name, words in memory_words(encode_environment(room, layout)):
        yield f"{room.name} {name}", words.tobytes()


def lights_of(room: Environment) -> Iterator[tuple[str, bytes]]:
    """The lights that fit a room's photo."""
    yield f"{room.name} lights", repr(fit_lights(room).lights).encode()


def small_inputs() -> Iterator[tuple[str, bytes]]:
    """The words of small inputs."""
    room = small_room("office")
    yield from maps_of(room, map_bytes=3000, palette_size=64, plane_bytes=1600, planes=64)
    yield from lights_of(room)
    found = normals_of_depth(room.depth, np.zeros(room.depth.shape, bool), room.camera)
    yield f"{room.name} normals of depth", found.normals.tobytes()
    texture = room.photo[:64, :64] / 255.0 if room.photo is not None else np.zeros((64, 64, 3))
    layout = AttributeLayout(width=64, height=64, tile_size=16, palette_size=64, map_bytes=1200)
    for name, words in encode_two_level(texture, AlbedoSpace(layout.field_bits), layout).memories().items():
        yield f"texture {name}", words.tobytes()
    manifest = Manifest.from_dict(manifest_data())
    for name in MESHES:
        mesh = load_mesh(name)
        yield f"{name} records", pack(mesh, manifest, mesh.materials).records.tobytes()


def main() -> None:
    """Print a line for each name: digest and name."""
    rooms = [load_environment(Path(name)) for name in sys.argv[1:]]
    named = (
        [item for room in rooms for part in (maps_of, lights_of) for item in part(room)] if rooms else small_inputs()
    )
    for name, words in named:
        print(hashlib.sha256(words).hexdigest()[:16], name, flush=True)


if __name__ == "__main__":
    main()
