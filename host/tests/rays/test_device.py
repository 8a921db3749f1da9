"""The simulated device for rays answers as the model does."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from exact_rays import mesh_of, outside_rays

from colonnade import UserError
from colonnade.design.config_name import Overrides
from colonnade.rays import RayShell, Scene, Sensor
from colonnade.rays.device import RayBackend, RayDevice
from colonnade.rays.scene import ALL_DEVICE_MASKS, FAN, OCCLUDED, RANGES

#: The smallest design, and one of two columns and rows whose scene is in DRAM.
RAYS = ('queries={"contexts":256}', "units.rayInterval=1")
SMALL = (
    *("array.rows=2", "array.columns=2", "units.triangleRows=2"),
    'columnBvhMemory.cache={"lines":16,"ways":4,"misses":4,"sharedLines":32,"sharedWays":4,"sharedMisses":8,"busBytes":16}',
)


@pytest.mark.matrix
@pytest.mark.parametrize("device", (RayDevice, RayShell.simulated), ids=("device", "shell"))
@pytest.mark.parametrize("settings", ((), SMALL), ids=("records in memory", "scene in DRAM"))
def test_hits_of_the_device_are_those_of_the_model(
    settings: tuple[str, ...], device: Callable[[str, Overrides], RayBackend]
) -> None:
    vertices, faces = mesh_of("torus")
    design: tuple[str, Overrides] = ("tiny", (*RAYS, *settings))
    answering = device(*design)
    scenes = [Scene(vertices, faces, *design), Scene(vertices, faces, *design, backend=answering)]
    rays = outside_rays(vertices, 400, seed=4)

    def both(call: Any) -> None:
        wanted, found = map(call, scenes)
        assert np.asarray(wanted).size > 0
        assert (np.asarray(wanted) == np.asarray(found)).all()

    both(lambda scene: scene.closest(rays).t)
    counted = [[scene.counters()[name] for name in ("rays", "raysRefused")] for scene in scenes]
    assert counted[0] == counted[1]
    # A device does not name the face of an occluded ray: it is asked for the closest one
    both(lambda scene: scene.occluded(rays))
    both(lambda scene: scene.all(rays[:100]).face)
    both(lambda scene: scene.ranges(Sensor((0, 0, 5), (-3, 2, -10), (0.06, 0, 0), (0, -0.5, 0), 100, 8)))
    for mode in (0, RANGES, OCCLUDED, FAN):
        records = rays.astype(np.float32)[:, 4 if mode == FAN else 0 :]
        both(lambda scene, r=records, m=mode: scene.submit(r, len(r), m | ALL_DEVICE_MASKS, rays[0, :3]))
    for scene in scenes:
        scene.set_mask(scene.add(vertices + 0.1, faces), 2)
    both(lambda scene: scene.closest(rays, mask=2).t)
    both(lambda scene: scene.closest(rays, mask=1).t)


@pytest.mark.matrix
def test_refused_batches_stop_no_later_ones() -> None:
    vertices, faces = mesh_of("torus")
    rays = outside_rays(vertices, 200, seed=4).astype(np.float32)
    device = RayShell.simulated("tiny", RAYS)
    scenes = [Scene(vertices, faces, "tiny", RAYS, backend=backend) for backend in ("model", device)]
    wanted, found = (scene.submit(rays, len(rays), ALL_DEVICE_MASKS) for scene in scenes)
    assert (wanted == found).all()

    def batch(mode: int, count: int) -> tuple[bytes, bytes, int]:
        words = struct.pack("<QQII5fIQQ", 0, 0, count, mode | ALL_DEVICE_MASKS, 0, 0, 0, 0, 0, count, 0, 0)
        return words, rays.tobytes(), 16 * len(rays)

    refused = [batch(3, 199), batch(0, 0), batch(1 << 12, 198)]
    answers = device.run([batch(0, 200), *refused, batch(0, 200), batch(RANGES, 7)])
    assert [tag for tag, _ in answers] == [200, 199 | 1 << 31, 1 << 31, 198 | 1 << 31, 200, 7]
    assert answers[0][1] == answers[4][1] == wanted.tobytes()
    assert answers[5][1][:56] == wanted.reshape(-1, 16)[:7, :8].tobytes()


def test_a_design_without_rays_is_refused() -> None:
    with pytest.raises(UserError, match="no rays of applications"):
        Scene(config="tiny", backend="rtl")
