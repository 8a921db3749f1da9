"""The rooms of the page: their maps and light, and the view file of each design and size of a frame."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bundle import base64_text
from colonnade.design.manifest import Manifest
from colonnade.environment.light_cube import LightCube
from colonnade.environment.surround import Surround
from colonnade.maps.room_light import room_light
from colonnade.mesh.load import load_mesh
from colonnade.scene.model import Placement
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.room_lights import lights_of
from colonnade.scene.samples import samples_of_frame
from colonnade.scene.view import world_view
from colonnade.scene_image.environment import map_memories
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
#: Of designs that gather no light; others have lights that are fitted to the photo, and the light of the room.
SCENE = ROOT / "scenes" / "room.toml"
#: Where the object stands in each room.
PLACEMENTS = {
    "living": Placement(stand_at=(322, 306), size=0.58),
    "office": Placement(stand_at=(430, 238), size=0.8),
}
#: Sizes of frames, in the order of the sizes of a pixel.
SIZES = {1: (640, 480), 2: (320, 240), 4: (160, 120)}
MESH = "cube"
#: Passes of a frame without gathered light and with it (site/view.js); lights of a room with points of their discs.
PASSES, LIGHTS = (4, 64), 2


def room_data(name: str, manifests: Mapping[str, Manifest]) -> dict[str, Any]:
    """A room with a cube in it for each design that has maps. In the page other meshes stand on the cube's floor.

    Raises:
        ValueError: The designs do not have the same maps.
    """
    manifests = {design: one for design, one in manifests.items() if one.attributes is not None}
    scene = load_scene(SCENE)
    background = replace(scene.background, room=ROOT / "scenes" / "rooms" / name)
    scene = replace(scene, background=background, placement=PLACEMENTS[name])
    gathered = exposed(replace(scene, names_light=False, paths=replace(scene.paths, gather=1)))
    views: dict[str, dict[str, str]] = {}
    maps: list[dict[str, Any]] | None = None
    for design, manifest in manifests.items():
        ready = DeviceScene.of(gathered, manifest, load_mesh(MESH), encoder="live")
        views[design] = {
            str(pixel): base64_text(ready.view_file(size, composited=True)) for pixel, size in SIZES.items()
        }
        own = [
            {"memory": part.memory, "bytes": part.words.shape[1], "words": base64_text(part.words.tobytes())}
            for part in ready.image.attributes
            if part.memory in map_memories(manifest)
        ]
        if maps is not None and own != maps:
            raise ValueError(f"the maps of {design} differ from the other designs'")
        maps = own
    assert ready.photo is not None
    photo = io.BytesIO()
    Image.fromarray(ready.photo).save(photo, "JPEG", quality=88, subsampling=0)
    found = {"views": views, "maps": maps, "headroom": ready.scene.headroom, "light": _light(ready)}
    return {"photo": base64_text(photo.getvalue()), **_poses(ready), **found}


def samples() -> dict[int, dict[str, Any]]:
    """By the number of passes of a frame: points of lights' discs in each, and its coverage by the number of lights."""
    return {
        count: {
            "discs": [[list(point) for point in sample.lights] for sample in samples_of_frame(count, LIGHTS)],
            "coverage": [[each.coverage for each in samples_of_frame(count, lights)] for lights in range(LIGHTS + 1)],
        }
        for count in PASSES
    }


def _light(ready: DeviceScene) -> dict[str, Any]:
    """The light around the object in a room: a cube in the axes of the world, and lamps, in the device's numbers."""
    scene, maps, unseen = ready.scene, ready.maps, ready.lit.unseen
    assert maps is not None and isinstance(unseen, Surround)
    lights = lights_of(ready.lit.placed)
    cube = room_light(maps.environment, maps.image, lights, ready.lit.placed.middle, True, unseen).cube
    lamps = [
        {
            "position": light.position.tolist(),
            "colour": (np.asarray(light.colour) * scene.headroom * scene.exposure).tolist(),
            "reach": light.falloff or 0,
            "radius": light.radius,
        }
        for light in lights.lights
    ]
    return {
        "cube": base64_text(LightCube(cube.texels * scene.exposure).words().tobytes()),
        "exposure": scene.exposure,
        "lamps": lamps,
    }


def _poses(ready: DeviceScene) -> dict[str, Any]:
    """Camera and object in the world, metres; the camera's fx, cx, cy and fy are in heights of the frame."""
    width, height = SIZES[1]
    placed = world_view(ready.lit.placed, width, height)
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
        "width": width,
        "height": height,
    }
