"""The rooms of the page: their maps, and the view file of each design and size of a frame."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bundle import base64_text
from colonnade.design.manifest import Manifest
from colonnade.device.scene import DeviceScene
from colonnade.mesh.load import load_mesh
from colonnade.scene.model import Placement, Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.view import place
from colonnade.scene_image.environment import map_memories
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "scenes" / "room.toml"
#: Where the object stands in each room.
PLACEMENTS = {
    "living": Placement(stand_at=(322, 306), size=0.58),
    "office": Placement(stand_at=(430, 238), size=0.8),
}
#: Sizes of frames, in the order of the sizes of a pixel.
SIZES = {1: (640, 480), 2: (320, 240), 4: (160, 120)}
MESH = "cube"


def room_data(name: str, manifests: Mapping[str, Manifest]) -> dict[str, Any]:
    """A room with a cube in it for each design that has maps. In the page other meshes stand on the cube's floor.

    Raises:
        ValueError: The designs do not have the same maps.
    """
    scene = load_scene(SCENE)
    background = replace(scene.background, room=ROOT / "scenes" / "rooms" / name)
    scene = replace(scene, background=background, placement=PLACEMENTS[name])
    views: dict[str, dict[str, str]] = {}
    maps: list[dict[str, Any]] | None = None
    for design, manifest in manifests.items():
        if manifest.attributes is None:
            continue
        ready = DeviceScene.of(scene, manifest, load_mesh(MESH), encoder="live")
        views[design] = {str(pixel): base64_text(ready.view_file(size)) for pixel, size in SIZES.items()}
        own = [
            {"memory": part.memory, "bytes": part.words.shape[1], "words": base64_text(part.words.tobytes())}
            for part in ready.image.attributes
            if part.memory in map_memories(manifest)
        ]
        if maps is not None and own != maps:
            raise ValueError(f"the maps of {design} are not those of the other designs")
        maps = own
    assert ready.photo is not None
    photo = io.BytesIO()
    Image.fromarray(ready.photo).save(photo, "JPEG", quality=88)
    return {"views": views, "maps": maps, "photo": base64_text(photo.getvalue()), **_poses(ready)}


def _poses(ready: DeviceScene) -> dict[str, Any]:
    """Camera and object in the world, metres; the camera's fx, cx, cy and fy are in heights of the frame."""
    scene: Scene = ready.scene
    width, height = SIZES[1]
    placed = place(scene, ready.image.header.extent, width, height, ready.environment)
    right, up, toward = placed.camera.axes
    assert ready.environment is not None
    room = ready.environment
    return {
        "camera": {
            "position": placed.camera.position.tolist(),
            "right": right.tolist(),
            "down": (-up).tolist(),
            "forward": (-toward).tolist(),
            "lens": [value / room.height for value in (room.fx, room.cx, room.cy, room.fy)],
        },
        "object": {
            "position": placed.pose.translate.tolist(),
            "scale": placed.pose.scale,
        },
        "headroom": scene.headroom,
        "width": width,
        "height": height,
    }
