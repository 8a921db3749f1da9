"""Fewer roughnesses of metal and coats, where a table holds fewer materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from heapq import heapify, heappop, heappush
from itertools import chain, pairwise

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
    entries, index = table_entries(materials)
    area = np.bincount(index, weights, len(entries)).tolist()
    # Roughnesses of surfaces without a coat count as those that are nearly matt
    values = [GLOSSY if one.kind == "diffuse" and not one.roughness else one.roughness for one in entries]
    kinds: dict[MeshMaterial, list[int]] = {}
    for number, entry in enumerate(entries):
        kinds.setdefault(replace(entry, roughness=0.0), []).append(number)
    for members in kinds.values():
        members.sort(key=values.__getitem__)
    # Groups by their first entries, and the next group of the same kind
    place = {number: at for at, number in enumerate(chain.from_iterable(kinds.values()))}
    groups = {number: [number] for number in range(len(entries))}
    following = dict(chain.from_iterable(pairwise(members) for members in kinds.values()))
    preceding = {second: first for first, second in following.items()}

    def mean(group: int) -> tuple[float, float]:
        members = groups[group]
        total = sum(area[one] for one in members)
        return total, sum(area[one] * values[one] for one in members) / total if total else values[group]

    def offer(group: int) -> tuple[float, int, int, int, int]:
        (first, of_first), (second, of_second) = mean(group), mean(following[group])
        cost = first * second * (of_first - of_second) ** 2 / max(first + second, 1e-300)
        return cost, place[group], group, len(groups[group]), len(groups[following[group]])

    offers = [offer(group) for group in following]
    heapify(offers)
    while len(groups) > count and offers:
        _, _, group, *sizes = heappop(offers)
        # An offer is void when one of its groups has grown or is gone
        if group not in following or [len(groups[group]), len(groups[following[group]])] != sizes:
            continue
        second = following.pop(group)
        groups[group] += groups.pop(second)
        if second in following:
            following[group] = following.pop(second)
            preceding[following[group]] = group
            heappush(offers, offer(group))
        if group in preceding:
            heappush(offers, offer(preceding[group]))
    found = list(values)
    for group, members in groups.items():
        if len(members) > 1:
            for one in members:
                found[one] = mean(group)[1]
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
