"""The keys of a clip: poses between which matrices are interpolated linearly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.clip import INFLUENCES, Clip, Pose

#: Share of the longest edge of the object at rest by which interpolated keys may miss the clip.
TOLERANCE = 2.0**-10
#: Bisections of the time between two keys of the file.
_BISECTIONS = 8


@dataclass(frozen=True)
class Keys:
    """Poses at ascending times. Two of equal time are a jump: the first is the pose just before it.

    Attributes:
        times: Seconds, from 0 to the clip's duration, float64 [k].
        matrices: Of bones, float64 [k, b, 3, 4].
        weights: Of morph targets, float64 [k, t].
    """

    times: Floats
    matrices: Floats
    weights: Floats

    @classmethod
    def of(cls, poses: Sequence[tuple[float, Pose]]) -> Keys:
        """Those of times and poses."""
        return cls(
            np.array([time for time, _ in poses]),
            np.array([pose.matrices for _, pose in poses]),
            np.array([pose.weights for _, pose in poses]),
        )

    def at(self, time: float) -> Pose:
        """The pose between two keys."""
        last = len(self.times) - 1
        place = min(int(np.searchsorted(self.times, time, side="right")) - 1, last)
        after = min(place + 1, last)
        span = self.times[after] - self.times[place]
        part = (time - self.times[place]) / span if span > 0 else 0.0
        between = [(1 - part) * values[place] + part * values[after] for values in (self.matrices, self.weights)]
        return Pose(*between)

    def box(self, clip: Clip) -> tuple[Floats, Floats]:
        """A box of the clip's vertices in all poses of the keys and between them, float64 [3] twice."""
        poses = list(zip(self.matrices, self.weights, strict=True))
        rest = clip.rest()
        found = [clip.vertices(rest.matrices, rest.weights)]
        found += [clip.vertices(*pose) for pose in poses]
        for (matrices, weights), (next_matrices, next_weights) in pairwise(poses):
            if not np.array_equal(weights, next_weights):
                # With these a vertex is on a parabola, within its control points
                crossed = clip.vertices(matrices, next_weights) + clip.vertices(next_matrices, weights)
                found.append(crossed / 2)
        lows, highs = (np.array([one.min(axis=0) for one in found]), np.array([one.max(axis=0) for one in found]))
        return lows.min(axis=0), highs.max(axis=0)


@dataclass(frozen=True)
class Baked:
    """The keys of a clip, and the box of all of its poses, float64 [3] twice."""

    keys: Keys
    low: Floats
    high: Floats


@lru_cache(maxsize=2)
def baked(clip: Clip) -> Baked:
    """The keys of a clip within `TOLERANCE`."""
    rest = clip.rest()
    vertices = clip.vertices(rest.matrices, rest.weights)
    keys = keys_of(clip, TOLERANCE * float(np.ptp(vertices, axis=0).max()))
    return Baked(keys, *keys.box(clip))


class _Reach:
    """How far vertices move if matrices and weights change."""

    def __init__(self, clip: Clip) -> None:
        """Find the boxes of the vertices of each bone."""
        morphs, count = clip.morphs, len(clip.joints)
        span = np.zeros_like(clip.positions)
        np.add.at(span, morphs.vertices, np.abs(morphs.positions))
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        for influence in range(INFLUENCES):
            np.minimum.at(low, clip.bones[:, influence], clip.positions - span)
            np.maximum.at(high, clip.bones[:, influence], clip.positions + span)
        places = np.array(list(product((0, 1), repeat=3)))
        corners = np.where(places[None], high[:, None], low[:, None])
        self._corners = np.concatenate([corners, np.ones((count, 8, 1))], axis=2)
        self._targets = np.zeros(len(morphs.weights))
        np.maximum.at(self._targets, morphs.targets, np.abs(morphs.positions).max(axis=1, initial=0.0))

    def of(self, matrices: Floats, weights: Floats, largest: Floats) -> Floats:
        """A bound for changes, float64 [k], by changes of matrices and weights, and matrices."""
        moved = fixed_order.product(matrices, np.swapaxes(self._corners, 1, 2))
        scale = np.abs(largest[..., :3]).sum(axis=-1).max(axis=(-2, -1))
        return np.asarray(np.abs(moved).max(axis=(1, 2, 3)) + scale * (np.abs(weights) * self._targets).sum(axis=1))


def keys_of(clip: Clip, tolerance: float) -> Keys:
    """Keys with which no vertex is further than a tolerance from where the clip has it, at the keys of the file.

    Args:
        clip: The clip.
        tolerance: In units of its scene.
    """
    reach, found = _Reach(clip), []
    times = np.unique(np.concatenate([[0.0, clip.duration], *(track.times for track in clip.tracks)]))
    start = (0.0, clip.pose(0.0))
    piece = [start]
    for time in times[1:].tolist():
        before, pose = clip.pose(time, before=True), clip.pose(time)
        piece += _between(clip, reach, piece[-1], (time, before), tolerance, _BISECTIONS)
        if not before.is_equal(pose):
            found += _thinned(reach, piece, tolerance)
            piece = [(time, pose)]
    return Keys.of(found + _thinned(reach, piece, tolerance))


def _between(
    clip: Clip, reach: _Reach, first: tuple[float, Pose], last: tuple[float, Pose], tolerance: float, depth: int
) -> list[tuple[float, Pose]]:
    """The poses after the first up to the last, so dense that their chords are good."""
    middle = (first[0] + last[0]) / 2
    pose = clip.pose(middle)
    keys = Keys.of([first, (middle, pose), last])
    error = _errors(reach, keys)[1]
    if error <= tolerance / 4 or depth == 0:
        return [last]
    found = _between(clip, reach, first, (middle, pose), tolerance, depth - 1)
    return found + _between(clip, reach, (middle, pose), last, tolerance, depth - 1)


def _errors(reach: _Reach, keys: Keys) -> Floats:
    """How far the chord from the first to the last of some keys is from each, float64 [k]."""
    span = keys.times[-1] - keys.times[0]
    part = (keys.times - keys.times[0]) / (span if span > 0 else 1.0)
    matrices, weights = (
        values[0] + part.reshape(-1, *[1] * (values.ndim - 1)) * (values[-1] - values[0]) - values
        for values in (keys.matrices, keys.weights)
    )
    return reach.of(matrices, weights, keys.matrices)


def _thinned(reach: _Reach, poses: list[tuple[float, Pose]], tolerance: float) -> list[tuple[float, Pose]]:
    """The poses without those that are near enough to a chord of others (Ramer, Douglas and Peucker)."""
    keys, kept = Keys.of(poses), {0, len(poses) - 1}
    pending = [(0, len(poses) - 1)]
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        part: Indices = np.arange(first, last + 1)
        errors = _errors(reach, Keys(keys.times[part], keys.matrices[part], keys.weights[part]))
        worst = int(errors.argmax())
        if errors[worst] > 3 * tolerance / 4:
            kept.add(first + worst)
            pending += [(first, first + worst), (first + worst, last)]
    return [poses[place] for place in sorted(kept)]
