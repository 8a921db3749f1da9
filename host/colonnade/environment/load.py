"""Loads an environment from the folder of a room.

| file | content |
|---|---|
| ``meta.json`` | ``fx fy cx cy`` in pixels, ``cam_to_world``; optionally ``width height albedo_encoding depth_step`` |
| ``albedo.png`` | reflectance, grey or colour; derived from the photo if it is missing |
| ``normal.png`` | n * 0.5 + 0.5 in view space; derived from depth if it is missing |
| ``depth.npy`` or ``depth.png`` | metres along z, or 16-bit grey in steps of ``depth_step`` metres; optional |
| `PHOTOS` | the camera's picture of the room, sRGB; optional |
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture, rotation_notes
from colonnade.common.input_files import is_folder
from colonnade.common.types import Floats
from colonnade.environment import files
from colonnade.environment.albedo import detect_encoding, linear_albedo
from colonnade.environment.camera import check_size, read_camera
from colonnade.environment.depth_estimation import DEFAULT_CAMERA_HEIGHT, depth_from_normals
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.derived_albedo import derived_albedo
from colonnade.environment.lights import RoomLights
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.environment.repair import holes_of, repair_depth, repair_normals

#: Default metres per step of a 16-bit depth picture, as in common depth cameras.
DEFAULT_DEPTH_STEP = 0.001
#: Least and largest metres per step.
DEPTH_STEPS = (1e-6, 1e3)
#: Largest width or height of a map, pixels, limited by the hardware's plane coefficients.
MAX_EDGE = 4096
#: Names of the photo.
PHOTOS = ("photo.png", "photo.jpg", "photo.jpeg", "photo.webp", "render.png")
_NEEDS = f"meta.json, albedo.png or a photo ({', '.join(PHOTOS)}), and normal.png or a depth map"


@dataclass(frozen=True)
class RoomFiles:
    """The files of a room's maps.

    Attributes:
        albedo: None: derived from the photo.
        normals: None: derived from depth.
        depth: None: estimated from the normals.
        photo: None: without a photo.
        depth_step: Metres of a step of a depth picture.
        albedo_encoding: ``linear`` or ``srgb``; None: detected.
    """

    albedo: Path | None
    normals: Path | None
    depth: Path | None
    photo: Path | None
    depth_step: float = DEFAULT_DEPTH_STEP
    albedo_encoding: str | None = None


def has_photo(folder: Path) -> bool:
    """Whether the room in a folder has a photo."""
    return files.find(folder, PHOTOS) is not None


def load_environment(path: Path, camera_height: float | None = None) -> Environment:
    """Load the room in the folder ``path``.

    Without a depth map, the depth is estimated from the normals and the floor, ``camera_height`` metres below the
    camera. The default is the height of the camera's pose, or 1.5 m if the pose is not above the floor.

    Raises:
        UserError: A file is missing, unreadable or inconsistent with the others.
    """
    folder = Path(path)
    if not is_folder(folder):
        raise UserError(f"there is no room {folder}: name a folder with {_NEEDS}")
    meta_file = folder / "meta.json"
    meta = files.read_object(meta_file)
    camera = read_camera(meta, meta_file)
    encoding = meta.get("albedo_encoding")
    if encoding not in (None, "linear", "srgb"):
        raise UserError(f"{meta_file}: albedo_encoding must be linear or srgb")
    maps = RoomFiles(
        files.find(folder, ("albedo.png",)),
        files.find(folder, ("normal.png",)),
        files.find(folder, ("depth.npy", "depth.png")),
        files.find(folder, PHOTOS),
        depth_step(meta, meta_file),
        encoding,
    )
    for missing, other in (("albedo.png", maps.albedo or maps.photo), ("normal.png", maps.normals or maps.depth)):
        if other is None:
            raise UserError(f"the room {folder} lacks {missing}: it needs {_NEEDS}")
    return load_maps(folder.name, camera, maps, (meta, meta_file), camera_height)


def load_maps(
    name: str,
    camera: EnvironmentCamera,
    maps: RoomFiles,
    sizes: tuple[dict[str, Any], Path],
    camera_height: float | None = None,
    lights: RoomLights | None = None,
) -> Environment:
    """Load a room's maps, and derive missing ones.

    Args:
        name: Of the room.
        camera: Of the maps.
        maps: Their files.
        sizes: An object that may hold the ``width`` and ``height`` of the maps, and the file that it is from.
        camera_height: See `load_environment`.
        lights: For a missing albedo, see `derived_albedo`.
    """
    first = maps.albedo or maps.photo
    assert first is not None
    samples = files.read_colour(maps.albedo) if maps.albedo else None
    photo = read_picture(maps.photo) if maps.photo else None
    height, width = (photo if samples is None else samples).shape[:2]  # type: ignore[union-attr]
    if max(width, height) > MAX_EDGE:
        raise UserError(f"{first} is {width}x{height} pixels: maps may have at most {MAX_EDGE} a side")
    check_size(sizes[0], (width, height), sizes[1], first)

    def same_size(array: NDArray[Any], file: Path) -> None:
        if array.shape[:2] != (height, width):
            raise UserError(
                f"{file} is {array.shape[1]}x{array.shape[0]} pixels, but {first.name} is {width}x{height}:"
                " all maps of a room must have the same size"
            )

    if photo is not None and maps.photo is not None:
        same_size(photo, maps.photo)
    notes = rotation_notes(maps.photo) if maps.photo else []
    albedo: Floats | None = None
    if samples is not None:
        encoding = maps.albedo_encoding
        if encoding is None:
            encoding, note = detect_encoding(samples, photo)
            notes.append(note)
        albedo = linear_albedo(samples, encoding)
    directions = camera.directions(width, height)
    normals: Floats | None = None
    if maps.normals is not None:
        coded = files.read_colour(maps.normals) * 2.0 - 1.0
        same_size(coded, maps.normals)
        normals, repaired = repair_normals(coded, directions, maps.normals)
        notes += repaired
    if maps.depth is not None:
        depth = _depth(maps.depth, maps.depth_step)
        same_size(depth, maps.depth)
        holes = holes_of(depth)
        depth, repaired = repair_depth(depth, maps.depth)
        notes += repaired
        if normals is None:
            found = normals_of_depth(depth, holes, camera)
            normals = found.normals
            notes.append(
                f"there is no normal.png: normals are those of the depth map, whose noise is {found.noise:.2%}"
            )
    else:
        assert normals is not None
        if camera_height is None:
            camera_height = float(camera.to_world[1, 3])
            camera_height = camera_height if camera_height > 0 else DEFAULT_CAMERA_HEIGHT
        depth, note = depth_from_normals(normals, camera, camera_height)
        notes.append(note)
    colours = np.zeros((height, width, 3)) if albedo is None else albedo
    room = Environment(name, colours, normals, depth, maps.depth is not None, camera, photo, tuple(notes))
    if albedo is None:
        room = replace(room, albedo=derived_albedo(room, lights), notes=(*notes, _ALBEDO_NOTE), has_albedo=False)
    return room


_ALBEDO_NOTE = "there is no albedo.png: the albedo is the photo divided by the light that was fitted to it"


def depth_step(data: dict[str, Any], file: Path) -> float:
    """The metres per step of depth pictures that a file tells.

    Raises:
        UserError: It is no number, or out of range.
    """
    step = data.get("depth_step", DEFAULT_DEPTH_STEP)
    low, high = DEPTH_STEPS
    if isinstance(step, bool) or not isinstance(step, int | float) or not low <= step <= high:
        raise UserError(f"{file}: depth_step must be the metres per step of depth pictures, {low:g} to {high:g}")
    return float(step)


def _depth(file: Path, step: float) -> NDArray[np.float64]:
    """Read the depth map before repair, metres: float64 [height, width]."""
    return files.read_array(file) if file.suffix == ".npy" else files.read_grey(file, step)
