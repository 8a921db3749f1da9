"""The meshes of several objects as one mesh in world space."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common import fixed_order, notes
from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.clips.clip import Clip
from colonnade.mesh.clips.joined import STILL_SECONDS, Place, joined_clip, still_clip
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import PLAIN
from colonnade.mesh.materials.mesh import Mesh, MeshPart, PlacedMesh
from colonnade.mesh.materials.palette import MAX_MATERIALS
from colonnade.mesh.materials.texture import Texture
from colonnade.scene.model import Material, Scene, SceneObject, Transform
from colonnade.scene.object_motion import moving_place, still_place
from colonnade.scene.object_pose import Pose, footprint_of, free_placement, rotation_matrix, standing_pose
from colonnade.scene.standing import surface_point
from colonnade.scene.view import with_overrides

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


def joined_mesh(scene: Scene, environment: Environment | None, corner_colours: bool = False) -> Mesh:
    """Load the objects of a scene and place them in the world, one after the other.

    Faces are numbered through all objects in their order, and `Mesh.parts` says where each begins.

    Raises:
        UserError: A mesh cannot be rendered, an object has no place, or there are too many materials.
    """
    loaded: dict[str, Mesh] = {}
    meshes, poses = [], []
    taken: list[tuple[Floats, float]] = []
    for number, described in enumerate(scene.objects, 1):
        own = described.mesh
        key = f"{own.source} {own.crease} {own.simplify} {own.played}"
        if key not in loaded:
            loaded[key] = load_mesh(own.source, own.crease, corner_colours, own.simplify, own.played)
            report_replaced(loaded[key], described.material)
        mesh = replace(loaded[key], materials=with_overrides(loaded[key].materials, described.material))
        poses.append(_pose(described, mesh, environment, f"object {number}", taken))
        meshes.append(_flat(mesh) if described.material.flat else mesh)
    return _joined(scene, meshes, poses, environment)


def report_replaced(mesh: Mesh, overrides: Material) -> None:
    """Note the colours and textures of a mesh that the albedo of a scene replaces."""
    own = [
        one for one in mesh.materials if one.texture is not None or one.has_corner_colours or one.albedo != PLAIN.albedo
    ]
    if own and overrides.albedo is not None:
        count = "the material has" if len(own) == 1 else f"{len(own)} materials have"
        notes.report(
            [f"mesh {mesh.name}: {count} the albedo of the scene, not that of the file: leave out material.albedo"]
        )


def _pose(
    described: SceneObject, mesh: Mesh, environment: Environment | None, name: str, taken: list[tuple[Floats, float]]
) -> Pose:
    """The pose of an object; the place where it stands is added to ``taken``."""
    rotation, transform = rotation_matrix(described.transform), described.transform
    if environment is None or not described.stands:
        return Pose(rotation, transform.scale, np.array(transform.translate))
    placed = described
    if described.stand_at is None:
        placed = replace(
            described, stand_at=free_placement(described, rotation, mesh.extent, environment, name, taken).stand_at
        )
    assert placed.stand_at is not None
    point = surface_point(placed.stand_at, environment, f"{name}.stand_at")
    taken.append((point, footprint_of(described, rotation, mesh.extent).radius))
    return standing_pose(placed, rotation, mesh.extent, point)


def _flat(mesh: Mesh) -> Mesh:
    """The mesh with the geometric normals of its faces."""
    corners = mesh.vertices[mesh.faces]
    normals = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return replace(mesh, corner_normals=np.repeat(normals[:, None], 3, axis=1))


def _joined(scene: Scene, meshes: list[Mesh], poses: list[Pose], environment: Environment | None) -> Mesh:
    textures = list(dict.fromkeys(texture for mesh in meshes for texture in mesh.textures))
    meshes = [_renumbered(mesh, textures) for mesh in meshes]
    materials = list(dict.fromkeys(material for mesh in meshes for material in mesh.materials))
    if len(materials) > MAX_MATERIALS:
        raise UserError(f"the objects have {len(materials):,} materials: use at most {MAX_MATERIALS}")
    first_vertices = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    first_faces = np.cumsum([0, *(mesh.source_count for mesh in meshes)])
    index = [np.array([materials.index(material) for material in mesh.materials]) for mesh in meshes]
    places = _places(scene, meshes, poses, environment)
    clip, clip_corners = _joined_clip(meshes, places)
    return Mesh(
        vertices=np.concatenate([pose.to_world(mesh.vertices) for mesh, pose in zip(meshes, poses, strict=True)]),
        faces=np.concatenate(
            [mesh.faces + first for mesh, first in zip(meshes, first_vertices[:-1], strict=True)]
        ).astype(np.int32),
        corner_normals=np.concatenate(
            [
                fixed_order.product(mesh.corner_normals, pose.rotation.T)
                for mesh, pose in zip(meshes, poses, strict=True)
            ]
        ),
        materials=tuple(materials),
        face_materials=np.concatenate(
            [own[mesh.face_materials] for mesh, own in zip(meshes, index, strict=True)]
        ).astype(np.uint8),
        source_faces=np.concatenate(
            [mesh.source_faces + first for mesh, first in zip(meshes, first_faces[:-1], strict=True)]
        ).astype(np.int32),
        source_count=int(first_faces[-1]),
        name=" + ".join(mesh.name for mesh in meshes),
        corner_colours=_filled([mesh.corner_colours for mesh in meshes], meshes, 3),
        textures=tuple(textures),
        corner_uvs=_filled([mesh.corner_uvs for mesh in meshes], meshes, 2),
        parts=tuple(
            MeshPart(mesh.name, int(first), mesh.extent.edge * pose.scale)
            for mesh, pose, first in zip(meshes, poses, first_faces[:-1], strict=True)
        ),
        objects=tuple(
            PlacedMesh(
                mesh.vertices,
                mesh.faces,
                mesh.corner_normals,
                pose.matrix,
                place if place.tracks else None,
                mesh.clip,
                mesh.clip_corners,
            )
            for mesh, pose, place in zip(meshes, poses, places, strict=True)
        ),
        clip=clip,
        clip_corners=clip_corners,
    )


def _places(scene: Scene, meshes: list[Mesh], poses: list[Pose], environment: Environment | None) -> list[Place]:
    """Where the objects are over the time of the longest animation."""
    vertical = scene.camera.up if environment is None else (0.0, 1.0, 0.0)
    seconds = max(0.0 if mesh.clip is None else mesh.clip.duration for mesh in meshes) or STILL_SECONDS
    return [
        moving_place(pose, mesh.extent.centre, described.stages, vertical, seconds)
        if described.motion
        else still_place(pose)
        for described, mesh, pose in zip(scene.objects, meshes, poses, strict=True)
    ]


def with_transform(mesh: Mesh, number: int, transform: Transform) -> Mesh:
    """A joined mesh with another pose of one of its objects, numbered from 0."""
    pose = Pose(rotation_matrix(transform), transform.scale, np.array(transform.translate))
    first_vertex = sum(len(one.vertices) for one in mesh.objects[:number])
    first_face = sum(len(one.faces) for one in mesh.objects[:number])
    moved, vertices, normals = mesh.objects[number], mesh.vertices.copy(), mesh.corner_normals.copy()
    vertices[first_vertex : first_vertex + len(moved.vertices)] = pose.to_world(moved.vertices)
    turned = fixed_order.product(moved.corner_normals, pose.rotation.T)
    normals[first_face : first_face + len(moved.faces)] = turned
    stretch = pose.scale / float(np.linalg.norm(moved.transform[:3, 0], axis=0))
    part = replace(mesh.parts[number], edge=mesh.parts[number].edge * stretch)
    objects, parts = list(mesh.objects), list(mesh.parts)
    objects[number], parts[number] = replace(moved, transform=pose.matrix), part
    return replace(mesh, vertices=vertices, corner_normals=normals, objects=tuple(objects), parts=tuple(parts))


def _joined_clip(meshes: list[Mesh], places: list[Place]) -> tuple[Clip | None, Indices | None]:
    """What moves the meshes, and its vertex at each corner of their faces; nothing if none moves."""
    if all(mesh.clip is None for mesh in meshes) and not any(place.tracks for place in places):
        return None, None
    clips = [mesh.clip or still_clip(mesh.vertices) for mesh in meshes]
    corners = [mesh.faces.astype(np.int64) if mesh.clip_corners is None else mesh.clip_corners for mesh in meshes]
    first = np.cumsum([0, *(len(clip.positions) for clip in clips)])
    return joined_clip(clips, places), np.concatenate([a + b for a, b in zip(corners, first[:-1], strict=True)])


def _renumbered(mesh: Mesh, textures: list[Texture]) -> Mesh:
    """The mesh with materials that name their textures by their number among all meshes'."""
    materials = tuple(
        material
        if material.texture is None
        else replace(material, texture=textures.index(mesh.textures[material.texture]))
        for material in mesh.materials
    )
    return replace(mesh, materials=materials)


def _filled(values: list[Floats | None], meshes: list[Mesh], width: int) -> Floats | None:
    """Values at the corners of all faces, 0 on meshes without; None if no mesh has any."""
    if all(value is None for value in values):
        return None
    return np.concatenate(
        [
            np.zeros((len(mesh.faces), 3, width)) if value is None else value
            for value, mesh in zip(values, meshes, strict=True)
        ]
    )
