"""A spinning LiDAR in a street: ranges of its beams by `colonnade.rays`, and a picture of the points (docs/rays.md).

Usage: python examples/rays/lidar.py [--output PICTURE] [--beams N] [--columns N] [--config DESIGN]
                                     [--backend model | simulated]   simulated: a small device in its shell, on a bus
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from colonnade.common.atomic_files import replacing
from colonnade.common.processes import tool
from colonnade.mesh.geometry import primitives
from colonnade.rays import RayShell, Scene
from numpy.typing import NDArray
from PIL import Image

Floats = NDArray[np.float64]
#: What answers the rays, and the design that it has unless another is named; a simulator of few units is built soon.
BACKENDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "model": ("edge", ()),
    "simulated": ("traversal", ("array.rows=4", "array.columns=2", "units.triangleRows=4")),
}
#: Place of the sensor and its reach, metres; elevations of its lowest and highest beam, degrees.
SENSOR, REACH, ELEVATIONS = (0.0, 0.0, 1.8), 120.0, (-24.8, 2.0)
#: The camera of the picture and what it looks at, metres; half of its width at distance 1.
EYE, TARGET, SLOPE = (-31.0, -24.0, 25.0), (7.0, 2.0, 0.0), 0.62
SIZE, GROUND = (960, 540), (16, 18, 24)


def street() -> tuple[Floats, NDArray[np.int64]]:
    """Vertices [n, 3], metres, z up, and faces [m, 3]: two rows of houses and trees, and cars."""
    random = np.random.default_rng(5)
    parts: list[tuple[Floats, NDArray[np.int32]]] = []

    def add(shape: primitives.Geometry, half: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        # Shapes fill a cube of edge 2 and stand on y
        vertices = shape[0][:, [2, 0, 1]] * half + np.add(place, (0.0, 0.0, half[2]))
        parts.append((vertices, shape[1]))

    add(primitives.cube(), (100.0, 100.0, 0.1), (0.0, 0.0, -0.2))
    for side in (-1.0, 1.0):
        for x in np.arange(-80.0, 81.0, 16.0):
            width, depth, height = random.uniform((5, 4, 3), (7, 6, 6))
            y = side * (10.0 + depth)
            add(primitives.cube(), (width, depth, height), (x, y, 0.0))
            add(primitives.octahedron(), (1.2 * width, 1.2 * depth, 3.0), (x, y, 2 * height - 3.0))
            tree = (x + 8.0, side * 7.0, 0.0)
            add(primitives.cylinder(12), (0.3, 0.3, 1.2), tree)
            add(primitives.rock(320), (1.6, 1.6, 2.0), (*tree[:2], 2.0))
        for x in np.arange(-58.0, 60.0, 13.0) + random.uniform(-3, 3, 10):
            car = (x + 6.0, side * 4.5, 0.3)
            add(primitives.cube(), (2.1, 0.9, 0.4), car)
            add(primitives.sphere(2), (1.3, 0.8, 0.6), (car[0] - 0.2, car[1], 0.6))
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces.astype(np.int64) + first for (_, faces), first in zip(parts, counts, strict=False)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def turn(beams: int, columns: int) -> Floats:
    """Rays [columns · beams, 8] of a turn, column by column: their t are metres."""
    up, around = np.radians(np.linspace(*ELEVATIONS, beams)), 2 * np.pi * np.arange(columns) / columns
    around, up = (angle.ravel() for angle in np.meshgrid(around, up, indexing="ij"))
    rays = np.zeros((columns * beams, 8))
    rays[:, :3], rays[:, 7] = SENSOR, REACH
    rays[:, 4:7] = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=1)
    return rays


def picture(points: Floats) -> NDArray[np.uint8]:
    """Points as the camera sees them, coloured by height: uint8 [height, width, 3]."""
    forward = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.cross(forward, (0, 0, 1)) / np.linalg.norm(np.cross(forward, (0, 0, 1)))
    at = (points - EYE) @ np.stack([right, np.cross(forward, right), forward], axis=1)
    order = np.argsort(-at[:, 2])
    at, height = at[order], points[order, 2]
    column, row = (np.array(SIZE) / 2 + at[:, :2] / at[:, 2:] * SIZE[0] / (2 * SLOPE)).astype(int).T
    stops = np.array([[60, 90, 200], [40, 200, 190], [250, 210, 70], [240, 90, 60]])
    colours = np.stack([np.interp(height, (0, 1.5, 4, 9), stop) for stop in stops.T], axis=1)
    pixels = np.full((SIZE[1], SIZE[0], 3), GROUND, dtype=np.uint8)
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        visible = (at[:, 2] > 0) & (column + x >= 0) & (column + x < SIZE[0]) & (row + y >= 0) & (row + y < SIZE[1])
        pixels[(row + y)[visible], (column + x)[visible]] = colours[visible]
    return pixels


def main() -> None:
    """Trace a turn, print what it found, draw it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("lidar.png"))
    parser.add_argument("--beams", type=int, default=64)
    parser.add_argument("--columns", type=int, default=2048)
    parser.add_argument("--config")
    parser.add_argument("--backend", choices=BACKENDS, default="model")
    options = parser.parse_args()
    config, overrides = (options.config, ()) if options.config else BACKENDS[options.backend]
    shell = RayShell.simulated(config, overrides) if options.backend == "simulated" else None
    scene = Scene(*street(), config, overrides, backend=shell or "model")
    rays = turn(options.beams, options.columns)
    hits = scene.closest(rays)
    found = hits.face >= 0
    if shell is not None:
        counters = shell.counters()
        print(f"{counters['rays']:,} rays in {counters['cycles']:,} cycles of the device")
    print(f"{found.sum():,} of {len(rays):,} rays hit, {hits.t[found].min():.2f} to {hits.t[found].max():.2f} m")
    print(f"a vertex unit is {1000 * scene.unit:.1f} mm")
    with replacing(options.output) as stream:
        Image.fromarray(picture(rays[found, :3] + hits.t[found, None] * rays[found, 4:7])).save(stream, format="png")


if __name__ == "__main__":
    tool(main)
