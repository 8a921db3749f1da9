"""Normal maps, baked into corner normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from textured_files import gltf

from colonnade.common.vectors import unit_vectors
from colonnade.mesh.geometry.normals import face_normals
from colonnade.mesh.load import load_mesh
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials import normal_baking
from colonnade.mesh.materials.normal_baking import BakedSurface, baked
from colonnade.mesh.materials.relief import NormalMap, Relief
from colonnade.mesh.materials.texture import Texture, sampled

MATERIAL = {"pbrMetallicRoughness": {"metallicFactor": 0}, "doubleSided": True}


def codes(normals: np.ndarray) -> np.ndarray:
    return np.rint((unit_vectors(np.asarray(normals, float)) + 1) * 127.5).astype(np.uint8)


@pytest.mark.parametrize(("scale", "is_mirrored"), [(1.0, False), (0.5, False), (1.0, True)])
def test_a_map_tilts_along_u_and_against_v(tmp_path: Path, scale: float, is_mirrored: bool) -> None:
    pixels = np.broadcast_to(codes(np.array([0.3, 0.4, 0.8])), (4, 4, 3)).copy()
    info: dict[str, object] = {"index": 0, "scale": scale}
    if is_mirrored:
        info["extensions"] = {"KHR_texture_transform": {"scale": [-1, 1]}}
    mesh = load_mesh(gltf(tmp_path, pixels, materials=[MATERIAL | {"normalTexture": info}]))
    # u goes along the first edge, v along the second one
    along, down = unit_vectors(np.array([(-1.0, 1, 0), (-1.0, 0, 1)]))
    normal = unit_vectors(np.ones(3))
    up = unit_vectors(np.cross(normal, along))
    assert up @ down > 0  # so the picture is mirrored on its front: the bitangent is -up
    tangent = -along if is_mirrored else along
    tilt = pixels[0, 0] / 127.5 - 1
    expected = unit_vectors((tilt[0] * tangent - tilt[1] * up) * scale + tilt[2] * normal)
    np.testing.assert_allclose(mesh.corner_normals, np.broadcast_to(expected, (1, 3, 3)), atol=1e-6)
    assert len(mesh.faces) == 1 and not any("normal map" in line for line in mesh.notes)


def test_without_positions_a_map_is_noted(tmp_path: Path) -> None:
    plain = {"attributes": {"POSITION": 0}, "material": 0}
    material = MATERIAL | {"normalTexture": {"index": 0}}
    mesh = load_mesh(gltf(tmp_path, materials=[material], meshes=[{"primitives": [plain]}]))
    assert any("1 face with a normal map is smooth" in line for line in mesh.notes)


def bumpy(seed: int, share: float | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, Relief]:
    """A sphere with a random map; given a share, so many of its faces have random places in it and the others none."""
    random = np.random.default_rng(seed)
    mesh = load_mesh("sphere:80")
    vertices, faces = mesh.vertices, mesh.faces
    height = np.repeat(np.repeat(random.uniform(-0.6, 0.6, (8, 8, 2)), 4, axis=0), 4, axis=1)
    texture = Texture("a", codes(np.concatenate([height, np.ones((32, 32, 1))], axis=2)))
    index = np.where(random.uniform(size=len(faces)) < (1.0 if share is None else share), 0, -1)
    uvs = vertices[faces][..., :2] if share is None else random.uniform(-1, 1, (len(faces), 3, 2))
    relief = Relief((NormalMap(texture),), index, uvs, np.zeros((len(faces), 3, 4)))
    return vertices, faces, unit_vectors(vertices[faces]), relief


def split(budget: int, seed: int, share: float | None = None) -> tuple[BakedSurface, Losses]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(normal_baking, "MAX_SPLIT_FACES", budget)
        losses = Losses()
        return baked(*bumpy(seed, share), losses), losses


def frames_of(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, relief: Relief) -> np.ndarray:
    """Tangent, bitangent and normal at the corners of faces that all have the map, float64 [m, 3, 9]."""
    edge, way = vertices[faces][:, 1:] - vertices[faces][:, :1], relief.uvs[:, 1:] - relief.uvs[:, :1]
    sign = np.sign(np.linalg.det(way))[:, None]
    along = unit_vectors((edge[:, 0] * way[:, 1, 1:] - edge[:, 1] * way[:, 0, 1:]) * sign)
    area = np.linalg.norm(np.cross(edge[:, 0], edge[:, 1]), axis=1, keepdims=True)
    sides = np.repeat(-sign, 3, axis=1)
    # A vertex has one normal and one position in the map
    groups = faces * 3 + sides.astype(int) + 1
    sums = np.zeros((groups.max() + 1, 3))
    np.add.at(sums, groups, np.repeat((along * area)[:, None], 3, axis=1))
    tangents = sums[groups]
    tangents = unit_vectors(tangents - (tangents * normals).sum(axis=2, keepdims=True) * normals)
    return np.concatenate([tangents, np.cross(normals, tangents) * sides[..., None], normals], axis=2)


def slimness(corners: np.ndarray) -> float:
    """The largest square of a longest edge, of twice the area of its face."""
    edges = np.roll(corners, -1, axis=1) - corners
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return float(((edges**2).sum(axis=2).max(axis=1) / areas).max())


@settings(max_examples=6)
@given(st.integers(0, 2**32 - 1), st.sampled_from([90, 500]), st.sampled_from([0.3, 1.0]))
def test_split_faces_stay_closed(seed: int, budget: int, share: float) -> None:
    vertices, faces, normals, relief = bumpy(seed, share)
    found, _ = split(budget, seed, share)
    assert len(faces) < len(found.faces) <= budget
    # No part is much thinner than the thinnest face
    assert slimness(found.vertices[found.faces]) < 4 * slimness(vertices[faces])
    # Every edge has one face on each side, and every corner is a point of the face that it is a part of
    edges = np.concatenate([found.faces[:, [0, 1]], found.faces[:, [1, 2]], found.faces[:, [2, 0]]])
    forward, backward = ({tuple(edge) for edge in ends.tolist()} for ends in (edges, edges[:, ::-1]))
    assert forward == backward and len(forward) == len(edges)
    np.testing.assert_allclose(found.corners(vertices[faces]), found.vertices[found.faces], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=2), 1.0)
    fronts = face_normals(found.vertices, found.faces)[:, None]
    assert ((found.normals * fronts).sum(axis=2) > 0).all()
    # Corners that touch no face with a map keep their normals to the bit
    mapped = relief.index[found.owners] >= 0
    free = ~np.isin(found.faces, found.faces[mapped]) & (found.weights.max(axis=2) == 1.0)
    np.testing.assert_array_equal(found.normals[free], unit_vectors(found.corners(normals))[free])


def test_more_faces_show_more_of_a_map() -> None:
    """Against the map itself, between the corners of the file's faces; what is lost is noted."""
    points = np.random.default_rng(1).dirichlet((1, 1, 1), 400)
    errors = []
    for budget in (80, 4000):
        vertices, faces, normals, relief = bumpy(3)
        found, losses = split(budget, 3)
        frames = frames_of(vertices, faces, normals, relief)
        face = np.random.default_rng(2).integers(0, len(faces), 400)
        at = np.einsum("kc,kci->ki", points, relief.uvs[face])
        axes = np.einsum("kc,kci->ki", points, frames[face]).reshape(-1, 3, 3)
        tilts = sampled(relief.maps[0].texture.pixels, at, ("repeat", "repeat"), values=np.arange(256) / 127.5 - 1)
        truth = unit_vectors(np.einsum("kj,kji->ki", tilts, axes))
        baked_normals = np.empty_like(truth)
        for row, (owner, weights) in enumerate(zip(face, points, strict=True)):
            parts = np.flatnonzero(found.owners == owner)
            places = np.broadcast_to(weights, (len(parts), 3))[..., None]
            inside = np.linalg.solve(found.weights[parts].swapaxes(1, 2), places)
            part = int(inside[..., 0].min(axis=1).argmax())
            baked_normals[row] = unit_vectors(inside[part, :, 0] @ found.normals[parts[part]])
        errors.append(float(np.degrees(np.arccos(np.clip((baked_normals * truth).sum(axis=1), -1, 1))).mean()))
        (note,) = losses.lines() or ("",)
        assert ("corner normals differ from it by" in note) == (budget == 80 or errors[-1] > 3)
    assert errors[1] < 0.4 * errors[0], errors
