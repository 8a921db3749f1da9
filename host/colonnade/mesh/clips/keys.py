"""The keys of a clip: poses between which matrices are interpolated linearly."""

from __future__ import annotations

from dataclasses import dataclass

from colonnade.common.types import Floats
from colonnade.mesh.clips.clip import Clip


@dataclass(frozen=True)
class Keys:
    """Poses at ascending times. Two of equal time are a jump: the first is the pose just before it.

    Attributes:
        times: Seconds, from 0 to the clip's duration, float64 [k].
        matrices: Of bones, float64 [k, b, 3, 4].
        weights: Of morph targets, float64 [k, t].
        low, high: The box of all poses, also between keys and at rest, float64 [3].
    """

    times: Floats
    matrices: Floats
    weights: Floats
    low: Floats
    high: Floats


def keys_of(clip: Clip) -> Keys:
    """The keys of a clip (``cpp/mesh/clip_keys.hpp``).

    Interpolated, they miss the clip by at most ``_core.CLIP_TOLERANCE`` of the longest edge of the object at rest.
    """
    return Keys(*clip.compiled.bake())
