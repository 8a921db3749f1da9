"""Reads of rays through the caches of a design."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from exact_rays import Floats, mesh_of, outside_rays

from colonnade import UserError, _core
from colonnade.design.generator import manifest_for
from colonnade.rays import Scene
from colonnade.rays.scene import ALL_MASKS, design_text
from colonnade.rays.traffic import cache_shape

VERTICES, FACES = mesh_of("torus")


@pytest.fixture(scope="module")
def rays() -> _core.Rays:
    rays = _core.Rays(design_text(manifest_for("edge").manifest))
    rays.add(VERTICES, FACES.astype(np.uint32))
    rays.commit()
    return rays


def reads(rays: _core.Rays, some: Floats, columns: int, flight: int, caches: Sequence[int]) -> tuple[int, int]:
    """Records and lines; a cache has lines and ways, first a column's."""
    found = rays.traffic(some, 0, ALL_MASKS, False, [columns, flight, *caches, 4])
    return found["reads"], found["lines"]


def test_one_ray_in_flight_reads_each_record_itself(rays: _core.Rays) -> None:
    some, before = outside_rays(VERTICES, 200, seed=1), rays.counters()
    records, lines = reads(rays, some, 1, 1, (128, 4, 1152, 9))
    tested = {name: rays.counters()[name] - before[name] for name in ("nodeReads", "triangleTests")}
    # A record has up to two triangles
    assert tested["nodeReads"] + tested["triangleTests"] / 2 <= records <= sum(tested.values())
    assert 0 < lines <= 400 and reads(rays, some, 1, 1, (4, 4, 0, 1))[1] > lines


def test_equal_rays_in_flight_share_their_reads(rays: _core.Rays) -> None:
    ray, caches = outside_rays(VERTICES, 1, seed=2), (128, 4, 1152, 9)
    records, lines = reads(rays, ray, 1, 1, caches)
    repeated = np.repeat(ray, 120, axis=0)
    assert reads(rays, repeated, 1, 120, caches) == (records, lines)
    assert reads(rays, repeated, 2, 64, caches) == (2 * records, lines)
    assert reads(rays, repeated, 2, 64, (128, 4, 0, 1)) == (2 * records, 2 * lines)


def test_an_order_saves_reads_from_dram(rays: _core.Rays) -> None:
    random = np.random.default_rng(3)
    corners = VERTICES[FACES[random.integers(len(FACES), size=3000)]]
    some = np.zeros((3000, 8))
    some[:, :3], some[:, 4:7], some[:, 7] = corners.mean(axis=1), random.normal(size=(3000, 3)), 0.1
    given = reads(rays, some, 8, 8, (16, 4, 16, 4))
    ordered = reads(rays, np.ascontiguousarray(some[rays.order(some)]), 8, 8, (16, 4, 16, 4))
    assert ordered[0] < given[0] and 1.5 * ordered[1] < given[1], (ordered, given)


def test_the_caches_are_those_of_the_design() -> None:
    assert cache_shape(manifest_for("edge").manifest) == ([8, 120, 320, 5, 4096, 16, 2], 64)
    traffic = Scene(VERTICES, FACES).traffic(outside_rays(VERTICES, 50, seed=4), is_occlusion=True)
    assert traffic.records > 100 and traffic.bytes % 64 == 0
    with pytest.raises(UserError, match="no caches: choose one whose scene is in DRAM, such as edge"):
        Scene(VERTICES, FACES, "small").traffic([[0, 0, 5, 0, 0, 0, -1, np.inf]])
