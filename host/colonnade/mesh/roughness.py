"""Fewer roughnesses of metal and coats, where a table holds fewer materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials import GLOSSY, MeshMaterial, coat_roughness
from colonnade.mesh.mesh import Mesh
from colonnade.mesh.palette import table_entries
from colonnade.mesh.topology import Faces


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
    entries, index = table_entries(materials)
    area = np.bincount(index, weights, len(entries)).tolist()
    # Roughnesses of surfaces without a coat count as those that are nearly matt
    values = [GLOSSY if one.kind == "diffuse" and not one.roughness else one.roughness for one in entries]
    kinds: dict[MeshMaterial, list[list[int]]] = {}
    for number, entry in enumerate(entries):
        kinds.setdefault(replace(entry, roughness=0.0), []).append([number])

    def mean(members: list[int]) -> tuple[float, float]:
        total = sum(area[one] for one in members)
        return total, sum(area[one] * values[one] for one in members) / total if total else values[members[0]]

    def cost(a: list[int], b: list[int]) -> float:
        (first, of_first), (second, of_second) = mean(a), mean(b)
        return first * second * (of_first - of_second) ** 2 / max(first + second, 1e-300)

    for groups in kinds.values():
        groups.sort(key=lambda members: values[members[0]])
    number = len(entries)
    while number > count:
        pairs = [
            (cost(first, second), order, place)
            for order, groups in enumerate(kinds.values())
            for place, (first, second) in enumerate(pairwise(groups))
        ]
        if not pairs:
            break
        _, order, place = min(pairs)
        groups = list(kinds.values())[order]
        groups[place : place + 2] = [groups[place] + groups[place + 1]]
        number -= 1
    found = list(values)
    for groups in kinds.values():
        for members in groups:
            for one in members:
                found[one] = mean(members)[1] if len(members) > 1 else values[one]
    change = float((weights * np.abs(np.array(found) - values)[index]).sum() / max(float(weights.sum()), 1e-300))
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
