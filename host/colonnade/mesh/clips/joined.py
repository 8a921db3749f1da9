"""The clips of several objects as one, in which each object has its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.clip import INFLUENCES, Clip, Morphs, Nodes
from colonnade.mesh.clips.tracks import Track

#: Duration of motions beside which no animation plays.
STILL_SECONDS = 1.0
_NO_ROTATION = np.array([[0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Place:
    """Where a clip is in the scene of all.

    Attributes:
        nodes: A chain of nodes, each the child of the one before; the last carries the clip.
        tracks: What moves them.
    """

    nodes: Nodes
    tracks: tuple[Track, ...] = ()

    @classmethod
    def of(cls, matrices: Sequence[Floats], tracks: tuple[Track, ...] = ()) -> Place:
        """The place of transforms to their parents, float64 [4, 4] each, with tracks of the first."""
        count = len(matrices)
        return cls(
            Nodes(
                tuple(range(-1, count - 1)),
                tuple(range(count)),
                np.array(matrices),
                np.array([matrix[:3, 3] for matrix in matrices]),
                np.repeat(_NO_ROTATION, count, axis=0),
                np.ones((count, 3)),
            ),
            tracks,
        )

    def at(self, time: float) -> Floats:
        """From the clip to the scene of all at a time, seconds, float64 [4, 4]."""
        last = len(self.nodes.parents) - 1
        clip = replace(still_clip(np.zeros((1, 3))), nodes=self.nodes, tracks=self.tracks, joints=np.array([last]))
        return np.vstack([clip.pose(time).matrices[0], [0.0, 0.0, 0.0, 1.0]])


def still_clip(vertices: Floats) -> Clip:
    """A clip of vertices, float64 [v, 3], that do not move."""
    count = len(vertices)
    nothing = np.zeros(0, dtype=np.int64)
    return Clip(
        name="",
        duration=0.0,
        nodes=Place.of([np.eye(4)]).nodes,
        tracks=(),
        joints=np.zeros(1, dtype=np.int64),
        inverses=np.eye(4)[None],
        positions=vertices,
        bones=np.zeros((count, INFLUENCES), dtype=np.int64),
        weights=np.tile(np.eye(INFLUENCES)[0], (count, 1)),
        morphs=Morphs(nothing, nothing, np.zeros(0), nothing, nothing, np.zeros((0, 3)), np.zeros((0, 3))),
    )


def joined_clip(clips: Sequence[Clip], places: Sequence[Place]) -> Clip:
    """All clips at once, each beginning at 0 and staying at its end.

    Args:
        clips: The clips.
        places: Of each in the scene of all.
    """
    morphs = [clip.morphs for clip in clips]
    # Before the nodes of each clip are its place's
    nodes = _offsets(
        [len(place.nodes.parents) + len(clip.nodes.parents) for place, clip in zip(places, clips, strict=True)]
    )
    bones = _offsets([len(clip.joints) for clip in clips])
    vertices = _offsets([len(clip.positions) for clip in clips])
    targets = _offsets([len(one.weights) for one in morphs])
    parts = [part for place, clip in zip(places, clips, strict=True) for part in (place.nodes, clip.nodes)]

    def shifted(values: Sequence[Indices], by: Sequence[int]) -> Indices:
        return np.concatenate([value + first for value, first in zip(values, by, strict=True)])

    own = [first + len(place.nodes.parents) for first, place in zip(nodes, places, strict=True)]
    return Clip(
        name=" + ".join(clip.name for clip in clips if clip.name),
        duration=max(clip.duration for clip in clips) or STILL_SECONDS,
        nodes=Nodes(
            parents=tuple(
                parent
                for place, clip, first, inner in zip(places, clips, nodes, own, strict=True)
                for parent in (
                    *(old if old < 0 else first + old for old in place.nodes.parents),
                    *(inner - 1 if old < 0 else inner + old for old in clip.nodes.parents),
                )
            ),
            order=tuple(
                node
                for place, clip, first, inner in zip(places, clips, nodes, own, strict=True)
                for node in (
                    *(first + old for old in place.nodes.order),
                    *(inner + old for old in clip.nodes.order),
                )
            ),
            matrices=np.concatenate([part.matrices for part in parts]),
            translations=np.concatenate([part.translations for part in parts]),
            rotations=np.concatenate([part.rotations for part in parts]),
            scales=np.concatenate([part.scales for part in parts]),
        ),
        tracks=tuple(
            Track(track.node + first, track.path, track.times, track.values, track.interpolation)
            for tracks, first in (
                *((place.tracks, first) for place, first in zip(places, nodes, strict=True)),
                *((clip.tracks, first) for clip, first in zip(clips, own, strict=True)),
            )
            for track in tracks
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


def _offsets(counts: Sequence[int]) -> list[int]:
    return [sum(counts[:i]) for i in range(len(counts))]
