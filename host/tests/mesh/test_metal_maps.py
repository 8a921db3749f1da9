"""Metallic-roughness maps of glTF files: faces that are metal by them, and their roughness."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textured_files import gltf

from colonnade.common.srgb import linear_from_srgb
from colonnade.mesh.files.gltf_metal import metal_of
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial, coat_roughness
from colonnade.mesh.materials.roughness import merged_roughness
from colonnade.mesh.materials.texture import Texture


def packed(roughness: int, metallic: int) -> np.ndarray:
    """A map of one value in a picture of 2x2 pixels."""
    return np.full((2, 2, 3), (255, roughness, metallic), np.uint8)


def surface(**more: object) -> list[dict[str, object]]:
    return [{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, **more}}]


@pytest.mark.parametrize(
    ("roughness", "metallic", "factors", "kind", "expected"),
    [
        (128, 255, {}, "mirror", 0.5),
        (255, 255, {"roughnessFactor": 0.76}, "mirror", 0.75),
        (0, 200, {}, "mirror", 0.0),
        (128, 100, {}, "diffuse", 0.0),
        (128, 255, {"metallicFactor": 0.4}, "diffuse", 0.0),
    ],
)
def test_a_map_makes_metal(
    tmp_path: Path, roughness: int, metallic: int, factors: dict[str, float], kind: str, expected: float
) -> None:
    texture = {"baseColorTexture": {"index": 0}} if metallic == 255 else {}
    mesh = load_mesh(gltf(tmp_path, packed(roughness, metallic), materials=surface(**texture, **factors)))
    (material,) = (mesh.materials[index] for index in mesh.face_materials)
    assert (material.kind, material.roughness) == (kind, expected)
    # A picture of one colour is no texture
    green = linear_from_srgb(np.array(roughness / 255)) if texture else 1.0
    np.testing.assert_allclose(material.albedo, (1.0, green, 1.0), atol=1e-3)
    assert any("a face is metal or diffuse, with one roughness" in line for line in mesh.notes)


def test_without_positions_or_picture_the_surface_is_diffuse(tmp_path: Path) -> None:
    plain = {"attributes": {"POSITION": 0}, "material": 0}
    for changes in ({"meshes": [{"primitives": [plain]}]}, {"images": [{"uri": "missing.png"}]}):
        mesh = load_mesh(gltf(tmp_path, packed(128, 255), materials=surface(), **changes))
        assert [material.kind for material in mesh.materials] == ["diffuse"]


@given(st.integers(0, 2**32 - 1))
def test_faces_are_metal_where_the_map_is(seed: int) -> None:
    """The left half of a map is metal, in two shades of roughness; faces lie in one half each."""
    random = np.random.default_rng(seed)
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:, :32, 2] = 255
    pixels[:32, :32, 1], pixels[32:, :32, 1], pixels[:, 32:, 1] = 64, 192, 255
    corners = random.uniform(0.05, 0.4, (20, 3, 2)) + (random.integers(0, 2, 20)[:, None] * (0.5, 0.0))[:, None]
    is_metal, roughness = metal_of(Texture("a", pixels), corners, (1.0, 1.0))
    np.testing.assert_array_equal(is_metal, corners[:, 0, 0] < 0.5)
    # All of them lie in the upper half
    assert (roughness[is_metal] == 0.25).all()
    lower, rough = metal_of(Texture("a", pixels), corners + np.array([0, 0.5]), (1.0, 1.0))
    assert (rough[lower] == 0.75).all() and (lower == is_metal).all()


@given(st.lists(st.tuples(st.sampled_from(["diffuse", "mirror"]), st.integers(0, 16)), min_size=1), st.integers(1, 8))
def test_merged_roughnesses_fit_a_table(parts: list[tuple[str, int]], count: int) -> None:
    values = [coat_roughness(step / 16) if kind == "diffuse" else step / 16 for kind, step in parts]
    materials = [MeshMaterial(kind, roughness=value) for (kind, _), value in zip(parts, values, strict=True)]
    weights = np.arange(1.0, 1.0 + len(parts))
    found, change = merged_roughness(materials, weights, count)
    kinds = {kind for kind, _ in parts}
    assert [one.kind for one in found] == [kind for kind, _ in parts]
    assert len(set(found)) <= max(count, len(kinds))
    if len(set(materials)) <= count:
        assert list(found) == materials and change == 0
    for kind in kinds:  # classes are intervals
        both = zip(materials, found, strict=True)
        pairs = sorted((a.roughness or 1, b.roughness or 1) for a, b in both if a.kind == kind)
        assert kind == "mirror" or [after for _, after in pairs] == sorted(after for _, after in pairs)


def test_the_least_change_is_merged_first() -> None:
    """The same classes as by comparing all pairs at each step; their number is beyond what that could do in a test."""
    random = np.random.default_rng(5)
    materials = [MeshMaterial("mirror", roughness=float(value)) for value in random.random(4_000)]
    weights = random.random(4_000)
    found, change = merged_roughness(materials, weights, 16)
    assert len(set(found)) == 16 and 0.005 < change < 0.02
    few, few_weights = materials[:40], weights[:40]
    classes = [[index] for index in sorted(range(40), key=lambda index: few[index].roughness)]

    def centre(one: list[int]) -> tuple[float, float]:
        total = float(few_weights[one].sum())
        return total, float(sum(few_weights[index] * few[index].roughness for index in one) / total)

    while len(classes) > 7:
        pairs = [(centre(a), centre(b)) for a, b in pairwise(classes)]
        costs = [a[0] * b[0] / (a[0] + b[0]) * (a[1] - b[1]) ** 2 for a, b in pairs]
        least = costs.index(min(costs))
        classes[least : least + 2] = [classes[least] + classes[least + 1]]
    merged, _ = merged_roughness(few, few_weights, 7)
    for one in classes:
        np.testing.assert_allclose([merged[index].roughness for index in one], centre(one)[1])
