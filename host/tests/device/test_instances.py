"""Scenes of instances in the model: order of hits, and hits, normals and starts of rays against double."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact_rays import truth
from instance_worlds import World, transform

from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import load_scene


def manifest_of(config: str) -> Manifest:
    return manifest_for(config, ("frame.instances=16",)).manifest


@pytest.mark.parametrize("count", [2, 8, 16])
def test_the_order_of_instances_changes_no_hit(count: int) -> None:
    """333,336 rays, each in three orders of the instances; of equal distances one may name another triangle."""
    random = np.random.default_rng(count)
    kinds = ("rigid", "scaled", "mirrored", "sheared")
    world = World(manifest_of("small"), [transform(random, kinds[i % 4], 1.5) for i in range(count)])
    starts, ways = world.rays(random, 1_000_000 // 9 + 1)
    first = world.nearest(starts, ways)
    assert 0.2 < (first["triangle"] >= 0).mean() < 1
    assert len(np.unique(first["instance"])) == count + 1
    for order in (range(count - 1, -1, -1), random.permutation(count)):
        world.renumber(list(order))
        again = world.nearest(starts, ways)
        np.testing.assert_array_equal(again["distance"], first["distance"])
        same = (again["triangle"] == first["triangle"]) & (again["instance"] == first["instance"])
        assert (~same).sum() <= 1


@pytest.mark.parametrize("config", ["small", "32b32s64d"])
@pytest.mark.parametrize("kind", ["rigid", "scaled", "mirrored", "sheared"])
def test_hits_are_those_of_the_placed_meshes(kind: str, config: str) -> None:
    random = np.random.default_rng(len(kind))
    world = World(manifest_of(config), [transform(random, kind) for _ in range(3)])
    starts, ways = world.rays(random, 3000)
    hits = world.nearest(starts, ways)
    dominant = np.abs(ways).max(axis=1)
    rays = np.hstack([starts, np.zeros((len(starts), 1)), ways, np.full((len(starts), 1), np.inf)]).astype(float)
    nearest = np.array([truth(*world.triangles(i), rays)[1] for i in range(world.count)]) * dominant
    least, expected = nearest.min(axis=0), nearest.argmin(axis=0)
    is_hit = np.isfinite(least)
    assert is_hit.sum() > 500
    assert (is_hit == (hits["triangle"] >= 0)).mean() > 0.998  # silhouettes
    both = is_hit & (hits["triangle"] >= 0)
    assert (hits["instance"] == expected)[both].mean() > 0.998
    same = both & (hits["instance"] == expected)
    unit = 2.0 ** world.numbers["gridFraction"]
    assert np.quantile(np.abs(hits["distance"] - least)[same], 0.99) < 4 * unit


@pytest.mark.parametrize("config", ["small", "16b16s32d"])
@pytest.mark.parametrize("kind", ["rigid", "scaled", "mirrored", "sheared"])
def test_a_ray_visits_each_instance_that_it_hits(kind: str, config: str) -> None:
    """Against boxes that hold the whole world, and boxes of a cell."""
    random = np.random.default_rng(len(kind))
    world = World(manifest_of(config), [transform(random, kind, 3.0) for _ in range(16)])
    starts, ways = world.rays(random, 100_000)
    hits = world.nearest(starts, ways)

    def within(last: int) -> dict[str, Any]:
        ends = {"low": 0, "high": last}
        boxes = {f"instances[{i}].box.{end}.{axis}": ends[end] for i in range(16) for end in ends for axis in "xyz"}
        world.model.start(world.registers | boxes)
        return world.nearest(starts, ways)

    every = within(127)
    for name in ("triangle", "instance", "distance"):
        np.testing.assert_array_equal(hits[name], every[name])
    assert (within(0)["triangle"] >= 0).sum() < 0.1 * (hits["triangle"] >= 0).sum()


def own_hits(kind: str, config: str, share: float) -> tuple[int, int]:
    """Rays that leave a convex object outward at `share` of the offset and meet it, and rays tried."""
    random = np.random.default_rng(len(kind) + len(config))
    world = World(manifest_of(config), [transform(random, kind, 0.7) for _ in range(2)], ("sphere:3", "cube"))
    starts, ways = world.rays(random, 20_000)
    world.model.start(world.registers | {"shading.offset": round(share * world.registers["shading.offset"])})
    hits = world.nearest(starts, ways)
    outside = hits["triangle"] >= 0
    outside &= (hits["normal"] * ways).sum(axis=1) < 0
    outward = np.zeros_like(ways, dtype=float)
    for i in range(world.count):
        vertices, faces = world.triangles(i)
        image = world.images[i]
        mine = outside & (hits["instance"] == i)
        ids = hits["triangle"][mine] - 2 * world.roots[i]
        corners = vertices[faces[image.source_faces[ids]]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        outward[mine] = normal * np.sign(np.linalg.det(np.array(world.instances[i].transform)[:3, :3]))
    outside &= (outward * ways).sum(axis=1) < 0
    outward = outward[outside] / np.linalg.norm(outward[outside], axis=1, keepdims=True)
    across = np.cross(outward, random.normal(size=outward.shape))
    slopes = 2.0**-9 + random.uniform(size=(len(outward), 1)) ** 4
    leaving = across / np.linalg.norm(across, axis=1, keepdims=True) + slopes * outward
    again = world.nearest(hits["start"][outside], np.rint(np.ldexp(leaving, 20)).astype(np.int64))
    return int((again["instance"] == hits["instance"][outside]).sum()), len(outward)


@pytest.mark.parametrize("config", ["small", "16b16s32d"])
@pytest.mark.parametrize("kind", ["rigid", "scaled", "mirrored", "sheared"])
def test_rays_that_leave_an_object_do_not_meet_it(kind: str, config: str) -> None:
    met, tried = own_hits(kind, config, 1.0)
    assert tried > 1000
    assert met == 0


def test_the_offset_is_needed() -> None:
    assert own_hits("sheared", "small", 0.0)[0] > 0


def test_a_shadow_ray_meets_what_a_nearest_ray_meets_before_the_light() -> None:
    """Objects that touch: frames lit from the side are the same in every order of instances."""
    random = np.random.default_rng(3)
    world = World(manifest_of("small"), [transform(random, "rigid", 0.4) for _ in range(4)])
    frames = []
    for order in ((0, 1, 2, 3), (3, 1, 0, 2)):
        world.renumber(order)
        frames.append(world.model.rows(0, 64))
    assert frames[0]["is_object"].mean() > 0.1
    np.testing.assert_array_equal(frames[0]["colour"], frames[1]["colour"])


def test_without_instances_the_registers_of_instances_change_nothing() -> None:
    world = World(manifest_of("small"), [np.eye(4)], ("sphere:2",))
    load_scene(world.model, world.images[0])
    world.model.start(world.base)
    before = world.model.rows(0, 64)
    world.model.start(world.registers | {"scene.instances": 0} | {k: world.base[k] for k in world.base})
    after = world.model.rows(0, 64)
    for name in before:
        np.testing.assert_array_equal(before[name], after[name])
