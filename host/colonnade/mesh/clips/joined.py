"""The clips of several objects as one, in which each object has its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.clip import INFLUENCES, Clip, Morphs, Nodes
from colonnade.mesh.clips.tracks import Track

_NO_ROTATION = np.array([[0.0, 0.0, 0.0, 1.0]])


def still_clip(vertices: Floats) -> Clip:
    """A clip of vertices, float64 [v, 3], that do not move."""
    count = len(vertices)
    nothing = np.zeros(0, dtype=np.int64)
    return Clip(
        name="",
        duration=0.0,
        nodes=_root(np.eye(4)),
        tracks=(),
        joints=np.zeros(1, dtype=np.int64),
        inverses=np.eye(4)[None],
        positions=vertices,
        bones=np.zeros((count, INFLUENCES), dtype=np.int64),
        weights=np.tile(np.eye(INFLUENCES)[0], (count, 1)),
        morphs=Morphs(nothing, nothing, np.zeros(0), nothing, nothing, np.zeros((0, 3)), np.zeros((0, 3))),
    )


def joined_clip(clips: Sequence[Clip], placements: Sequence[Floats]) -> Clip:
    """All clips at once, each beginning at 0 and staying at its end.

    Args:
        clips: The clips.
        placements: From the scene of each to that of all, float64 [4, 4].
    """
    morphs = [clip.morphs for clip in clips]
    # Each clip has a root more: its placement
    nodes = _offsets([len(clip.nodes.parents) + 1 for clip in clips])
    bones = _offsets([len(clip.joints) for clip in clips])
    vertices = _offsets([len(clip.positions) for clip in clips])
    targets = _offsets([len(one.weights) for one in morphs])
    roots = [_root(placement) for placement in placements]
    parts = [part for root, clip in zip(roots, clips, strict=True) for part in (root, clip.nodes)]

    def shifted(values: Sequence[Indices], by: Sequence[int]) -> Indices:
        return np.concatenate([value + first for value, first in zip(values, by, strict=True)])

    own = [first + 1 for first in nodes]
    return Clip(
        name=" + ".join(clip.name for clip in clips if clip.tracks),
        duration=max(clip.duration for clip in clips),
        nodes=Nodes(
            parents=tuple(
                parent
                for clip, first in zip(clips, nodes, strict=True)
                for parent in (-1, *(first if old < 0 else first + 1 + old for old in clip.nodes.parents))
            ),
            order=tuple(
                node
                for clip, first in zip(clips, nodes, strict=True)
                for node in (first, *(first + 1 + old for old in clip.nodes.order))
            ),
            matrices=np.concatenate([part.matrices for part in parts]),
            translations=np.concatenate([part.translations for part in parts]),
            rotations=np.concatenate([part.rotations for part in parts]),
            scales=np.concatenate([part.scales for part in parts]),
        ),
        tracks=tuple(
            Track(track.node + first, track.path, track.times, track.values, track.interpolation)
            for clip, first in zip(clips, own, strict=True)
            for track in clip.tracks
        ),
        joints=shifted([clip.joints for clip in clips], own),
        inverses=np.concatenate([clip.inverses for clip in clips]),
        positions=np.concatenate([clip.positions for clip in clips]),
        bones=shifted([clip.bones for clip in clips], bones),
        weights=np.concatenate([clip.weights for clip in clips]),
        morphs=Morphs(
            nodes=shifted([one.nodes for one in morphs], own),
            places=np.concatenate([one.places for one in morphs]),
            weights=np.concatenate([one.weights for one in morphs]),
            targets=shifted([one.targets for one in morphs], targets),
            vertices=shifted([one.vertices for one in morphs], vertices),
            positions=np.concatenate([one.positions for one in morphs]),
            normals=np.concatenate([one.normals for one in morphs]),
        ),
    )


def _root(matrix: Floats) -> Nodes:
    return Nodes((-1,), (0,), matrix[None], np.zeros((1, 3)), _NO_ROTATION, np.ones((1, 3)))


def _offsets(counts: Sequence[int]) -> list[int]:
    return [sum(counts[:i]) for i in range(len(counts))]
