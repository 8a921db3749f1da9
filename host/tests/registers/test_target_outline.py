"""The outline that the target computes: no ray that may hit the object is outside."""

from __future__ import annotations

from typing import Any

import numpy as np
from target_views import EDGES, POSES, Design, both, random_poses

from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model


def test_the_rectangle_contains_that_of_the_host(design: Design) -> None:
    """It is a pixel larger at most; the host gives the whole frame wherever the target does."""
    for found, expected in both(design, POSES, 2, nearest=0.2):
        ours, theirs = (
            [registers[f"frame.objectRect.{edge}"] for edge in ("x0", "y0", "x1", "y1")]
            for registers in (found, expected)
        )
        if ours == [0, 0, 0, 0] or theirs == [0, 0, 0, 0]:
            assert (ours[2] - ours[0]) <= 4 or (theirs[2] - theirs[0]) <= 4 or ours == theirs
        else:
            assert np.abs(np.subtract(ours, theirs)).max() <= 1, (ours, theirs)


def pixels_of_box(registers: dict[str, int], manifest: Manifest) -> Any:
    """Whether the ray of each pixel enters the object's padded box, bool [height, width], by float slabs."""
    numbers = manifest.numbers
    vector = lambda name: np.array([float(registers[f"{name}.{axis}"]) for axis in "xyz"])  # noqa: E731
    origin = vector("camera.position") * 2.0 ** (registers["frame.unitShift"] - numbers["gridFraction"])
    x, y = np.meshgrid(np.arange(registers["frame.width"]), np.arange(registers["frame.height"]))
    rays = vector("camera.direction") * 2.0 ** registers["camera.stepShift"]
    rays = rays + x[..., None] * vector("camera.stepX") + y[..., None] * vector("camera.stepY")
    pad = 2.0 ** numbers["boxPadLog"]
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = np.stack([(vector("bounds.low") - pad - origin) / rays, (vector("bounds.high") + pad - origin) / rays])
    enters, leaves = planes.min(axis=0).max(axis=-1), planes.max(axis=0).min(axis=-1)
    return np.maximum(enters, 0) <= leaves


def pixels_of_outline(registers: dict[str, int]) -> Any:
    """Whether rectangle and outline admit each pixel, bool [height, width]."""
    x, y = np.meshgrid(np.arange(registers["frame.width"]), np.arange(registers["frame.height"]))
    x0, y0, x1, y1 = (registers[f"frame.objectRect.{edge}"] for edge in EDGES)
    admitted = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
    for edge in range(6):
        a, b, offset = (registers[f"frame.objectOutline[{edge}].{part}"] for part in ("x", "y", "offset"))
        admitted &= a * x + b * y + offset >= 0
    return admitted


def test_no_ray_that_enters_the_box_is_outside_the_outline(design: Design) -> None:
    """Also where the box reaches behind the camera, or all of it lies there."""
    seen = admitted = whole_frames = 0
    for found, expected in both(design, POSES, 3, nearest=0.05):
        in_box, in_outline = pixels_of_box(found, design.manifest), pixels_of_outline(found)
        assert not (in_box & ~in_outline).any()
        seen, admitted = seen + in_box.sum(), admitted + in_outline.sum()
        whole_frames += pixels_of_outline(expected).all()
    print(f"{seen} pixels show the box, all are inside; the outline admits {admitted}")
    assert 0 < seen <= admitted < 1.5 * seen, "the outline excludes most of the rest"
    assert whole_frames > 0


def test_frames_with_the_outline_are_those_of_the_whole_frame(small_design: Design) -> None:
    """The model's frames are the same, pixel for pixel, with the outline and without."""
    random, target = np.random.default_rng(4), small_design.target()
    manifest, image = small_design.manifest, small_design.image
    objects = admitted = 0
    frames = max(8, POSES // 20)
    for index in range(frames):
        random_poses(small_design, random, (0.7, 0.1)[index % 2], (80, 60)).give(target)
        registers = target.registers()
        whole = registers | {name: 0 for name in registers if "objectOutline" in name}
        whole |= {
            f"frame.objectRect.{name}": value
            for name, value in zip(("x0", "y0", "x1", "y1"), (0, 0, 80, 60), strict=True)
        }
        frame, expected = render_model(manifest, image, registers), render_model(manifest, image, whole)
        np.testing.assert_array_equal(frame.colour, expected.colour)
        np.testing.assert_array_equal(frame.triangle, expected.triangle)
        np.testing.assert_array_equal(frame.is_object, expected.is_object)
        objects += expected.is_object.sum()
        admitted += pixels_of_outline(registers).sum()
    assert 0 < objects <= admitted < 0.9 * 80 * 60 * frames
