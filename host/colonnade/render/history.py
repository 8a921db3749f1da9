"""Noise over time: what frames of a motion keep of those before, each point where the next frame shows it.

As in SVGF (C. Schied et al. 2017): a mean over the frames that showed the same point of a surface, with weights that
fall exponentially. What a frame's own neighbourhood contradicts goes, so light and shadows follow at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from colonnade.common.accumulation import LUMINANCE
from colonnade.common.types import Floats
from colonnade.render.denoise import Guide, Noisy, moments
from colonnade.scene.model import Denoiser
from colonnade.scene.view import View

#: The most frames of a mean; of shadows that move.
FRAMES, MOVING_FRAMES = 8, 3
#: How much of the noise's deviation the mean of the neighbours may have.
_CLAMP = 0.36
#: How far a point may lie off the plane of one before, as a share of its distance; least cosine of their normals.
_OFF, _COSINE = 0.004, 0.9


@dataclass(frozen=True)
class Camera:
    """The rays of a frame, in the space of a guide: of pixel (x, y) ``rays @ (1, x, y)``.

    Attributes:
        origin: float64 [3].
        rays: float64 [3, 3].
    """

    origin: Floats
    rays: Floats

    @staticmethod
    def of(view: View) -> Camera:
        """The camera of a view, in the space of the mesh."""
        return Camera(view.origin, np.stack([view.direction, view.step_x, view.step_y], axis=1))

    def moved(self, transform: Floats) -> Camera:
        """In another space, by a transform [3, 4] to it."""
        linear, shift = transform[:, :3], transform[:, 3]
        return Camera(linear @ self.origin + shift, linear @ self.rays)

    def pixels(self, position: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Where points [..., 3] are seen, float64 [..., 2], and whether they lie before the camera."""
        depth, *place = np.moveaxis((position - self.origin) @ np.linalg.inv(self.rays).T, -1, 0)
        is_before = depth > 0
        return np.stack(place, axis=-1) / np.where(is_before, depth, 1.0)[..., None], is_before


@dataclass(frozen=True)
class _Seen:
    """What a frame leaves: its guide and camera, colours and their variance, and the frames in them."""

    guide: Guide
    camera: Camera
    noisy: Noisy
    frames: Floats


@dataclass
class History:
    """The frames before, by a name for what they show."""

    _seen: dict[str, _Seen] = field(default_factory=dict)

    @staticmethod
    def of(denoise: bool | Denoiser, frames: int) -> History | None:
        """The history of so many frames; None if nothing is blended."""
        return History() if frames > 1 and denoise in (True, "atrous") else None

    def blended(self, name: str, noisy: Noisy, guide: Guide, camera: Camera, longest: int = FRAMES) -> Noisy:
        """The mean of a frame and those before.

        Args:
            name: What the frame shows.
            noisy: Its colours.
            guide: Its surface, in a space that stays from frame to frame.
            camera: In the same space.
            longest: The most frames of the mean.
        """
        frames = np.ones(guide.mask.shape)
        if (before := self._seen.get(name)) is not None and before.frames.shape == frames.shape:
            found, squares, frames = _reprojected(before, guide)
            mean, width = _likely(noisy, guide.mask)
            found = found.clip(mean - width, mean + width)
            frames = np.minimum(frames + 1, longest)
            part = 1 / frames
            noisy = Noisy(
                found + part[..., None] * (noisy.colour - found),
                (1 - part) ** 2 * squares + part**2 * noisy.variance,
            )
        self._seen[name] = _Seen(guide, camera, noisy, frames)
        return noisy


def _likely(noisy: Noisy, mask: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """The neighbours' mean, and how far off it a point is likely: by their own differences, and the mean's noise."""
    mean, deviation = moments(noisy.colour, mask)
    spread = moments((noisy.colour @ LUMINANCE)[..., None], mask)[1]
    noise = np.minimum(np.sqrt(moments(noisy.variance[..., None], mask)[0].clip(min=0.0)), spread)
    own = np.sqrt(spread**2 - noise**2) + _CLAMP * noise
    return mean, deviation * own / np.maximum(spread, 1e-9)


def _reprojected(before: _Seen, guide: Guide) -> tuple[Floats, Floats, Floats]:
    """Colours, variances and numbers of frames of a frame's points, 0 for points that the frame before did not show."""
    (height, width), own = guide.mask.shape, guide.mask
    position, planes, normals = guide.position[own], guide.planes[own], guide.normals[own]
    place, is_before = before.camera.pixels(position)
    corner = np.floor(place.clip(-2, max(height, width) + 2)).astype(np.int64)
    distance = np.linalg.norm(position - before.camera.origin, axis=1)
    values = np.dstack([before.noisy.colour, before.noisy.variance, before.frames])
    total, weights = np.zeros((len(position), 5)), np.zeros(len(position))
    for down in (0, 1):
        for across in (0, 1):
            x, y = corner[..., 0] + across, corner[..., 1] + down
            inside = (x >= 0) & (y >= 0) & (x < width) & (y < height) & is_before
            at = (np.where(inside, y, 0), np.where(inside, x, 0))
            off = np.abs(np.einsum("pi,pi->p", before.guide.position[at] - position, planes))
            facing = np.einsum("pi,pi->p", before.guide.normals[at], normals)
            same = inside & before.guide.mask[at] & (off < _OFF * distance) & (facing > _COSINE)
            weight = same * np.abs((x + 1 - 2 * across - place[..., 0]) * (y + 1 - 2 * down - place[..., 1]))
            total += weight[..., None] * np.where(same[..., None], values[at], 0.0)
            weights += weight
    found = np.zeros((height, width, 5))
    found[own] = total / np.maximum(weights, 1e-9)[:, None]
    return found[..., :3], found[..., 3], found[..., 4]
