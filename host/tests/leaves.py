"""The triangles that the records of a scene image hold."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from colonnade.design.manifest import Manifest
from colonnade.scene_image.file import SceneImage

Integers = npt.NDArray[np.int64]


def packed_triangles(image: SceneImage, manifest: Manifest) -> tuple[Integers, Integers]:
    """The packed ids, int64 [n], rising, and the corners in vertex units, int64 [n, 3, 3]."""
    first, end = image.header.triangle_base, image.header.attribute_base
    fields = manifest.layouts["triangles"].unpack(image.records[first:end])
    vertices = np.stack(
        [np.stack([fields[f"vertices[{i}].{axis}"] for axis in "xyz"], axis=1) for i in range(6)], axis=1
    )
    is_used = np.arange(2) < fields["count"][:, None]
    return np.arange(2 * first, 2 * end)[is_used.reshape(-1)], vertices.reshape(-1, 2, 3, 3)[is_used]
