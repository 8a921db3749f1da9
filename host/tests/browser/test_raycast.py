"""Ray casts of `rays.js`, with three-mesh-bvh's interface, equal Python's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from built_page import FILE, run_node
from exact_rays import mesh_of, outside_rays

from colonnade.rays import Scene
from colonnade.rays.scene import ALL_MASKS, CULL_BACK, CULL_FRONT

MODULE = FILE.with_name("rays.js")
#: The mode of each `side` of three.js.
SIDES = {0: CULL_BACK, 1: CULL_FRONT, 2: 0}
pytestmark = pytest.mark.skipif(not MODULE.is_file(), reason="rays.js is not built: run `make browser`")


def test_casts_are_those_of_python(tmp_path: Path) -> None:
    vertices, faces = mesh_of("torus")
    rays = outside_rays(vertices, 300, seed=7)
    rays[:, 4:7] *= 2
    rays[::5, 3], rays[::7, 7] = 3.6, 4.2
    for name, values in (("vertices", vertices), ("faces", faces.astype("<u4")), ("rays", rays)):
        values.tofile(tmp_path / f"{name}.bin")
    run_node("rays.mjs", tmp_path, {"module": str(MODULE), "sides": list(SIDES)})
    result = json.loads((tmp_path / "hits.json").read_text())

    scene, length = Scene(vertices, faces), np.linalg.norm(rays[:, 4:7], axis=1)
    limited = rays.copy()
    limited[:, [3, 7]] /= length[:, None]
    for (side, mode), casts in zip(SIDES.items(), result["found"], strict=True):
        hits, first = scene.all(limited, mode, ALL_MASKS), scene.closest(limited, mode)
        for i, cast in enumerate(casts):
            own = hits.ray == i
            assert [each["faceIndex"] for each in cast["all"]] == hits.face[own].tolist(), (side, i)
            np.testing.assert_allclose([each["distance"] for each in cast["all"]], hits.t[own] * length[i], rtol=1e-15)
            assert (cast["first"] or {"faceIndex": -1})["faceIndex"] == first.face[i]
        assert hits.ray.size > 100
    hit = result["again"]
    point = [hit["point"][axis] for axis in "xyz"]
    np.testing.assert_allclose(point, rays[0, :3] + hit["distance"] / length[0] * rays[0, 4:7])
    corners = vertices[[hit["face"][corner] for corner in "abc"]]
    np.testing.assert_allclose(np.array([hit["barycoord"][axis] for axis in "xyz"]) @ corners, point, atol=1e-9)
    np.testing.assert_allclose([hit["uv"][axis] for axis in "xy"], point[:2], atol=1e-9)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    np.testing.assert_allclose([hit["face"]["normal"][axis] for axis in "xyz"], normal / np.linalg.norm(normal))
    assert result["refusals"] == [
        "face 0 names vertex 1000000 of 1152",
        "the side is none of 0, 1, 2: give that of one material",
    ]
