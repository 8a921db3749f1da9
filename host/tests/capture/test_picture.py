"""Depth of a frame in the size of maps."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade.capture.picture import fitted
from colonnade.capture.source import Frame, Lens
from colonnade.common.types import Floats


def fitted_depth(depth: Floats, photo: tuple[int, int], size: tuple[int, int]) -> Floats:
    """Depth of a photo, rows and columns, at the pixels of maps, width and height."""
    frame = Frame(0, 0.0, np.zeros((*photo, 3), np.uint8), depth, Lens(1.0, 1.0, 0.0, 0.0), np.eye(4)[:3])
    return fitted(frame, *size).depth


def pixels(count: int, size: int) -> Floats:
    """Centres of pixels, as shares of a picture."""
    return (np.arange(count) + 0.5) / size


@pytest.mark.parametrize(("photo", "size"), [((96, 128), (64, 48)), ((480, 640), (320, 240)), ((30, 200), (20, 20))])
def test_a_plane_stays_a_plane(photo: tuple[int, int], size: tuple[int, int]) -> None:
    rows, columns = 24, 32

    def plane(u: Floats, v: Floats) -> Floats:
        return 1 / (0.3 + 0.1 * u[np.newaxis, :] - 0.05 * v[:, np.newaxis])

    width, height = size
    scale = min(photo[1] / width, photo[0] / height)
    left, top = (photo[1] - scale * width) / 2, (photo[0] - scale * height) / 2
    # Outside the centres of the outermost samples the depth is the edge's
    u = ((left + (np.arange(width) + 0.5) * scale) / photo[1]).clip(0.5 / columns, 1 - 0.5 / columns)
    v = ((top + (np.arange(height) + 0.5) * scale) / photo[0]).clip(0.5 / rows, 1 - 0.5 / rows)
    depth = plane(pixels(columns, columns), pixels(rows, rows))
    np.testing.assert_allclose(fitted_depth(depth, photo, size), plane(u, v), rtol=1e-12)


def test_no_depth_between_two_surfaces_and_none_from_holes() -> None:
    random = np.random.default_rng(5)
    depth = np.where(random.random((40, 50)) < 0.5, 1.0, 3.0)
    depth[random.random(depth.shape) < 0.2] = 0
    depth[0, :3] = np.nan, np.inf, -1.0
    found = fitted_depth(depth, (120, 150), (75, 60))
    assert set(np.unique(found.round(12))) == {0.0, 1.0, 3.0}
    assert np.count_nonzero(found == 0) == pytest.approx(0.2 * found.size, rel=0.2)


def test_one_sample_is_the_depth_of_all_pixels() -> None:
    assert (fitted_depth(np.array([[2.0]]), (12, 16), (8, 6)) == 2).all()
