"""The simulated device for rays answers as the model does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact_rays import mesh_of, outside_rays

from colonnade import UserError
from colonnade.rays import Scene, Sensor
from colonnade.rays.scene import ALL_MASKS, FAN, OCCLUDED, RANGES

#: The smallest design, and one of two columns and rows whose scene is in DRAM.
RAYS = ("frame.rays=true", "units.rayInterval=1", "units.pathContexts=256")
SMALL = (
    *("array.rows=2", "array.columns=2", "units.triangleRows=2"),
    'columnBvhMemory.cache={"lines":16,"ways":4,"misses":4,"sharedLines":32,"sharedWays":4,"sharedMisses":8,"busBytes":16}',
)


@pytest.mark.matrix
@pytest.mark.parametrize("settings", ((), SMALL), ids=("records in memory", "scene in DRAM"))
def test_hits_of_the_device_are_those_of_the_model(settings: tuple[str, ...]) -> None:
    vertices, faces = mesh_of("torus")
    model, device = scenes = [
        Scene(vertices, faces, "tiny", (*RAYS, *settings), backend=backend) for backend in ("model", "rtl")
    ]
    rays = outside_rays(vertices, 400, seed=4)

    def both(call: Any) -> None:
        wanted, found = map(call, scenes)
        assert np.asarray(wanted).size > 0
        assert (np.asarray(wanted) == np.asarray(found)).all()

    both(lambda scene: scene.closest(rays).t)
    both(lambda scene: scene.occluded(rays))
    both(lambda scene: scene.all(rays[:100]).face)
    both(lambda scene: scene.ranges(Sensor((0, 0, 5), (-3, 2, -10), (0.06, 0, 0), (0, -0.5, 0), 100, 8)))
    for mode in (0, RANGES, OCCLUDED, FAN):
        records = rays.astype(np.float32)[:, 4 if mode == FAN else 0 :]
        both(lambda scene, r=records, m=mode: scene.submit(r, len(r), m | ALL_MASKS << 24, rays[0, :3]))
    for scene in scenes:
        scene.set_mask(scene.add(vertices + 0.1, faces), 2)
    both(lambda scene: scene.closest(rays, mask=2).t)
    both(lambda scene: scene.closest(rays, mask=1).t)
    wanted, found = model.counters(), device.counters()
    assert [found[name] for name in ("rays", "raysRefused")] == [wanted[name] for name in ("rays", "raysRefused")]


def test_a_design_without_rays_is_refused() -> None:
    with pytest.raises(UserError, match="no rays of applications"):
        Scene(config="tiny", backend="rtl")
