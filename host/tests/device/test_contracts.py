"""The model's geometry against exact integers: watertight edges and conservative boxes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from leaves import packed_triangles

from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import load_scene, new_model
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene_image.packer import pack

Integers = npt.NDArray[np.int64]
PRECISIONS = ("small", "32b32s64d", "24b24s48d", "16b16s32d")


def loaded_model(
    mesh: str, precision: str, *overrides: str, materials: int = 1, children: int = 4
) -> tuple[Any, Any, Manifest]:
    """The model with a mesh whose faces have so many materials in turn."""
    manifest = manifest_for(precision, overrides).manifest
    loaded = load_mesh(mesh)
    of_faces = (np.arange(len(loaded.faces)) % materials).astype(np.uint8)
    colours = tuple(replace(loaded.materials[0], albedo=(0.5 / (1 + k),) * 3) for k in range(materials))
    image = pack(replace(loaded, materials=colours, face_materials=of_faces), manifest, children=children)
    model = new_model(manifest)
    load_scene(model, image)
    model.start(frame_registers(Scene(MeshSource(name=mesh)), image.header, manifest, 64, 64))
    return model, image, manifest


def grid_vertices(image: Any, manifest: Manifest) -> Integers:
    """Corners of all packed triangles on the hardware's grid, int64 [n, 3, 3]."""
    shift = manifest.numbers["gridFraction"]
    _, units = packed_triangles(image, manifest)
    return units << shift if shift >= 0 else np.rint(units / 2.0**-shift).astype(np.int64)


def inner_points(corners: Integers, count: int, random: np.random.Generator) -> Integers:
    """Grid points slightly inside a closed mesh, below random triangles, int64 [count, 3]."""
    triangles = corners[random.integers(len(corners), size=count)].astype(np.float64)
    outward = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    edge = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    depth = random.uniform(0.01, 0.05, size=(count, 1)) * edge
    return np.rint(triangles.mean(axis=1) - depth * outward).astype(np.int64)


def points_on_edges(corners: Integers, count: int, random: np.random.Generator) -> Integers:
    """Vertices, and grid points exactly at quarters of edges, int64 [count, 3]."""
    triangles = corners[random.integers(len(corners), size=count)]
    quarters = (triangles[:, 1] - triangles[:, 0]) * random.integers(0, 5, size=(count, 1))
    return triangles[:, 0] + np.where((quarters % 4 == 0).all(axis=1, keepdims=True), quarters // 4, 0)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("mesh", ("sphere:4", "torus"))
def test_no_ray_from_inside_slips_through_an_edge_or_a_vertex(mesh: str, precision: str) -> None:
    """In total 100,000 rays from inside closed meshes, aimed exactly at vertices and edges."""
    model, image, manifest = loaded_model(mesh, precision)
    random = np.random.default_rng(len(mesh))
    corners = grid_vertices(image, manifest)
    count = 100_000 // (2 * len(PRECISIONS)) + 1
    origins, targets = inner_points(corners, count, random), points_on_edges(corners, count, random)
    assert int((model.trace(origins, targets - origins) < 0).sum()) == 0


@pytest.mark.parametrize("materials", [1, 2])
def test_ties_fall_the_same_way_with_and_without_a_tree(materials: int) -> None:
    """Rays meet edges and vertices, where triangles of two materials are at one distance."""
    found = []
    for bvh in ("true", "false"):
        model, image, manifest = loaded_model("sphere:3", "small", f"geometry.bvh={bvh}", materials=materials)
        corners = grid_vertices(image, manifest)
        corners = corners[np.lexsort(corners.reshape(len(corners), -1).T)]
        random = np.random.default_rng(materials)
        origins, targets = inner_points(corners, 2000, random), points_on_edges(corners, 2000, random)
        hits = model.trace(origins, targets - origins)
        assert (hits >= 0).all()
        found.append(image.source_faces[hits])
    np.testing.assert_array_equal(found[0], found[1])


def test_a_binary_tree_has_the_hits_of_a_wide_one() -> None:
    found = []
    for children in (2, 4):
        model, image, _ = loaded_model("sphere:3", "small", children=children)
        random = np.random.default_rng(7)
        origins = random.integers(0, 1 << 20, size=(2000, 3))
        hits = model.trace(origins, random.integers(-(1 << 20), 1 << 20, size=(2000, 3)))
        found.append(np.where(hits < 0, -1, image.source_faces[hits]))
    assert (found[0] >= 0).sum() > 1000
    np.testing.assert_array_equal(found[0], found[1])


def wrongly_culled(count: int, precision: str, seed: int) -> tuple[int, int]:
    """Random rays against random boxes, including flat boxes, axis-parallel rays and origins on slabs.

    Returns:
        Number of boxes that rays hit in exact arithmetic but the box test culls, and number of all boxes hit.
    """
    model, _, manifest = loaded_model("cube", precision)
    numbers = manifest.numbers
    random = np.random.default_rng(seed)
    cube, fraction = 1 << numbers["vertexBits"], numbers["gridFraction"]
    extent = (random.integers(0, cube, size=(count, 3)) >> random.integers(0, 17, size=(count, 1))) * (
        random.random((count, 3)) > 0.1
    )
    low = (random.random((count, 3)) * (cube - 1 - extent)).astype(np.int64)
    box_bits = manifest.config["geometry"]["boxBits"]
    exponents = np.zeros_like(extent)
    while (too_wide := (-(-extent >> exponents) > (1 << box_bits) - 1)).any():
        exponents += too_wide
    # The child begins at any plane of a node whose axes may be coarser than it needs
    highest = (1 << box_bits) - 1
    coarser = random.integers(0, 4, size=(count, 3)) * (random.random((count, 3)) < 0.3)
    exponents = np.minimum(exponents + coarser, numbers["maxExponent"])
    high = -(-extent >> exponents)
    first = (random.random((count, 3)) * (np.minimum(highest - high, low >> exponents) + 1)).astype(np.int64)
    corner = low - (first << exponents)
    # Rays aim at points in or near their box from various distances; some are parallel to an axis or start on a plane
    target = (
        low
        + random.integers(-1, 2, size=(count, 3)) * (extent // 8)
        + (random.random((count, 3)) * (extent + 1)).astype(np.int64)
    )
    start = random.integers(-cube // 2, cube + cube // 2, size=(count, 3))
    start = np.where(random.random((count, 3)) < 0.15, target, start)
    start = np.where(random.random((count, 3)) < 0.05, low, start)

    def to_grid(units: Integers) -> Integers:
        return units << fraction if fraction >= 0 else units >> -fraction

    origins = to_grid(start)
    directions = to_grid(target) - origins + random.integers(-2, 3, size=(count, 3))
    result = model.test_boxes(origins, directions, corner, exponents, first, first + high)
    planes = low, low + (high << exponents)
    met = [i for i in np.flatnonzero(result["enters"]) if meets(result, i, planes, numbers)]
    return int((~result["is_hit"][met]).sum()), len(met)


def meets(result: dict[str, Any], i: int, planes: tuple[Integers, Integers], numbers: dict[str, int]) -> bool:
    """Whether the prepared ray O + t·S, t ≥ 0, hits the box in exact arithmetic (rationals as integer pairs)."""
    axis, *negative = (int(v) for v in result["heading"][i])
    order = [(axis + 1) % 3, (axis + 2) % 3, axis]
    fraction, one = numbers["gridFraction"], 1 << numbers["shearFraction"]
    slopes = [int(result["shear"][i][0]), int(result["shear"][i][1]), -one if negative[2] else one]
    first, last = (0, 1), None
    for a in range(3):
        # In grid steps, or in units if they are finer
        scale, origin = 1 << max(0, fraction), int(result["origin"][i][a]) << max(0, -fraction)
        low, high = int(planes[0][i][order[a]]) * scale - origin, int(planes[1][i][order[a]]) * scale - origin
        slope = slopes[a]
        if slope == 0:
            if low > 0 or high < 0:
                return False
            continue
        near, far = ((low, slope), (high, slope)) if slope > 0 else ((-high, -slope), (-low, -slope))
        if near[0] * first[1] > first[0] * near[1]:
            first = near
        if last is None or far[0] * last[1] < last[0] * far[1]:
            last = far
    assert last is not None
    return first[0] * last[1] <= last[0] * first[1]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_box_that_a_ray_hits_is_culled(precision: str) -> None:
    culled, met = wrongly_culled(20_000, precision, seed=1)
    assert culled == 0
    assert met > 2_000


@pytest.mark.matrix
@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_box_of_a_million_is_wrongly_culled(precision: str) -> None:
    culled, met = wrongly_culled(1_000_000, precision, seed=2)
    assert culled == 0
    assert met > 100_000
