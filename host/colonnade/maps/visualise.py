"""Draws an environment's maps as pictures: before encoding, after it, and the difference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colonnade.common.atomic_files import made_folder, replacing
from colonnade.common.image_io import encode_srgb
from colonnade.environment.model import Environment
from colonnade.maps.image import AttributeImage
from colonnade.maps.planes import PlaneProjection
from colonnade.maps.quality import angles, ray_errors, relit

#: Differences shown as white: 8-bit levels, degrees, metres.
FULL_LEVELS, FULL_DEGREES, FULL_METRES = 64.0, 30.0, 0.2


def map_pictures(environment: Environment, image: AttributeImage) -> dict[str, NDArray[np.uint8]]:
    """Draw the pictures by name (e.g. ``albedo-before``), uint8 [height, width, 3]; black is no difference."""
    albedo, normals = image.decoded_albedo(), image.decoded_normals()
    depth = image.decoded_depth(PlaneProjection.of(environment, image.depth_unit))
    pictures = {}
    for name, before, after in (
        ("albedo", environment.albedo, albedo),
        ("relit", relit(environment.albedo, environment.normals), relit(albedo, normals)),
    ):
        pair = encode_srgb(before), encode_srgb(after)
        pictures[f"{name}-before"], pictures[f"{name}-after"] = pair
        levels = np.abs(pair[0].astype(np.float64) - pair[1])
        pictures[f"{name}-difference"] = _levels(levels / FULL_LEVELS)
    pictures["normals-before"] = _normal_map(environment.normals)
    pictures["normals-after"] = _normal_map(normals)
    pictures["normals-difference"] = _grey(angles(environment.normals, normals) / FULL_DEGREES)
    nearest = float(environment.depth.min())
    pictures["depth-before"], pictures["depth-after"] = _grey(nearest / environment.depth), _grey(nearest / depth)
    pictures["depth-difference"] = _grey(ray_errors(environment, depth) / FULL_METRES)
    pictures["planes"] = _coloured(image.planes.ids(image.layout))
    return pictures


def write_pictures(folder: Path, pictures: dict[str, NDArray[np.uint8]]) -> None:
    """Write each picture as ``NAME.png`` into ``folder``, which is created."""
    from PIL import Image

    with made_folder(folder):
        for name, picture in pictures.items():
            with replacing(folder / f"{name}.png") as stream:
                Image.fromarray(picture).save(stream, format="PNG")


def _levels(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(values, 0.0, 1.0) * 255).astype(np.uint8)


def _grey(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.repeat(_levels(values)[..., np.newaxis], 3, axis=2)


def _normal_map(normals: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Draw normals as `normal.png` stores them."""
    return _levels(normals * 0.5 + 0.5)


def _coloured(ids: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Draw each plane in a random colour."""
    colours = np.random.default_rng(5).integers(40, 256, (int(ids.max()) + 1, 3), dtype=np.uint8)
    picture: NDArray[np.uint8] = colours[ids]
    return picture
