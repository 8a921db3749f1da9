"""The least distance off a surface: no ray meets the plane that it leaves, by the model's own arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import leaves_of

from colonnade.common.types import Floats
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import load_scene, new_model
from colonnade.mesh.load import clean_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.surface_offset import surface_offset
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

Integers = npt.NDArray[np.int64]
PRECISIONS = ("16b16s32d", "24b24s32d", "24b24s64d", "32b32s64d", "small")
RAYS = 48


def plane(random: np.random.Generator, divisions: int) -> tuple[Mesh, Floats]:
    """A square in a random plane, cut into triangles at random inner points of a grid; and the plane's normal."""
    steps = np.linspace(-1.0, 1.0, divisions + 1)
    u, v = np.meshgrid(steps, steps, indexing="ij")
    inner = (np.abs(u) < 1) & (np.abs(v) < 1)
    u, v = (w + np.where(inner, random.uniform(-0.3, 0.3, w.shape) / divisions, 0.0) for w in (u, v))
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    vertices = u.reshape(-1, 1) * axes[0] + v.reshape(-1, 1) * axes[1] + random.uniform(-5, 5, 3)
    corner = np.add.outer(np.arange(divisions) * (divisions + 1), np.arange(divisions)).reshape(-1)
    square = np.stack([corner, corner + divisions + 1, corner + divisions + 2, corner + 1], axis=1)
    faces = np.concatenate([square[:, :3], square[:, [0, 2, 3]]]).astype(np.int32)
    return clean_mesh(vertices, faces, name="plane"), axes[2]


def faces_of(image: SceneImage, manifest: Manifest) -> tuple[Integers, Integers, Integers]:
    """Rising packed ids [n], corners on the grid [n, 3, 3] and geometric normals [n, 3] of the triangles."""
    ids, leaves = leaves_of(image, manifest)
    corners, shift = leaves["vertices"], manifest.numbers["gridFraction"]
    on_grid = corners << shift if shift >= 0 else np.rint(corners / 2.0**-shift).astype(np.int64)
    return ids, on_grid, leaves["geometric"]


def nearest_even(value: int, bits: int) -> int:
    floor, rest = value >> bits, value & ((1 << bits) - 1)
    return floor + (2 * rest + (floor & 1) > 1 << bits)


def leading(value: int, bits: int) -> tuple[int, int]:
    """Mantissa of so many bits, and exponent."""
    drop = value.bit_length() - bits
    return value >> drop if drop >= 0 else value << -drop, value.bit_length()


def hit_point(ray: dict[str, Any], i: int, corners: Integers, numbers: dict[str, int]) -> list[int] | None:
    """P of docs/numbers.md, sections 4 and 5.1, grid steps; None for a miss."""
    axis, *negative = (int(value) for value in ray["heading"][i])
    order, fraction, h = [(axis + 1) % 3, (axis + 2) % 3, axis], numbers["shearFraction"], numbers["mantissaBits"]
    origin, shear = [int(value) for value in ray["origin"][i]], [int(value) for value in ray["shear"][i]]
    p = [[int(corner[order[a]]) - origin[a] for a in range(3)] for corner in corners]
    z = [-q[2] if negative[2] else q[2] for q in p]
    x, y = ([q[a] - nearest_even(shear[a] * z[j], fraction) for j, q in enumerate(p)] for a in (0, 1))
    edges = [x[1] * y[2] - y[1] * x[2], x[2] * y[0] - y[2] * x[0], x[0] * y[1] - y[0] * x[1]]
    if any(e < 0 for e in edges) == any(e > 0 for e in edges):
        return None
    drop = sum(map(abs, edges)).bit_length() - numbers["weightBits"]
    b = [abs(e) >> drop if drop >= 0 else abs(e) << -drop for e in edges]
    numerator = b[1] * (z[1] - z[0]) + b[2] * (z[2] - z[0])
    (n, n_bits), (d, d_bits) = leading(abs(numerator), h), leading(sum(b), h)
    shift = numbers["distanceDigits"] - (n_bits - d_bits)
    digits = (n << numbers["distanceDigits"]) // d
    quotient = digits >> shift if shift >= 0 else digits << -shift
    t = z[0] + (quotient if numerator >= 0 else -quotient)
    if t < 0:
        return None
    point = [0, 0, 0]
    for a in (0, 1):
        point[order[a]] = origin[a] + nearest_even(shear[a] * t, fraction)
    point[order[2]] = origin[2] + (-t if negative[2] else t)
    return point


def hits_of_their_own_plane(precision: str, divisions: int, seed: int, share: float = 1.0) -> tuple[int, int]:
    """Rays that leave a plane at `share` of the least offset and meet it, and rays tried."""
    random = np.random.default_rng(seed)
    manifest = manifest_for(precision, ()).manifest
    mesh, normal = plane(random, divisions)
    numbers, image = manifest.numbers, pack(mesh, manifest)
    model = new_model(manifest)
    load_scene(model, image)
    model.start(frame_registers(Scene(MeshSource(name="cube")), image.header, manifest, 64, 64))
    ids, corners, normals = faces_of(image, manifest)

    # Rays from the scene's whole range at points of random triangles
    chosen = random.integers(len(corners), size=RAYS)
    weights = random.dirichlet([0.7, 0.7, 0.7], size=RAYS)
    targets = np.einsum("ni,nij->nj", weights, corners[chosen].astype(np.float64))
    away = random.normal(size=(RAYS, 3)) * corners.max() * 2.0 ** random.uniform(-3, 5, size=(RAYS, 1))
    origins = np.rint(targets + away).astype(np.int64)
    directions = np.rint(targets).astype(np.int64) - origins
    nothing = np.zeros((RAYS, 3), dtype=np.int64)
    rays = model.test_boxes(origins, directions, nothing, nothing, nothing, nothing)
    first = model.trace(origins, directions)
    place = np.searchsorted(ids, first)

    # From there off the surface, at angles to the plane beyond the rounded normals' and slopes'
    offset = round(share * surface_offset(numbers, image.header.largest_triangle))
    least = 2.0**-11 + 2**0.5 * (2.0 ** -numbers["shearDigits"] + 2.0 ** (1 - numbers["mantissaBits"]))
    starts, leaving = [], []
    for i in np.flatnonzero(first >= 0):
        point = hit_point(rays, i, corners[place[i]], numbers)
        assert point is not None, "the model's hit is one by docs/numbers.md"
        stored = normals[place[i]] * (1 if normals[place[i]] @ away[i] > 0 else -1)
        starts.append([p + nearest_even(offset * int(f), 11) for p, f in zip(point, stored, strict=True)])
        unit = normal if normal @ stored > 0 else -normal
        across = np.cross(unit, random.normal(size=3))
        slope = 2 * least + random.uniform() ** 4
        direction = across / np.linalg.norm(across) + slope * unit
        leaving.append(np.rint(direction * 2.0 ** (numbers["gridBits"] - 3)))
    if not starts:
        return 0, 0
    again = model.trace(np.array(starts, dtype=np.int64), np.array(leaving).astype(np.int64))
    return int((again >= 0).sum()), len(starts)


@settings(max_examples=60)
@given(st.sampled_from(PRECISIONS), st.sampled_from([1, 1, 2, 7, 30]), st.integers(0, 2**32 - 1))
def test_no_ray_meets_the_plane_that_it_leaves(precision: str, divisions: int, seed: int) -> None:
    """Neither its own triangle nor one beside it, from anywhere, at five precisions."""
    assert hits_of_their_own_plane(precision, divisions, seed)[0] == 0


@pytest.mark.parametrize("precision", PRECISIONS)
def test_rays_meet_their_plane_without_an_offset(precision: str) -> None:
    assert sum(hits_of_their_own_plane(precision, 7, seed, 0.0)[0] for seed in range(4)) > 0


@pytest.mark.parametrize(("precision", "units"), [("32b32s64d", 1.8), ("24b24s64d", 2.2), ("16b16s32d", 120.0)])
def test_the_offset_is_a_few_units_where_the_numbers_are_wide(precision: str, units: float) -> None:
    numbers = manifest_for(precision, ()).manifest.numbers
    offset = surface_offset(numbers, 65535) / 2.0 ** numbers["gridFraction"]
    assert 0.9 * units < offset <= units
