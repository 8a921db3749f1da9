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
    """

    times: Floats
    matrices: Floats
    weights: Floats


@dataclass(frozen=True)
class Baked:
    """The keys of a clip, and the box of all of its poses, float64 [3] twice."""

    keys: Keys
    low: Floats
    high: Floats


def keys_of(clip: Clip, tolerance: float) -> Keys:
    """Keys with which no vertex is further than a tolerance from where the clip has it (``cpp/mesh/clip_keys.hpp``).

    Args:
        clip: The clip.
        tolerance: In units of its scene.
    """
    return Keys(*clip.compiled.keys(tolerance))


def baked(clip: Clip) -> Baked:
    """The keys of a clip within ``_core.CLIP_TOLERANCE`` of the longest edge of the object at rest."""
    keys, low, high = clip.compiled.bake()
    return Baked(Keys(*keys), low, high)
