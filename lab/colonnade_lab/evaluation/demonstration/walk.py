"""A camera that moves by ± 0.3 m and turns by ± 10° before an object: a sequence with exact maps and soft light.

The room is the synthetic attic. Its photos have the light of a small lamp and of the surroundings, which near surfaces
hide, and several samples a pixel at edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from colonnade.common.atomic_files import replacing
from colonnade.common.image_io import encode_srgb, write_png
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.model import Environment, EnvironmentCamera

from colonnade_lab.common.parallel import processors
from colonnade_lab.evaluation.studies.synthetic_attic import (
    AMBIENT,
    DEPTH_STEP,
    LAMP,
    LAMP_COLOUR,
    RoomModel,
    SeenPoints,
    attic_parts,
    camera_at,
)

#: Frames of the loop, frames a second.
FRAMES, RATE = 120, 30
#: The camera's way to each side, metres; it turns by ± 10° to keep the target in the middle.
METRES = 0.3
#: The camera in the middle of its way, what it looks at, and where the object stands: on the floor.
EYE, TARGET, STAND = np.array([0.63, 0.84, 1.66]), np.array([0.33, 0.27, 0.1]), np.array([0.36, 0.0, 0.33])
#: Focal length in picture widths.
FOCAL = 0.76
#: Radius of the lamp, and distance from which surroundings do not hide light, metres.
_BULB, _REACH = 0.05, 0.8
#: Points of the lamp, directions of the surroundings, samples of a pixel at an edge (its square root).
_LAMPS, _DIRECTIONS, _SAMPLES = 6, 12, 2
#: Pixels are at an edge where neighbours differ by so much: depth, as a share; normals; light of the picture.
_DEPTH_EDGE, _NORMAL_EDGE, _LIGHT_EDGE = 0.02, 0.1, 0.04


#: The light that the surroundings keep on average, for the object.
_OPEN = 0.8
#: Edge of the object's cube, metres.
OBJECT = 0.6


def walk_scene(width: int, height: int) -> str:
    """The scene file of a mirror teapot on the floor, by the light of the photos; size of the maps, pixels."""
    camera = camera_of(0.0, width, height)
    place = (STAND - camera.to_world[:, 3]) @ camera.to_world[:, :3]
    x, y = place[:2] / place[2] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    return f"""# A mirror teapot on the floor of the attic.
mesh.name = "teapot"
material = {{kind = "mirror", albedo = [0.95, 0.94, 0.92]}}
object = {{stand_at = [{x:.2f}, {y:.2f}], size = {OBJECT}, turn = 30.0}}
background.room = "room"
light = {{position = {LAMP.tolist()}, colour = {LAMP_COLOUR.tolist()}, falloff = 1.0}}
ambient.colour = {(_OPEN * AMBIENT).round(4).tolist()}
"""


def camera_of(share: float, width: int, height: int) -> EnvironmentCamera:
    """The camera at a share of its loop."""
    angle = 2 * np.pi * share
    right = unit_vectors(np.cross(TARGET - EYE, [0.0, 1.0, 0.0])[None])[0]
    forward = unit_vectors((TARGET - EYE)[None])[0]
    eye = EYE + METRES * np.sin(angle) * right + 0.3 * METRES * np.sin(2 * angle) * np.array([0.0, 1.0, 0.0])
    return camera_at(eye + 0.4 * METRES * (np.cos(angle) - 1.0) * forward, TARGET, width, height, FOCAL)


def attic_view(model: RoomModel, camera: EnvironmentCamera, width: int, height: int) -> Environment:
    """The attic's maps and photo from a camera."""
    exact = model.seen_by(camera, width, height)
    photo = encode_srgb(_photo(model, exact))
    return Environment(exact.name, exact.albedo, exact.normals, exact.depth, True, camera, photo)


def _photo(model: RoomModel, maps: Environment) -> Floats:
    """The linear photo: samples at the centres of pixels, and more of them at edges."""
    v, u = np.mgrid[0 : maps.height, 0 : maps.width]
    photo = _colours(model, maps.camera, u.ravel() + 0.5, v.ravel() + 0.5).reshape(maps.height, maps.width, 3)
    edge = np.zeros((maps.height, maps.width), dtype=bool)
    for values, limit in (
        (np.log(maps.depth)[..., None], _DEPTH_EDGE),
        (maps.normals, _NORMAL_EDGE),
        (photo, _LIGHT_EDGE),
    ):
        for axis in (0, 1):
            differs = (np.abs(np.diff(values, axis=axis)) > limit).any(axis=2)
            ends = ((0, 1), (0, 0)) if axis == 0 else ((0, 0), (0, 1))
            edge |= np.pad(differs, ends) | np.pad(differs, tuple(pair[::-1] for pair in ends))
    rows, columns = np.nonzero(edge)
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    sums = sum(_colours(model, maps.camera, columns + x, rows + y) for x in steps for y in steps)
    photo[rows, columns] = sums / _SAMPLES**2
    return photo


def _colours(model: RoomModel, camera: EnvironmentCamera, u: Floats, v: Floats) -> Floats:
    """Linear colours of points of the picture, float64 [n, 3]."""
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))], axis=1)
    directions = rays @ camera.to_world[:, :3].T
    seen = model.look(np.broadcast_to(camera.to_world[:, 3], directions.shape), directions)
    lamp = sum(model.lamp_light(seen, LAMP + _BULB * offset) for offset in _sphere(_LAMPS)) / _LAMPS
    return np.asarray(seen.albedo * (AMBIENT * _openness(model, seen)[:, None] + lamp))


def _openness(model: RoomModel, seen: SeenPoints) -> Floats:
    """The share of the surroundings that reaches a point, float64 [n]."""
    start, open_to = seen.position + 1e-3 * seen.normals, np.zeros(len(seen.t))
    for direction in _sphere(_DIRECTIONS):
        # A normal plus the points of a sphere: directions by their cosine
        open_to += ~model.tracer.occluded(start, _REACH * unit_vectors(seen.normals + 0.999 * direction))
    return 0.3 + 0.7 * open_to / _DIRECTIONS


def _sphere(count: int) -> Floats:
    """Points of the unit sphere, spread evenly: float64 [count, 3]."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    side = np.sqrt(1 - height**2)
    return np.stack([side * np.cos(angle), height, side * np.sin(angle)], axis=1)


def write_walk(folder: Path, size: tuple[int, int], frames: int = FRAMES, progress: Progress = QUIET) -> Path:
    """Write the sequence of the loop, and return its file."""
    return write_sequence(folder, size, [camera_of(number / frames, *size) for number in range(frames)], progress)


def write_sequence(
    folder: Path, size: tuple[int, int], cameras: Sequence[EnvironmentCamera], progress: Progress = QUIET
) -> Path:
    """Write the sequence of cameras in the attic, and return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    one = partial(_write_frame, folder, size)
    with progress.step(f"rendering {len(cameras)} photos and depth maps of the attic") as report:
        for done, _ in enumerate(_mapped(one, enumerate(cameras)), 1):
            report(done / len(cameras))
    lines = [
        f"width = {size[0]}",
        f"height = {size[1]}",
        f"rate = {RATE}",
        f"depth_step = {DEPTH_STEP}",
        "depth_noise = 0.0",
    ]
    for number, camera in enumerate(cameras):
        lines += ["", "[[frame]]", f"time = {number / RATE}"]
        lines += [f'{key} = "{number:04d}{suffix}"' for key, suffix in _FILES.items()]
        lines += [f"{key} = {getattr(camera, key)}" for key in ("fx", "fy", "cx", "cy")]
        lines += [f"cam_to_world = {camera.to_world.tolist()}"]
    with replacing(folder / "sequence.toml") as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    return folder / "sequence.toml"


_FILES = {"photo": ".png", "depth": ".depth.png", "albedo": ".albedo.png", "normal": ".normal.png"}


def _mapped(function: partial[None], numbered: Iterable[tuple[int, EnvironmentCamera]]) -> Iterator[None]:
    if processors() == 1:
        yield from map(function, numbered)
        return
    # Not copies of this process: they would lack the threads of Embree, and may wait for them for ever
    with ProcessPoolExecutor(processors(), get_context("spawn")) as pool:
        yield from pool.map(function, numbered)


def _write_frame(folder: Path, size: tuple[int, int], numbered: tuple[int, EnvironmentCamera]) -> None:
    from PIL import Image

    number, camera = numbered
    view = attic_view(RoomModel("attic", attic_parts()), camera, *size)
    write_png(folder / f"{number:04d}{_FILES['albedo']}", view.albedo)
    pictures = {
        "photo": view.photo,
        "depth": np.rint(view.depth / DEPTH_STEP).astype(np.uint16),
        "normal": np.rint((view.normals * 0.5 + 0.5) * 255).astype(np.uint8),
    }
    for key, picture in pictures.items():
        with replacing(folder / f"{number:04d}{_FILES[key]}") as stream:
            Image.fromarray(picture).save(stream, format="PNG")  # type: ignore[arg-type]
