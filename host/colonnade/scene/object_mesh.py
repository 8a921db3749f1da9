"""The mesh of a scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from colonnade.common import notes
from colonnade.mesh.load import load_mesh
from colonnade.mesh.palette import reduced, with_face_colours, without_emission, without_textures
from colonnade.scene.joined_mesh import joined_mesh
from colonnade.scene.model import Scene
from colonnade.scene.view import with_overrides

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.mesh import Mesh


def object_mesh(
    scene: Scene,
    materials: int | None = None,
    corner_colours: bool = False,
    environment: Environment | None = None,
    textures: bool = False,
    emission: bool = False,
) -> Mesh:
    """Load the mesh of a scene, of several objects joined, and report its notes.

    Args:
        scene: The scene.
        materials: Entries of the device's material table: of more diffuse colours, similar ones are merged. None: all
            are kept.
        corner_colours: Keep the colours of the corners, for a device that has them.
        environment: The room of `scene.background`, in which several objects stand.
        textures: Keep the textures, for a device that has them; they are always kept without ``materials``.
        emission: Likewise the emission of materials.

    Raises:
        UserError: The mesh does not exist or cannot be rendered, or one of several objects has no place.
    """
    if scene.objects:
        mesh = joined_mesh(scene, environment, corner_colours)
    else:
        mesh = load_mesh(scene.mesh_source, scene.mesh.crease, corner_colours)
    return mesh if materials is None else with_materials(scene, mesh, materials, corner_colours, textures, emission)


def with_materials(
    scene: Scene, mesh: Mesh, materials: int, corner_colours: bool, textures: bool, emission: bool = False
) -> Mesh:
    """The mesh with what a device has, as `object_mesh`; the scene's values override its materials first."""
    if not textures:
        mesh, lines = without_textures(mesh)
        notes.report(lines)
    if not emission:
        mesh, lines = without_emission(mesh)
        notes.report(lines)
    if not corner_colours:
        mesh, lines = with_face_colours(mesh)
        notes.report(lines)
    if len(mesh.materials) <= materials:
        return mesh
    mesh, line = reduced(replace(mesh, materials=with_overrides(mesh.materials, scene.material)), materials)
    notes.report([] if line is None else [line])
    return mesh
