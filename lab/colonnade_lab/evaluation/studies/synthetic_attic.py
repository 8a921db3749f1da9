"""A synthetic room with exact geometry: an L-shaped attic with a slanted roof, columns and a ball.

It is the held-out room of the reconstruction, which was not tuned on it, and a room of any size for tests.

`python -m colonnade_lab.evaluation.studies.synthetic_attic FOLDER [WIDTHxHEIGHT]` writes it as a room.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.atomic_files import replacing
from colonnade.common.image_io import encode_srgb, write_png
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.mesh.geometry import primitives
from colonnade.reference.embree import RayTracer, Triangles
from numpy.typing import NDArray

from colonnade_lab.evaluation.studies.attic_paints import Paint, boards, plaster, rings, spiral, stripes

EYE, TARGET = np.array([0.9, 1.55, 2.5]), np.array([-0.05, 0.85, -1.0])
#: Focal length in picture widths.
FOCAL = 0.76
LAMP, LAMP_COLOUR, AMBIENT = np.array([0.6, 2.2, 0.6]), np.array([2.6, 2.4, 2.0]), np.array([0.20, 0.22, 0.27])
#: Depth step of the 16-bit depth map, metres.
DEPTH_STEP = 0.00025


@dataclass(frozen=True)
class Part:
    """A piece of the room.

    Attributes:
        vertices: World space, metres, float64 [n, 3].
        faces: int32 [m, 3].
        paint: Texture.
        centre: Centre of a smooth part; None for a flat part.
        is_round: A smooth part is a ball, not a column.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    paint: Paint
    centre: tuple[float, float, float] | None = None
    is_round: bool = False


@dataclass(frozen=True)
class SyntheticRoom:
    """A room's maps, and its whole surface in world space."""

    environment: Environment
    surface: Triangles


def attic(width: int = 640, height: int = 480) -> SyntheticRoom:
    """Render the attic's maps."""
    return synthetic_room("attic", attic_parts(), camera_at(EYE, TARGET, width, height), width, height)


def synthetic_room(
    name: str, parts: Sequence[Part], camera: EnvironmentCamera, width: int, height: int, lamp: Floats = LAMP
) -> SyntheticRoom:
    """Render the maps of a room that is made of parts, with a photo by the light of a lamp at a point, float64 [3].

    Raises:
        ValueError: The camera sees through the room.
    """
    model = RoomModel(name, parts)
    return SyntheticRoom(model.seen_by(camera, width, height, lamp), model.surface)


@dataclass(frozen=True)
class SeenPoints:
    """What rays see of a room, float64 [n, 3] each but for t, float64 [n]; normals are towards the rays' origins."""

    t: Floats
    position: Floats
    normals: Floats
    albedo: Floats


class RoomModel:
    """A room that is made of parts, for views from any camera."""

    def __init__(self, name: str, parts: Sequence[Part]) -> None:
        self.name, self._parts = name, parts
        starts = np.cumsum([0] + [len(part.vertices) for part in parts])
        faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
        self._owner = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
        self.surface = Triangles(np.concatenate([part.vertices for part in parts]), faces.astype(np.int32))
        self.tracer = RayTracer(self.surface)

    def look(self, origins: Floats, directions: Floats) -> SeenPoints:
        """What rays see, world space, float64 [n, 3].

        Raises:
            ValueError: A ray leaves the room.
        """
        tracer = self.tracer
        hit_faces = tracer.first_hits(origins, directions)
        if (hit_faces < 0).any():
            raise ValueError(f"the {self.name} has a hole")
        points = tracer.surface_points(hit_faces, origins, directions)
        corners = tracer.corners[hit_faces]
        normals = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        albedo = np.empty_like(normals)
        for index, part in enumerate(self._parts):
            rows = np.flatnonzero(self._owner[hit_faces] == index)
            albedo[rows] = part.paint(points.position[rows] - np.array(part.centre or (0.0, 0.0, 0.0)))
            if part.centre is not None:
                normals[rows] = _smooth(points.position[rows], normals[rows], part)
        normals *= np.where(np.einsum("ni,ni->n", normals, directions) > 0, -1.0, 1.0)[:, None]
        return SeenPoints(points.t, points.position, normals, albedo)

    def seen_by(self, camera: EnvironmentCamera, width: int, height: int, lamp: Floats = LAMP) -> Environment:
        """The maps of a camera, with a photo by the light of a lamp at a point, float64 [3].

        Raises:
            ValueError: The camera sees through the room.
        """
        rotation, eye = camera.to_world[:, :3], camera.to_world[:, 3]
        directions = camera.directions(width, height).reshape(-1, 3) @ rotation.T
        seen = self.look(np.broadcast_to(eye, directions.shape), directions)
        light = AMBIENT + self.lamp_light(seen, lamp)
        shape = (height, width, 3)
        return Environment(
            name=self.name,
            albedo=seen.albedo.reshape(shape),
            normals=(seen.normals @ rotation).reshape(shape),
            depth=seen.t.reshape(height, width),
            has_depth=True,
            camera=camera,
            photo=encode_srgb(seen.albedo * light).reshape(shape),
        )

    def lamp_light(self, seen: SeenPoints, lamp: Floats = LAMP) -> Floats:
        """Light of a lamp at a point on what is seen, float64 [n, 3]."""
        to_lamp = lamp - seen.position
        cosine = np.einsum("ni,ni->n", seen.normals, unit_vectors(to_lamp)).clip(min=0)
        lit = ~self.tracer.occluded(seen.position + 1e-3 * seen.normals, to_lamp)
        falloff = 1 / np.einsum("ni,ni->n", to_lamp, to_lamp).clip(min=0.25)
        return np.asarray(LAMP_COLOUR * (cosine * lit * falloff)[:, None])


def write_room(folder: Path, environment: Environment) -> None:
    """Write a synthetic room as the folder of a room."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    meta: dict[str, Any] = {
        "width": environment.width,
        "height": environment.height,
        "fx": environment.fx,
        "fy": environment.fy,
        "cx": environment.cx,
        "cy": environment.cy,
    }
    meta |= {"cam_to_world": [*environment.camera_to_world.tolist(), [0.0, 0.0, 0.0, 1.0]], "albedo_encoding": "srgb"}
    meta |= {"depth_step": DEPTH_STEP, "licence": "CC0: made by colonnade_lab.evaluation.studies"}
    write_png(folder / "albedo.png", environment.albedo)
    pictures: dict[str, Any] = {
        "normal.png": np.rint((environment.normals * 0.5 + 0.5) * 255).astype(np.uint8),
        "depth.png": np.rint(environment.depth / DEPTH_STEP).astype(np.uint16),
        "photo.png": environment.photo,
    }
    for name, picture in pictures.items():
        with replacing(folder / name) as stream:
            Image.fromarray(picture).save(stream, format="PNG", optimize=True)
    with replacing(folder / "meta.json") as stream:
        stream.write((json.dumps(meta, indent=1) + "\n").encode())


def write_attic(folder: Path, width: int = 640, height: int = 480) -> None:
    """Write the attic as the folder of a room."""
    write_room(folder, attic(width, height).environment)


def camera_at(eye: Floats, target: Floats, width: int, height: int, focal: float = FOCAL) -> EnvironmentCamera:
    """A camera at a point, float64 [3], that looks at another one; focal length in picture widths."""
    forward = unit_vectors((target - eye)[None])[0]
    right = unit_vectors(np.cross(forward, [0.0, 1.0, 0.0])[None])[0]
    pose = np.column_stack([right, np.cross(forward, right), forward, eye])
    return EnvironmentCamera(focal * width, focal * width, width / 2, height / 2, pose)


def attic_parts() -> list[Part]:
    """The parts of the attic."""
    knee, ridge, front, back, far = 1.1, 3.1, 3.0, -2.4, -4.9
    west, east, bend = -2.5, 2.5, 0.4
    walls, floor = plaster((0.72, 0.68, 0.60)), boards((0.52, 0.36, 0.22), 0, 2, 0.16)
    roof = boards((0.60, 0.47, 0.33), 2, 0, 0.45)
    parts = [
        quad([west, 0, front], [east, 0, front], [east, 0, far], [west, 0, far], floor),
        quad([west, 0, front], [west, knee, front], [west, knee, back], [west, 0, back], walls),
        quad([east, 0, front], [east, knee, front], [east, knee, far], [east, 0, far], walls),
        quad([west, knee, front], [0, ridge, front], [0, ridge, far], [west, knee, far], roof),
        quad([east, knee, front], [0, ridge, front], [0, ridge, far], [east, knee, far], roof),
        # The L: a wall to the left of the bend, and an arm to its right.
        quad([west, 0, back], [bend, 0, back], [bend, ridge, back], [west, ridge, back], plaster((0.35, 0.48, 0.58))),
        quad([bend, 0, back], [bend, 0, far], [bend, ridge, far], [bend, ridge, back], walls),
        quad([west, 0, far], [east, 0, far], [east, ridge, far], [west, ridge, far], plaster((0.66, 0.42, 0.34))),
        quad([west, 0, front], [east, 0, front], [east, ridge, front], [west, ridge, front], walls),
        cylinder((-0.95, 1.5, -1.55), 0.13, 1.5, spiral((0.80, 0.78, 0.72), (0.45, 0.20, 0.16))),
        cylinder((1.45, 1.5, -2.75), 0.13, 1.5, spiral((0.80, 0.78, 0.72), (0.16, 0.30, 0.22))),
        # A round table, a rug and a rotated chest.
        cylinder((0.15, 0.70, -0.35), 0.55, 0.025, rings((0.62, 0.42, 0.24), 0.055)),
        cylinder((0.15, 0.35, -0.35), 0.07, 0.35, plaster((0.30, 0.22, 0.16))),
        cylinder((-0.2, 0.004, -0.6), 1.25, 0.004, rings((0.55, 0.14, 0.16), 0.21)),
        box((1.6, 0.3, -0.9), (0.45, 0.3, 0.3), 32.0, boards((0.36, 0.44, 0.25), 0, 1, 0.14)),
    ]
    parts.append(ball((-1.5, 0.38, -0.5), (0.38, 0.38, 0.38), stripes))
    parts.append(ball((-0.25, 2.35, -1.2), (0.14, 0.10, 0.14), plaster((0.82, 0.80, 0.70))))
    return parts


def quad(a: list[float], b: list[float], c: list[float], d: list[float], paint: Paint) -> Part:
    """A flat part with four corners."""
    return Part(np.array([a, b, c, d], dtype=np.float64), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), paint)


def cylinder(centre: tuple[float, float, float], radius: float, half: float, paint: Paint) -> Part:
    """An upright cylinder."""
    vertices, faces = primitives.cylinder(128)
    axis = int(np.argmin([len(np.unique(vertices[:, k].round(9))) for k in range(3)]))
    upright = np.roll(vertices, 1 - axis, axis=1)
    return Part(upright * (radius, half, radius) + centre, faces, paint, centre)


def box(centre: tuple[float, float, float], half: tuple[float, float, float], degrees: float, paint: Paint) -> Part:
    """A box, turned about the vertical."""
    vertices, faces = primitives.cube()
    angle = np.radians(degrees)
    rotation = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return Part(vertices * half @ rotation.T + centre, faces, lambda points: paint(points @ rotation))


def ball(centre: tuple[float, float, float], radii: tuple[float, float, float], paint: Paint, level: int = 6) -> Part:
    """A ball with a radius along each axis; ``level`` as in `primitives.sphere`."""
    vertices, faces = primitives.sphere(level)
    return Part(vertices * radii + centre, faces, paint, centre, True)


def _smooth(points: Floats, flat: Floats, part: Part) -> Floats:
    """Unit normals of a ball or a column, float64 [n, 3]. A column's ends stay flat."""
    offset = points - np.array(part.centre)
    if part.is_round:
        size = np.ptp(part.vertices, axis=0)
        return unit_vectors(offset / size**2)
    radial = unit_vectors(offset * (1.0, 0.0, 1.0))
    return np.where(np.abs(flat[:, 1:2]) > 0.9, flat, radial)


if __name__ == "__main__":
    size = sys.argv[2].split("x") if len(sys.argv) > 2 else ("640", "480")
    write_attic(Path(sys.argv[1]), int(size[0]), int(size[1]))
