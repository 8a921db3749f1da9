"""Clip files: what bends a mesh on a target (docs/driver.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.scene_image.grid_clip import GridClip

Places = Mapping[str, Mapping[str, tuple[int, int, bool]]]
_VERSION = 1
#: Of a leaf of one triangle, in place of its fourth vertex.
NO_VERTEX = 0xFFFFFFFF


@dataclass(frozen=True)
class ClipTree:
    """The records of a mesh that bends.

    Attributes:
        numbers: Bits of vertices, of deltas, of box planes and of addresses; records of a leaf.
        records: Nodes and leaves.
        depth: Nodes on the longest path from the root.
        leaves: The clip's vertices of each leaf, the fourth of a triangle −1, int64 [l, 4].
    """

    numbers: tuple[int, int, int, int, int]
    records: int
    depth: int
    leaves: npt.NDArray[np.int64]


def field_lows(places: Places) -> list[int]:
    """The lowest bit of each field that a target writes, in the order of a clip file."""
    axes, codes = "xyz", "uv"

    def of(layout: str, names: Sequence[str]) -> list[int]:
        return [places[layout][name][0] for name in names]

    node = [f"children[{child}].{plane}.{axis}" for child in range(4) for plane in ("low", "high") for axis in axes]
    node += [*(f"corner.{axis}" for axis in axes), "first", "leaves", "nodes"]
    return (
        of("node", node)
        + of("flatPair", [f"body.vertices[{vertex}].{axis}" for vertex in range(4) for axis in axes])
        + of("nearPair", [f"body.deltas[{vertex}].{axis}" for vertex in range(3) for axis in axes])
        + of("farPair", [f"body.signs[{vertex}].{axis}" for vertex in range(3) for axis in axes])
        + of("triangle", [f"body.normals[{vertex}].{code}" for vertex in range(3) for code in codes])
        + of("nearPair", [f"body.normals[{vertex}].{code}" for vertex in range(4) for code in codes])
        + of("nearPair", [f"body.lowBits[{vertex}].{code}" for vertex in range(4) for code in codes])
        + of("nearPair", ["format", "material", "isClear"])
    )


def clip_file(clip: GridClip, tree: ClipTree, places: Places, format_words: Sequence[int]) -> bytes:
    """A clip file.

    Args:
        clip: The clip.
        tree: The records whose leaves have its vertices.
        places: Fields of the records, by `colonnade.design.manifest.field_places`.
        format_words: The design's format hash.
    """
    lows = bytes(field_lows(places))
    numbers = [
        *tree.numbers,
        tree.records,
        tree.depth,
        len(clip.vertices),
        len(tree.leaves),
        clip.bones,
        clip.targets,
        len(clip.changes),
        len(clip.times),
        int(clip.times[-1]),
        clip.linear_shift,
        clip.shift,
    ]
    halves = clip.vertices[:, 3:].astype(np.uint16)
    changed = clip.changes[:, 4:].astype(np.uint16)
    body = [
        lows + b"\0" * (-len(lows) % 4),
        np.column_stack([clip.vertices[:, :3].astype("<u4"), halves.view("<u4")]).astype("<u4").tobytes(),
        (tree.leaves.astype(np.int64) & NO_VERTEX).astype("<u4").tobytes(),
        np.column_stack([clip.changes[:, :4].astype("<u4"), changed.view("<u4")]).astype("<u4").tobytes(),
        np.column_stack([clip.times, clip.poses & 0xFFFFFFFF]).astype("<u4").tobytes(),
    ]
    content = np.array(numbers, dtype="<u4").tobytes() + b"".join(body)
    header = np.array([_VERSION, 48 + len(content), *format_words], dtype="<u4").tobytes()
    return b"CLNDCLIP" + header + content
