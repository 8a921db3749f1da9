"""trimesh's ray queries, answered by the device."""

from __future__ import annotations

import numpy as np
import trimesh
from exact_rays import outside_rays

from colonnade.rays import RayMeshIntersector


def test_queries_are_those_of_the_mesh() -> None:
    mesh = trimesh.creation.torus(2, 1)
    mesh.ray = RayMeshIntersector(mesh)
    rays = outside_rays(mesh.vertices, 300, seed=8)
    origins, directions = rays[:, :3], rays[:, 4:7]
    places, ray, face = mesh.ray.intersects_location(origins, directions)
    assert np.abs(np.linalg.norm(np.cross(places - origins[ray], directions[ray]), axis=1)).max() < 1e-9
    assert np.abs(((places - mesh.triangles[face, 0]) * mesh.face_normals[face]).sum(axis=1)).max() < 1e-9
    assert set(np.bincount(ray, minlength=300)) == {0, 2, 4}
    first, hit = mesh.ray.intersects_first(origins, directions), mesh.ray.intersects_any(origins, directions)
    assert (first >= 0).tolist() == hit.tolist() == (np.bincount(ray, minlength=300) > 0).tolist()
    assert set(first[first >= 0]) <= set(face)
    assert len(mesh.ray.intersects_id(origins, directions, max_hits=1)[0]) == hit.sum()
    inside = mesh.contains([[2, 0, 0], [0, 0, 0], [2, 0, 0.9], [2, 0, 1.1]])
    assert inside.tolist() == [True, False, True, False]


def test_an_edge_or_a_vertex_is_one_hit() -> None:
    mesh = trimesh.creation.box().subdivide()
    mesh.ray = RayMeshIntersector(mesh)
    for place in ((0, 0), (0.25, 0), (0.1, 0.1)):
        assert len(mesh.ray.intersects_id([[*place, 2]], [[0, 0, -1]])[0]) == 2


def test_a_changed_mesh_is_packed_anew() -> None:
    mesh = trimesh.creation.box()
    mesh.ray = RayMeshIntersector(mesh)
    query = [[0.1, 0.2, 5]], [[0, 0, -1]]
    assert mesh.ray.intersects_location(*query)[0][:, 2].tolist() == [0.5, -0.5]
    mesh.apply_translation([0, 0, 1])
    assert mesh.ray.intersects_location(*query)[0][:, 2].tolist() == [1.5, 0.5]
