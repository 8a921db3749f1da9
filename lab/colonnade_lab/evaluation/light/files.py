"""The files of a known room: what is stored in the repository, and the folder and scenes that are made of it.

Stored in ``scenes/light/NAME`` are pictures of the path tracer: ``photo.webp`` and ``FRAME.webp``, sRGB without loss,
and panoramas, ``panorama.hdr`` and, without the emitters, ``around.hdr``. Maps and objects are made.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.atomic_files import replacing
from colonnade.common.image_io import encode_srgb, read_picture
from colonnade.common.temporary import temporary_folder
from colonnade.common.types import Floats
from colonnade.design.toolchain import project_root
from colonnade.environment.model import Environment
from colonnade.environment.panorama_file import read_radiance
from colonnade.mesh.files.glb import Glb
from colonnade.mesh.load import load_mesh
from colonnade.scene.model import Transform
from numpy.typing import NDArray

from colonnade_lab.evaluation.light.rooms import GLASSES, METALS, KnownRoom, PointLight, Thing
from colonnade_lab.evaluation.light.surfaces import pose_of
from colonnade_lab.evaluation.studies.synthetic_attic import write_room


def stored(name: str) -> Path:
    """The folder of a room's stored pictures."""
    return project_root() / "scenes" / "light" / name


def truth(name: str, frame: str) -> NDArray[np.uint8]:
    """The path tracer's picture of a frame, sRGB, uint8 [height, width, 3].

    Raises:
        UserError: It is not stored.
    """
    return read_picture(stored(name) / f"{frame}.webp")


def write_panorama(path: Path, radiance: Floats) -> None:
    """Write linear radiance, float64 [height, width, 3], as Radiance HDR."""
    import OpenImageIO

    height, width = radiance.shape[:2]
    with temporary_folder() as folder:
        file = folder / path.name
        output = OpenImageIO.ImageOutput.create(str(file))
        assert output is not None
        output.open(str(file), OpenImageIO.ImageSpec(width, height, 3, "float"))
        output.write_image(np.ascontiguousarray(radiance, dtype=np.float32))
        output.close()
        with replacing(path) as stream:
            stream.write(file.read_bytes())


#: The scenes of a frame: what is known of the light, and the gathered rays of a path, as `columns.Column` says.
LIGHTS = ("lights-0", "panorama-1", "panorama-2", "around-1", "photo-0", "photo-1")
#: Of a user's room.
USERS_LIGHTS = (
    *("around-1", "exposed-1", "panorama-1", "around-1-maps", "panorama-1-maps"),
    *("photo-1", "photo-1-maps", "lights-1"),
)
#: Scenes that leave the gathered rays to the command, by what is known.
DEFAULT_LIGHTS = {"panorama": "around-default", "photo alone": "photo-default"}


def write_scenes(
    folder: Path, name: str, room: KnownRoom, light: str, environment: Environment, lights: Sequence[PointLight]
) -> dict[str, Path]:
    """Write a room's folder, its objects as glTF files, and a scene for each frame; returns the scenes.

    ``light`` is one of `LIGHTS`, `USERS_LIGHTS` or `DEFAULT_LIGHTS`; ``lights`` are the room's, as the objects see
    them. The folder of a user's room has neither albedo nor normals, unless ``light`` names maps.
    """
    known, gather, *maps = light.split("-")
    write_room(folder / name, environment)
    if room.is_users and not maps:
        for derived in ("albedo.png", "normal.png"):
            (folder / name / derived).unlink()
    scenes = {}
    for frame, things in room.frames.items():
        lines = []
        for index, thing in enumerate(things):
            file = f"{name}-{frame}{index}.glb"
            write_glb(folder / file, thing)
            lines += ["[[object]]", f'mesh = {{path = "{file}"}}', f"transform = {transform_table(pose_of(thing))}", ""]
        if known in ("lights", "panorama"):
            lines += _lights(name, lights)
        lines += ["[background]", f'room = "{name}"', *([] if room.is_users else ['shadows = "photo"'])]
        if known in ("panorama", "exposed", "around"):
            panorama = stored(name) / ("around.hdr" if known == "panorama" else "panorama.hdr")
            lines += [f"panorama = {json.dumps(str(panorama))}"]
            lines += [] if room.is_users and known == "around" else ["panorama_exposure = 1.0"]
        width, height = room.frame
        lines += [] if gather == "default" else ["", "[paths]", f"gather = {gather}"]
        lines += ["", "[frame]", f"width = {width}", f"height = {height}"]
        scenes[frame] = folder / f"{name}-{frame}.toml"
        scenes[frame].write_text("\n".join(lines) + "\n", encoding="utf-8")
    return scenes


def _lights(name: str, lights: Sequence[PointLight]) -> list[str]:
    """The emitters as point lights, as bright at the objects, and the mean of all other light."""
    lines = []
    for position, colour, radius in lights:
        lines += ["[[light]]", f"position = {_row(position)}", f"colour = {_row(colour.clip(max=15.0))}"]
        lines += ["falloff = 1.0", f"radius = {radius:.4f}", ""]
    around = read_radiance(stored(name) / "around.hdr")
    weights = np.sin((np.arange(len(around)) + 0.5) / len(around) * np.pi)
    ambient = (around.mean(axis=1) * weights[:, None]).sum(axis=0) / weights.sum()
    return [*lines, "[ambient]", f"colour = {_row(ambient)}", ""]


def transform_table(pose: Transform) -> str:
    """The table of a transform in a scene."""
    return f"{{rotate = {_row(pose.rotate)}, scale = {pose.scale:.8f}, translate = {_row(pose.translate)}}}"


def _row(values: Sequence[float] | Floats) -> str:
    return "[" + ", ".join(f"{value:.6f}" for value in values) + "]"


def write_glb(path: Path, thing: Thing) -> None:
    """Write the mesh of an object as binary glTF, with its metallic-roughness material."""
    mesh = load_mesh(thing.mesh)
    corners = (mesh.vertices[mesh.faces].reshape(-1, 3), mesh.corner_normals.reshape(-1, 3))
    material: dict[str, Any] = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*thing.colour, 1.0],
            "metallicFactor": float(thing.kind in METALS),
            "roughnessFactor": thing.roughness,
        }
    }
    used = ["KHR_materials_transmission", "KHR_materials_ior"] if thing.kind in GLASSES else []
    if used:
        material["extensions"] = {used[0]: {"transmissionFactor": 1.0}, used[1]: {"ior": 1.5}}
    glb = Glb()
    attributes = dict(zip(("POSITION", "NORMAL"), map(glb.accessor, corners), strict=True))
    document = {
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "material": 0}]}],
        "materials": [material],
        "extensionsUsed": used,
    }
    with replacing(path) as stream:
        stream.write(glb.content(document))


def store(name: str, result: Path) -> None:
    """Store what ``tools/path_tracer/room.py`` has made of a room."""
    from PIL import Image

    folder, made = stored(name), np.load(result)
    folder.mkdir(parents=True, exist_ok=True)
    for what in made.files:
        light = made[what].astype(np.float64)
        if what in ("panorama", "around"):
            write_panorama(folder / f"{what}.hdr", light)
        else:
            with replacing(folder / f"{what}.webp") as stream:
                Image.fromarray(encode_srgb(light)).save(stream, "WEBP", lossless=True, quality=100, method=6)
