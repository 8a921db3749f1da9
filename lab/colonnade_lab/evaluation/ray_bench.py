"""Rays a cycle of the simulated device for rays, by kind (docs/rays.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from colonnade.common.progress import QUIET, Progress
from colonnade.mesh.materials.mesh import Mesh
from colonnade.rays import Scene, Sensor
from colonnade.rays.scene import ALL_DEVICE_MASKS, OCCLUDED, RANGES, SENSOR
from numpy.typing import NDArray

from colonnade_lab.evaluation.rays import rays_of_kind

#: Kinds of batches.
KINDS = (
    "sensor, ranges",
    "sensor's rays from memory, hits",
    "occlusion, in order",
    "off the surface, shuffled, hits",
    "from around, shuffled, hits",
)
#: Columns of the sensor; counters of what a ray reads.
_WIDTH, _READS = 512, ("nodeReads", "triangleTests")


@dataclass(frozen=True)
class DeviceRates:
    """A batch of a kind.

    Attributes:
        kind: Its name.
        cycles: Cycles of the device, from an idle device to the last hit in memory.
        rays_per_cycle: Of all rays.
        in_box: The same of rays that enter the box of the mesh.
        node_reads: Nodes that a ray reads.
        triangle_tests: Triangles that a ray tests.
    """

    kind: str
    cycles: int
    rays_per_cycle: float
    in_box: float
    node_reads: float
    triangle_tests: float


def sensor_of(mesh: Mesh, count: int) -> Sensor:
    """A sensor of `count` rays, rounded up to whole rows, whose picture is the mesh's box; two edges away."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    width, height, depth = high - low
    rows, away = -(-count // _WIDTH), 2 * max(width, height, depth)
    origin = (low[0] + width / 2, low[1] + height / 2, high[2] + away)
    return Sensor(origin, (-width / 2, height / 2, -away), (width / _WIDTH, 0, 0), (0, -height / rows, 0), _WIDTH, rows)


def batches_of(mesh: Mesh, scene: Scene, count: int) -> dict[str, tuple[Callable[[Scene], NDArray[np.uint8]], int]]:
    """Each of `KINDS`: what runs its batch in a scene of the mesh and returns the bytes of its hits, and its rays.

    Args:
        mesh: The mesh.
        scene: A scene of it, which orders the rays.
        count: Rays of a kind; of a sensor, rounded up to whole rows.
    """
    sensor = sensor_of(mesh, count)
    y, x = np.mgrid[: sensor.height, : sensor.width].reshape(2, -1, 1)
    ways = np.array(sensor.corner) + x * np.array(sensor.right) + y * np.array(sensor.down)
    ends = np.zeros((len(ways), 1))
    camera = np.hstack([np.zeros_like(ways) + sensor.origin, ends, ways, ends + np.inf])
    occlusion = rays_of_kind("occlusion", mesh, count)
    masks = ALL_DEVICE_MASKS

    def of_memory(rays: np.ndarray, mode: int = 0) -> Callable[[Scene], NDArray[np.uint8]]:
        return lambda scene: scene.submit(rays.astype(np.float32), len(rays), mode | masks)

    def of_sensor(scene: Scene) -> NDArray[np.uint8]:
        return scene.submit(sensor.record(), len(ways), masks | SENSOR | RANGES, sensor.origin)

    found = (
        (of_sensor, len(ways)),
        (of_memory(camera), len(ways)),
        (of_memory(occlusion[scene.order(occlusion)], OCCLUDED), count),
        (of_memory(rays_of_kind("off the surface, shuffled", mesh, count)), count),
        (of_memory(rays_of_kind("outside, shuffled", mesh, count)), count),
    )
    return dict(zip(KINDS, found, strict=True))


def measured(
    mesh: Mesh,
    config: str,
    overrides: tuple[str, ...],
    count: int,
    options: Sequence[str] = (),
    progress: Progress = QUIET,
) -> Iterator[DeviceRates]:
    """Rates of each kind. The caches are as the batch before has left them."""
    from colonnade.rays.device import RayDevice

    device = RayDevice(config, overrides, options, progress)
    scene = Scene(mesh.vertices, mesh.faces, config, overrides, backend=device)
    for kind, (run, rays) in batches_of(mesh, scene, count).items():
        before = device.counters()
        run(scene)
        found = {name: value - before[name] for name, value in device.counters().items()}
        reads = (found[name] / rays for name in _READS)
        yield DeviceRates(kind, found["cycles"], rays / found["cycles"], found["raysInBox"] / found["cycles"], *reads)
