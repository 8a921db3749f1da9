"""Newell's teapot of 1975 (``cpp/mesh/teapot.hpp``), which the browser tab has, too.

This is our own code because no library that we use contains the teapot, and the default scene needs a mesh without a
download.
"""

from __future__ import annotations

from colonnade.common.types import Floats
from colonnade.mesh.geometry.topology import Faces


def tessellate(level: int) -> tuple[Floats, Faces]:
    """Tessellate each patch into level × level cells of two triangles, without the degenerate ones at the poles.

    Returns:
        Vertices float64 [n, 3], not merged between patches, and faces int32 [32·2·level² − 8·level, 3].
    """
    from colonnade import _core

    vertices, faces = _core.teapot(level)
    return vertices, faces
