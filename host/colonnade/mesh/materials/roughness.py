"""Fewer roughnesses of metal and coats, where a table holds fewer materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.geometry.topology import Faces
from colonnade.mesh.materials.materials import GLOSSY, MeshMaterial, coat_roughness
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.palette import table_entries


def merged_roughness(
    materials: Sequence[MeshMaterial], weights: Floats, count: int
) -> tuple[tuple[MeshMaterial, ...], float]:
    """Merge similar roughnesses of surfaces that are equal otherwise, until a table of so many entries holds all.

    The two go first whose difference, squared, times their area is least (Ward's clustering).

    Args:
        materials: The materials.
        weights: The area of each, float64 [k].
        count: Entries of the table; there may be more that differ otherwise.

    Returns:
        Each material, with its new roughness, and by how much roughnesses changed on average over the area.
    """
    from colonnade import _core

    entries, index = table_entries(materials)
    area = np.bincount(index, weights, len(entries)).tolist()
    # Roughnesses of surfaces without a coat count as nearly matt
    values = [GLOSSY if one.kind == "diffuse" and not one.roughness else one.roughness for one in entries]
    kinds = {kind: number for number, kind in enumerate(dict.fromkeys(replace(one, roughness=0.0) for one in entries))}
    groups = [kinds[replace(one, roughness=0.0)] for one in entries]
    found = _core.merged_values(values, area, groups, count)
    change = float((weights * np.abs(np.subtract(found, values))[index]).sum() / max(float(weights.sum()), 1e-300))
    rounded = [
        entry.roughness if after == before else (coat_roughness(after) if entry.kind == "diffuse" else after)
        for entry, before, after in zip(entries, values, found, strict=True)
    ]
    return tuple(replace(one, roughness=rounded[entry]) for one, entry in zip(materials, index, strict=True)), change


def surface_areas(vertices: Floats, faces: Indices | Faces, face_materials: Indices, count: int) -> Floats:
    """The area of the faces of each of so many materials, float64 [count]."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.bincount(face_materials, np.sqrt((across**2).sum(axis=1)), count) / 2


def with_fewer_roughnesses(mesh: Mesh, count: int) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh whose materials a table of so many entries holds, if fewer roughnesses suffice, and a line on this."""
    before = len(table_entries(mesh.materials)[0])
    areas = surface_areas(mesh.vertices, mesh.faces, mesh.face_materials.astype(np.int64), len(mesh.materials))
    materials, change = merged_roughness(mesh.materials, areas, count)
    after = len(table_entries(materials)[0])
    if after == before:
        return mesh, ()
    line = (
        f"mesh {mesh.name}: {before} materials become {after}, their roughness off by {change:.2f} on average:"
        f" frame.materials is {count}"
    )
    return replace(mesh, materials=materials), (line,)
