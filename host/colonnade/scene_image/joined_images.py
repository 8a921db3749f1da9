"""Several meshes in one column memory, each packed once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest, field_places
from colonnade.scene_image.file import SceneImage

Bytes = npt.NDArray[np.uint8]


def joined_records(images: Sequence[SceneImage], manifest: Manifest) -> tuple[Bytes, list[int]]:
    """The records of images one after the other, with the addresses of their roots.

    Args:
        images: Scene images of the manifest's design; all have corner colours or none has.
        manifest: The design's manifest.

    Returns:
        Records, uint8 [n, record bytes], and each image's first record, its root.

    Raises:
        UserError: The records are more than the column memory holds, or only some images have corner colours.
    """
    if len({image.header.has_colours for image in images}) > 1:
        raise UserError("only some meshes have corner colours: give all of them colours, or none")
    roots = [0, *(int(end) for end in np.cumsum([len(image.records) for image in images]))]
    depth, count = int(manifest.config["columnBvhMemory"]["depth"]), roots.pop()
    if count > depth:
        raise UserError(
            f"the meshes have {count:,} records, the design's memory {depth:,}: raise columnBvhMemory.depth"
        )
    return np.concatenate([_moved(image, root, manifest) for image, root in zip(images, roots, strict=True)]), roots


def _moved(image: SceneImage, base: int, manifest: Manifest) -> Bytes:
    """The records of an image at addresses from `base` on: nodes point there."""
    is_leaf = image.source_faces[::2] >= 0
    is_node = ~is_leaf
    if image.header.has_colours:
        is_node[1:] &= ~is_leaf[:-1]  # a companion
    offset, width, _ = field_places(manifest.layouts)["node"]["first"]
    bits = np.unpackbits(image.records[is_node], axis=1, bitorder="little")
    places = np.arange(width)
    first = (bits[:, offset + places].astype(np.int64) << places).sum(axis=1)
    bits[:, offset + places] = (first + base)[:, None] >> places & 1
    records = image.records.copy()
    records[is_node] = np.packbits(bits, axis=1, bitorder="little")
    return records
