"""Camera and light of a scene in the mesh's own space, in floats: what the reference renders and `placement` rounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.errors import UserError
from colonnade.meshes import Extent
from colonnade.scene import Scene, Transform, Vector

Floats = npt.NDArray[np.float64]

#: A framed object is at most this part of the picture's width.
WIDEST = 0.9


@dataclass(frozen=True)
class FloatPlacement:
    """A frame in mesh space.

    The ray of pixel (x, y), (0, 0) at the top left, is ``origin + t * (direction + x * step_x + y * step_y)``; it goes
    through the pixel's centre. Directions are not normalised: one unit of t is one mesh unit of depth.

    Attributes:
        width, height: Pixels.
        origin, direction, step_x, step_y: float64 [3].
        light: Position, float64 [3].
        light_colour, ambient, albedo, background: float64 [3], linear.
        flat: Shade with geometric normals.
        shadows: Trace shadow rays.
        shadow_offset: Along the geometric normal that faces the ray, mesh units.
    """

    width: int
    height: int
    origin: Floats
    direction: Floats
    step_x: Floats
    step_y: Floats
    light: Floats
    light_colour: Floats
    ambient: Floats
    albedo: Floats
    background: Floats
    flat: bool
    shadows: bool
    shadow_offset: float


def float_placement(scene: Scene, extent: Extent, width: int, height: int) -> FloatPlacement:
    """The frame of a scene whose mesh has that extent (`Mesh.extent`, or that of an image's header)."""
    rotation = rotation_matrix(scene.transform)
    scale, translate = scene.transform.scale, np.array(scene.transform.translate)

    def to_world(points: Floats) -> Floats:
        return np.asarray(points @ rotation.T * scale + translate, dtype=np.float64)

    def to_mesh(point: Floats) -> Floats:
        return np.asarray((point - translate) / scale @ rotation, dtype=np.float64)

    centre, edge = to_world(extent.centre), extent.edge * scale
    slope = math.tan(math.radians(scene.camera.fov) / 2)
    if scene.camera.position is not None:
        position = np.array(scene.camera.position)
        target = centre if scene.camera.target is None else np.array(scene.camera.target)
        if not (target - position).any():
            raise UserError("the camera's position is its target: move one of them")
        right, up, toward = camera_axes(position - target, scene.camera.up)
    else:
        assert scene.camera.direction is not None
        right, up, toward = camera_axes(np.array(scene.camera.direction), scene.camera.up)
        outline = to_world(extent.outline) - centre
        across, along = scene.camera.framing * 2 * slope, WIDEST * 2 * slope * width / height
        aside, above, distance = _frame(outline @ right, outline @ up, outline @ toward, along, across, edge)
        position = centre + aside * right + above * up + distance * toward

    if scene.light.position is not None:
        light = np.array(scene.light.position)
    else:
        light = centre + edge * (np.array(scene.light.offset) @ np.stack([right, up, toward]))
    pixel = 2 * slope / height
    corner = -toward + (0.5 - width / 2) * pixel * right + (height / 2 - 0.5) * pixel * up
    return FloatPlacement(
        width=width,
        height=height,
        origin=to_mesh(position),
        direction=corner @ rotation,
        step_x=pixel * right @ rotation,
        step_y=-pixel * up @ rotation,
        light=to_mesh(light),
        light_colour=np.array(scene.light.colour),
        ambient=np.array(scene.ambient.colour),
        albedo=np.array(scene.material.albedo),
        background=np.array(scene.background.colour),
        flat=scene.material.flat,
        shadows=scene.light.shadows,
        shadow_offset=scene.light.shadow_offset * extent.edge,
    )


def rotation_matrix(transform: Transform) -> Floats:
    """Rotation about x, then y, then z: float64 [3, 3] for column vectors."""
    x, y, z = np.radians(transform.rotate)
    about_x = [[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]]
    about_y = [[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]]
    about_z = [[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]]
    return np.asarray(np.array(about_z) @ np.array(about_y) @ np.array(about_x), dtype=np.float64)


def camera_axes(toward: Floats, up: Vector) -> tuple[Floats, Floats, Floats]:
    """Unit vectors right, up and towards the viewer; where ``up`` is along the view another axis takes its place."""
    back = toward / np.linalg.norm(toward)
    for candidate in (up, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)):
        right = np.cross(candidate, back)
        length = float(np.linalg.norm(right))
        if length > 1e-9 * float(np.linalg.norm(candidate)):
            break
    right = right / length
    return right, np.cross(back, right), back


def _frame(x: Floats, y: Floats, z: Floats, width: float, height: float, edge: float) -> tuple[float, float, float]:
    """Where the camera stands, from the cube's centre: right, up and back.

    The outline's points are [k] right, up and towards the camera; ``width`` and ``height`` are what they may span at a
    distance of 1. The spans shrink with the distance, so halving an interval finds where they just fit; the outline is
    in the middle of the picture.
    """
    near = float(z.max()) + 1e-3 * edge
    far = near + 1e4 * edge
    for _ in range(64):
        depth = (near + far) / 2 - z
        spans = [np.ptp((across - _middle(across, depth)) / depth) for across in (x, y)]
        near, far = (near, (near + far) / 2) if spans[0] <= width and spans[1] <= height else ((near + far) / 2, far)
    return _middle(x, far - z), _middle(y, far - z), far


def _middle(across: Floats, depth: Floats) -> float:
    """The camera's shift for which (across − shift) / depth is as far to either side: the outline is in the middle."""
    low, high = float(across.min()), float(across.max())
    for _ in range(52):
        shift = (low + high) / 2
        seen = (across - shift) / depth
        low, high = (shift, high) if seen.max() + seen.min() > 0 else (low, shift)
    return (low + high) / 2
