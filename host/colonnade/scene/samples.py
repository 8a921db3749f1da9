"""The samples of a frame: a point in pixel, shutter, lens and lights for each of its passes (docs/sampling.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from colonnade.common.types import Floats
from colonnade.mesh.materials.materials import Layer

#: A point of a disc of radius 1, or a shift in pixels: right and down.
Point = tuple[float, float]

#: The most gathered rays of a path.
MAX_GATHERED = 4


@dataclass(frozen=True)
class Sample:
    """Where one pass of a frame lies. The default is the only sample of a frame with one.

    Attributes:
        pixel: Shift of the rays from the pixels' centres, -0.5 to 0.5 pixels.
        time: Fraction of the shutter's opening, 0 to 1.
        lens: Point of the lens, a disc of radius 1.
        lights: Point of each light's disc of radius 1; missing ones are the centre.
        shares: Factor of each light, 0 where the pass has not got it; empty: see `Scene.light_share`.
        gather: Sample point of each gathered ray of a path, two bytes (docs/gather.md).
        layer: What the pass shows.
        coverage: Below it materials are there; None: of the only pass (`in_pass`).
    """

    pixel: Point = (0.0, 0.0)
    time: float = 0.5
    lens: Point = (0.0, 0.0)
    lights: tuple[Point, ...] = ()
    shares: tuple[float, ...] = ()
    gather: tuple[tuple[int, int], ...] = ((128, 128),) * MAX_GATHERED
    layer: Layer = "surface"
    coverage: float | None = None

    def coverage_of(self, entry: int) -> float | None:
        """The threshold of an entry of the material table: several entries' do not follow each other."""
        return None if self.coverage is None else (self.coverage + entry * _GOLDEN) % 1.0

    def light(self, index: int) -> Point:
        """The point of a light's disc."""
        return self.lights[index] if index < len(self.lights) else (0.0, 0.0)


#: Frames until their sample points of gathered rays repeat.
PERIOD = 16
#: Samples of a pixel in the photo of a room, unless the scene or the command names others.
PHOTO_SAMPLES = 4
#: Steps between numbers that are spread evenly: the golden ratio.
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
#: The middle of everything.
CENTRE = Sample()


@lru_cache(maxsize=2 * PERIOD)
def samples_of_frame(count: int, lights: int, number: int = 0) -> tuple[Sample, ...]:
    """The samples of a frame; but for the gathered rays they are the same for every frame with as many passes.

    Args:
        count: Number of samples, from 1.
        lights: Number of lights.
        number: Of the frame, below `PERIOD`: so many frames together have well-distributed points of gathered rays.
    """
    dimensions = 3 + lights + MAX_GATHERED
    pixel, time, lens, *others = (square_points(count, dimension) for dimension in range(dimensions))
    on_lights, gather = (
        others[:lights],
        [(256 * _shifted(points, number, ray)).astype(np.int64) for ray, points in enumerate(others[lights:])],
    )
    coverage = square_points(count, dimensions)[:, 0] if count > 1 else None
    return tuple(
        Sample(
            pixel=(float(pixel[index, 0] - 0.5), float(pixel[index, 1] - 0.5)),
            time=float(time[index, 0]),
            lens=disc_point(*lens[index]),
            lights=tuple(disc_point(*points[index]) for points in on_lights),
            gather=tuple((int(points[index, 0]), int(points[index, 1])) for points in gather),
            coverage=None if coverage is None else float(coverage[index]),
        )
        for index in range(count)
    )


def square_points(count: int, dimension: int) -> Floats:
    """Well-distributed points in the unit square, float64 [count, 2].

    On each axis there is one point in the middle of each of `count` equal intervals. If `count` is a power of two,
    there is also one in each of `count` equal rectangles, whatever their proportions.

    Args:
        count: Number of points, from 1.
        dimension: What the points are for. Each dimension has the same points in another order.
    """
    order = np.arange(count)
    if dimension > 0:
        # The legacy generator, since numpy guarantees its numbers for all time
        order = np.random.RandomState(dimension).permutation(count)
    sequence = np.array([_sobol(index) for index in range(count)], dtype=np.int64)
    ranks = np.argsort(np.argsort(sequence, axis=0), axis=0)
    return np.asarray((ranks[order] + 0.5) / count, dtype=np.float64)


def _shifted(points: Floats, number: int, dimension: int) -> Floats:
    """Points of the unit square, each moved within its interval as a frame's number has it; points of frame 0 stay."""
    places = square_points(PERIOD, dimension)
    return np.asarray((points + (places[number] - places[0]) / len(points)) % 1.0)


def _sobol(index: int) -> tuple[int, int]:
    """A point of Sobol's sequence in the first two dimensions, as fractions of 2^32."""
    x = y = 0
    bit, direction = 1 << 31, 1 << 31
    while index:
        if index & 1:
            x, y = x ^ bit, y ^ direction
        bit, direction, index = bit >> 1, direction ^ (direction >> 1), index >> 1
    return x, y


def disc_point(x: float, y: float) -> Point:
    """A point of the disc of radius 1 for one of the unit square, with equal areas (Shirley and Chiu 1997)."""
    a, b = 2.0 * float(x) - 1.0, 2.0 * float(y) - 1.0
    if a == 0.0 and b == 0.0:
        return 0.0, 0.0
    if abs(a) > abs(b):
        radius, angle = a, math.pi / 4 * (b / a)
    else:
        radius, angle = b, math.pi / 2 - math.pi / 4 * (a / b)
    return radius * math.cos(angle), radius * math.sin(angle)
