"""Loads an environment from the folder of a room.

| file | content |
|---|---|
| ``meta.json`` | ``fx fy cx cy`` in pixels, ``cam_to_world``; optionally ``width height albedo_encoding depth_step`` |
| ``albedo.png`` | reflectance, grey or colour |
| ``normal.png`` | n * 0.5 + 0.5 in camera space: x right, y up, z towards the viewer |
| ``depth.npy`` or ``depth.png`` | metres along z, or 16-bit grey in steps of ``depth_step`` metres; optional |
| ``photo.png`` or ``render.png`` | the camera's picture of the room, sRGB; optional |
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.image_io import read_picture
from colonnade.common.input_files import exists, is_folder
from colonnade.environment import files
from colonnade.environment.albedo import detect_encoding, linear_albedo
from colonnade.environment.camera import check_size, read_camera
from colonnade.environment.depth_estimation import DEFAULT_CAMERA_HEIGHT, depth_from_normals
from colonnade.environment.model import Environment
from colonnade.environment.repair import repair_depth, repair_normals

#: Default metres per step of a 16-bit depth picture, as in common depth cameras.
DEFAULT_DEPTH_STEP = 0.001
#: Largest metres per step.
MAX_DEPTH_STEP = 1e3
#: Largest width or height of a map, pixels, limited by the hardware's plane coefficients.
MAX_EDGE = 4096


def load_environment(path: Path, camera_height: float | None = None) -> Environment:
    """Load the room in the folder ``path``.

    Without a depth map, the depth is estimated from the normals and the floor, ``camera_height`` metres below the
    camera. The default is the height of the camera's pose, or 1.5 m if the pose is not above the floor.

    Raises:
        UserError: A file is missing, unreadable or inconsistent with the others.
    """
    folder = Path(path)
    if not is_folder(folder):
        raise UserError(f"there is no room {folder}: name a folder with meta.json, albedo.png and normal.png")
    meta_file = folder / "meta.json"
    meta = files.read_object(meta_file)
    camera = read_camera(meta, meta_file)
    albedo_file, normal_file = _needed(folder, "albedo.png"), _needed(folder, "normal.png")
    depth_file = files.find(folder, ("depth.npy", "depth.png"))
    photo_file = files.find(folder, ("photo.png", "render.png"))

    samples = files.read_colour(albedo_file)
    height, width = samples.shape[:2]
    if max(width, height) > MAX_EDGE:
        raise UserError(f"{albedo_file} is {width}x{height} pixels: maps may have at most {MAX_EDGE} a side")
    check_size(meta, (width, height), meta_file, albedo_file)

    def same_size(array: NDArray[Any], file: Path) -> None:
        if array.shape[:2] != (height, width):
            raise UserError(
                f"{file} is {array.shape[1]}x{array.shape[0]} pixels, but {albedo_file.name} is {width}x{height}:"
                " all maps of a room must have the same size"
            )

    coded = files.read_colour(normal_file) * 2.0 - 1.0
    same_size(coded, normal_file)
    photo = read_picture(photo_file) if photo_file else None
    if photo is not None and photo_file is not None:
        same_size(photo, photo_file)

    notes: list[str] = []
    encoding = meta.get("albedo_encoding")
    if encoding is None:
        encoding, note = detect_encoding(samples, photo)
        notes.append(note)
    elif encoding not in ("linear", "srgb"):
        raise UserError(f"{meta_file}: albedo_encoding must be linear or srgb")
    directions = camera.directions(width, height)
    normals, repaired = repair_normals(coded * np.array([1.0, -1.0, -1.0]), directions, normal_file)
    notes += repaired
    if depth_file is not None:
        depth = _depth(depth_file, meta, meta_file)
        same_size(depth, depth_file)
        depth, repaired = repair_depth(depth, depth_file)
        notes += repaired
    else:
        if camera_height is None:
            camera_height = float(camera.to_world[1, 3])
            camera_height = camera_height if camera_height > 0 else DEFAULT_CAMERA_HEIGHT
        depth, note = depth_from_normals(normals, camera, camera_height)
        notes.append(note)
    albedo = linear_albedo(samples, encoding)
    return Environment(folder.name, albedo, normals, depth, depth_file is not None, camera, photo, tuple(notes))


def _needed(folder: Path, name: str) -> Path:
    file = folder / name
    if not exists(file):
        raise UserError(f"the room {folder} lacks {name}: it needs meta.json, albedo.png and normal.png")
    return file


def _depth(file: Path, meta: dict[str, Any], meta_file: Path) -> NDArray[np.float64]:
    """Read the depth map before repair, metres: float64 [height, width]."""
    if file.suffix == ".npy":
        return files.read_array(file)
    step = meta.get("depth_step", DEFAULT_DEPTH_STEP)
    if isinstance(step, bool) or not isinstance(step, int | float) or not 0 < step <= MAX_DEPTH_STEP:
        raise UserError(f"{meta_file}: depth_step must be the metres per step of {file.name}")
    return files.read_grey(file) * float(step)
