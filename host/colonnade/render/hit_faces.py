"""The faces that a frame shows, also where objects share the records of a mesh."""

from __future__ import annotations

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.common.types import Indices
from colonnade.scene_image.file import SceneImage


def hit_faces(image: SceneImage, frame: Frame) -> Indices:
    """The faces of the mesh's file at the pixels of a frame, -1 for none, int64 [height, width].

    Records name the faces of the first of the objects that share them.
    """
    faces = np.append(image.source_faces.astype(np.int64), -1)[frame.triangle]
    instances = image.header.instances
    if not instances:
        return np.asarray(faces)
    roots, starts = [one.root for one in instances], [part.first_face for part in image.header.parts]
    later = np.array([start - starts[roots.index(root)] for root, start in zip(roots, starts, strict=True)])
    return np.where(faces < 0, -1, faces + later[frame.instance])
