"""The mesh of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from colonnade.common import notes
from colonnade.mesh.load import load_mesh
from colonnade.mesh.palette import reduced
from colonnade.scene.model import Scene

if TYPE_CHECKING:
    from colonnade.mesh.mesh import Mesh


def object_mesh(scene: Scene, materials: int | None = None) -> Mesh:
    """Load the mesh of a scene, and report its notes.

    Args:
        scene: The scene.
        materials: Entries of the device's material table: of more diffuse colours, similar ones are merged. None: all
            are kept.

    Raises:
        UserError: The mesh does not exist or cannot be rendered.
    """
    mesh = load_mesh(scene.mesh_source, scene.mesh.crease)
    return mesh if materials is None else with_materials(scene, mesh, materials)


def with_materials(scene: Scene, mesh: Mesh, materials: int) -> Mesh:
    """The mesh with so many materials at most, as `object_mesh`; the scene's albedo replaces all colours."""
    if scene.material.albedo is not None:
        return mesh
    mesh, line = reduced(mesh, materials)
    notes.report([] if line is None else [line])
    return mesh
