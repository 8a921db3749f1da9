"""The shell: planes around the whole room, for rays that leave the view.

A plane is part of it when hardly any of the room's points lie beyond it, seen from the camera: floor, ceiling, walls. A
virtual wall behind the camera closes it. An entry, low bit first: plane (64 bits), mean albedo and normal (three fields
each), the rest zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.encoding.plane_fit import refitted, samples_of
from colonnade.environment.encoding.planes import Picture, packed_planes, unpacked_planes
from colonnade.environment.encoding.vectors import AlbedoSpace, NormalSpace
from colonnade.environment.model import Environment

#: The virtual wall stands so far behind the camera, metres.
BEHIND = 0.5
#: The share of the room's points that may lie beyond a plane of the shell, by more than a tolerance in metres.
_MAX_BEYOND = 0.03
_TOLERANCE = 0.05
#: Pixels within this distance of a plane lie on it, metres; so many of them make it worth an entry.
_ON_IT = 0.03
_LEAST_SHARE = 0.01
#: Two planes whose normals differ by less than this cosine are one wall.
_SAME_DIRECTION = 0.94
_STEP = 2


@dataclass(frozen=True)
class Shell:
    """Planes and their colours.

    Attributes:
        planes: float64 [n, 3], A, B, C.
        albedos: float64 [n, 3], linear.
    """

    planes: NDArray[np.float64]
    albedos: NDArray[np.float64]


def choose_bounding_planes(
    environment: Environment, picture: Picture, planes: NDArray[np.float64], maximum: int
) -> Shell:
    """At most ``most`` planes: the virtual wall, and of ``planes`` those around the room, the largest first."""
    samples = samples_of(environment, picture, _STEP)
    albedo = environment.albedo[::_STEP, ::_STEP].reshape(-1, 3)
    points = environment.points()[::_STEP, ::_STEP].reshape(-1, 3)
    normals = environment.normals[::_STEP, ::_STEP].reshape(-1, 3)
    wall = np.array([0.0, 0.0, -picture.depth_unit / BEHIND])
    chosen, colours = [wall], [albedo.mean(axis=0)]
    lying = _lying(samples.errors(planes), normals, picture.normals(planes))
    for k in np.argsort(-lying.sum(axis=0), kind="stable"):
        if len(chosen) == maximum or lying[:, k].mean() < _LEAST_SHARE:
            break
        mine = lying[:, k]
        owner = np.where(mine, 0, 1).astype(np.intp)
        plane = refitted(samples, np.stack([planes[k], wall]), owner)[0]
        q = picture.inverse_offsets(plane[np.newaxis])[0]
        beyond = (points @ q - 1.0) / np.linalg.norm(q) > _TOLERANCE
        if beyond.mean() > _MAX_BEYOND:
            continue
        directions = picture.normals(np.stack([*chosen[1:], plane]))
        if (directions[:-1] @ directions[-1] > _SAME_DIRECTION).any():
            continue
        chosen.append(plane)
        colours.append(albedo[mine].mean(axis=0))
    return Shell(np.stack(chosen), np.stack(colours))


def _lying(
    errors: NDArray[np.float32], normals: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether each sample lies on each plane: near it, and facing as it does: bool [samples, planes]."""
    lying: NDArray[np.bool_] = (errors < _ON_IT) & (normals @ directions.T > _SAME_DIRECTION)
    return lying


def packed_shell(shell: Shell, picture: Picture, layout: AttributeLayout) -> NDArray[np.uint64]:
    """Words uint64 [shell_planes, 3]: bits 63 to 0, 127 to 64, 143 to 128 of each entry."""
    planes = packed_planes(shell.planes)
    albedos = AlbedoSpace(layout.field_bits).words(shell.albedos)
    normals = NormalSpace(layout.field_bits).words(picture.normals(unpacked_planes(planes)))
    words = np.zeros((layout.shell_planes, 3), np.uint64)
    for k in range(len(planes)):
        entry = int(planes[k]) | (int(albedos[k]) | int(normals[k]) << layout.vector_bits) << 64
        words[k] = [entry >> (64 * part) & ((1 << 64) - 1) for part in range(3)]
    return words
