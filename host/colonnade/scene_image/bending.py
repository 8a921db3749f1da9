"""Scene images of meshes that bend: packed in the rest pose, then written anew for each pose of their clip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest, field_places
from colonnade.scene_image.clip_file import ClipTree, clip_file
from colonnade.scene_image.grid_clip import GridClip

if TYPE_CHECKING:
    from colonnade.scene_image.file import SceneImage

Records = npt.NDArray[np.uint8]
_RECORD_BITS = 256  # that the driver writes


@dataclass(frozen=True)
class Bending:
    """A clip and the tree whose records it bends, as a target does: ``driver/src/colonnade_mesh.c``.

    Attributes:
        file: The clip file.
        format_words: The design's format hash.
        duration: Of the clip, 2^-16 s.
    """

    file: bytes
    format_words: tuple[int, ...]
    duration: int

    @classmethod
    def of(
        cls, clip: GridClip, manifest: Manifest, records: int, depth: int, leaves: npt.NDArray[np.int64], colours: bool
    ) -> Bending:
        """The records of a packed mesh, whose leaves have these vertices of the clip, int64 [l, 4].

        Raises:
            UserError: The design has no tree, or wider records than the driver writes.
        """
        places = field_places(manifest.layouts)
        geometry, node = manifest.config["geometry"], places["node"]
        way_out = "or leave out what moves or bends meshes"
        if manifest.record_bits > _RECORD_BITS:
            raise UserError(
                f"meshes bend in records of {_RECORD_BITS} bits, and geometry.vertexBits {geometry['vertexBits']} has "
                f"{manifest.record_bits}: choose 19 or less, {way_out}"
            )
        if not geometry["bvh"]:
            raise UserError(f"meshes bend with their tree, and geometry.bvh is false: set it, {way_out}")
        deltas, addresses = places["nearPair"]["body.deltas[0].x"][1], node["first"][1]
        numbers = (int(geometry["vertexBits"]), deltas, int(geometry["boxBits"]), addresses, 2 if colours else 1)
        words = tuple(int(word) for word in manifest.format_words)
        tree = ClipTree(numbers, records, depth, leaves)
        return cls(clip_file(clip, tree, places, words, is_ordered=True), words, int(clip.times[-1]))

    @cached_property
    def _target(self) -> Any:
        from colonnade import _core

        return _core.TargetMesh(self.format_words, self.file)

    @property
    def seconds(self) -> float:
        """Duration of the clip."""
        return self.duration / (1 << 16)

    def posed(self, image: SceneImage, progress: float) -> SceneImage:
        """The image with the records of a part of the clip, 0.0 to 1.0; a line tells of lost normals."""
        records, flat = self.records(image.records, progress)
        if flat:
            # Without their number, which changes from frame to frame: told once
            notes.tell(f"mesh {image.header.mesh}: the clip stretches triangles so far that they are shaded flat")
        return replace(image, records=records)

    def vertices(self, pose: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int16]]:
        """Positions, vertex units, int32 [v, 3], and codes of normals, int16 [v, 2], of a pose."""
        positions, normals = self._target.skin(pose)
        return positions, normals

    def records(self, rest: Records, progress: float) -> tuple[Records, int]:
        """The records at a part of the clip, 0.0 to 1.0, and how many pairs are too stretched for their normals.

        Args:
            rest: The records in any pose, uint8 [n, 32].
            progress: Of the clip's duration.
        """
        records = np.array(rest)
        pose = self._target.pose(round(progress * self.duration))
        _, _, flat = self._target.refit(*self.vertices(pose), records.view(np.uint32), 0)
        return records, flat


def at_rest(clip: GridClip, manifest: Manifest) -> tuple[npt.NDArray[np.int32], Floats]:
    """The vertices of the rest pose, vertex units, int32 [v, 3], and their normals, float64 [v, 3]."""
    from colonnade import _core

    nothing = np.array([[0, 0, 0, -1]])
    bending = Bending.of(clip, manifest, 2, 1, nothing, False)
    positions, codes = bending.vertices(clip.rest.astype(np.int32))
    return positions, np.asarray(_core.directions(codes))
