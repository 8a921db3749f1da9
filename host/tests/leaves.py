"""The triangles that the records of a scene image hold."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade import _core
from colonnade.design.manifest import Manifest, field_places
from colonnade.scene_image.file import SceneImage

Integers = npt.NDArray[np.int64]


def leaf_addresses(image: SceneImage) -> Integers:
    """The records that are leaves, int64 [l], rising."""
    return np.flatnonzero(image.source_faces[::2] >= 0)


def leaves_of(image: SceneImage, manifest: Manifest) -> tuple[Integers, dict[str, Integers]]:
    """The packed ids, int64 [n], rising, and for each its triangle's `vertices`, in vertex units, and `normals`,
    int64 [n, 3, 3], its `geometric` normal and `material`.
    """
    addresses = leaf_addresses(image)
    places, fraction = field_places(manifest.layouts), manifest.numbers["normalFraction"]
    leaves: dict[str, Integers] = _core.leaves(image.records[addresses], places, fraction)
    is_used = np.arange(2) < leaves.pop("triangles")[:, None]
    leaves["material"] = np.repeat(leaves["material"][:, None], 2, axis=1)
    return np.flatnonzero(image.source_faces >= 0), {name: each[is_used] for name, each in leaves.items()}


def packed_triangles(image: SceneImage, manifest: Manifest) -> tuple[Integers, Integers]:
    """The packed ids, int64 [n], rising, and the corners in vertex units, int64 [n, 3, 3]."""
    ids, leaves = leaves_of(image, manifest)
    return ids, leaves["vertices"]
