"""Cameras at the ends of the range of floating-point numbers."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade.scene.cameras import camera_axes
from colonnade.scene.object_pose import rotation_about


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("length", [5e-324, 1e-320, 1e-200, 1.0, 1e12])
def test_the_length_of_a_direction_does_not_matter(length: float) -> None:
    """Neither the view's nor up's."""
    axes = np.stack(camera_axes(np.array([length, 0.0, 0.0]), (0.0, length, 0.0)))
    assert axes.tolist() == [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("length", [5e-324, 1e-320, 1.0, 1e12])
def test_the_length_of_an_axis_does_not_matter(length: float) -> None:
    turned = rotation_about((0.0, length, 0.0), 90.0) @ np.array([1.0, 0.0, 0.0])
    assert turned.tolist() == pytest.approx([0.0, 0.0, -1.0])
