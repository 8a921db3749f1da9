"""The mesh of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from colonnade.common import notes
from colonnade.mesh import load
from colonnade.mesh.materials.palette import (
    reduced,
    table_entries,
    with_corner_albedo,
    with_face_colours,
    with_rendered_metal,
    with_whole_surfaces,
    without_emission,
    without_textures,
)
from colonnade.mesh.materials.roughness import with_fewer_roughnesses
from colonnade.scene.joined_mesh import joined_mesh, report_replaced
from colonnade.scene.model import Scene
from colonnade.scene.passes import may_have_layers
from colonnade.scene.view import with_overrides

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment
    from colonnade.mesh.materials.mesh import Mesh


@dataclass(frozen=True)
class SurfaceFeatures:
    """What the surfaces of a design have.

    Attributes:
        materials: Entries of the material table.
        corner_colours: Colours at the corners of faces.
        textures: A texture memory.
        emission: Emission of materials.
        glass: Glass and mirrors.
    """

    materials: int
    corner_colours: bool = False
    textures: bool = False
    emission: bool = False
    glass: bool = True

    @classmethod
    def of(cls, manifest: Manifest) -> SurfaceFeatures:
        """The features of a manifest's design."""
        materials = int(manifest.config["frame"]["materials"])
        glass = int(manifest.config["frame"]["maxBounces"]) > 0
        return cls(materials, manifest.corner_colours, manifest.texture is not None, manifest.emission, glass)


def object_mesh(scene: Scene, environment: Environment | None = None, corner_colours: bool = False) -> Mesh:
    """Load the mesh of a scene, of several objects joined, and report its notes. Textures and emission are kept.

    Args:
        scene: The scene.
        environment: The room of `scene.background`, in which several objects stand.
        corner_colours: Keep the colours of the corners, for a device that has them.

    Raises:
        UserError: The mesh does not exist or cannot be rendered, or one of several objects has no place.
    """
    if scene.objects:
        return joined_mesh(scene, environment, corner_colours)
    mesh = load.load_mesh(scene.mesh_source, scene.mesh.crease, corner_colours, scene.mesh.simplify, scene.mesh.played)
    report_replaced(mesh, scene.material)
    if scene.note:
        notes.tell(scene.note)
    return mesh


def stated_triangles(scene: Scene) -> Iterator[tuple[str, int]]:
    """The meshes of a scene that are not simplified, with the least numbers of their triangles, or 0."""
    for own in [described.mesh for described in scene.objects] or [scene.mesh]:
        if own.simplify is None:
            yield str(own.source), load.stated_triangles(own.source)


def with_materials(scene: Scene, mesh: Mesh, features: SurfaceFeatures) -> Mesh:
    """The mesh with what a device has, and notes of what it lacks.

    Of more colours than the material table holds, after the scene's values have overridden the mesh's, plain
    ones move to the corners of faces, or else similar roughnesses, then similar colours are merged.
    """
    has_passes = scene.frame.samples is None and scene.paths.gather > 0
    if not features.glass or not (has_passes or (scene.frame.samples or 1) > 1):
        mesh, lines = with_whole_surfaces(mesh)
        notes.report(lines)
    overridden = replace(mesh, materials=with_overrides(mesh.materials, scene.material))
    notes.report(with_rendered_metal(overridden, scene.paths.gather > 0, may_have_layers(scene))[1])
    mesh, _ = with_rendered_metal(mesh, scene.paths.gather > 0, may_have_layers(scene))
    if not features.textures:
        mesh, lines = without_textures(mesh)
        notes.report(lines)
    if not features.emission:
        mesh, lines = without_emission(mesh)
        notes.report(lines)
    if not features.corner_colours:
        mesh, lines = with_face_colours(mesh)
        notes.report(lines)
    if len(table_entries(mesh.materials)[0]) <= features.materials:
        return mesh
    mesh = replace(mesh, materials=with_overrides(mesh.materials, scene.material))
    if features.corner_colours and len(table_entries(mesh.materials)[0]) > features.materials:
        mesh = with_corner_albedo(mesh)
    if len(table_entries(mesh.materials)[0]) <= features.materials:
        return mesh
    mesh, lines = with_fewer_roughnesses(mesh, features.materials)
    notes.report(lines)
    mesh, line = reduced(mesh, features.materials)
    notes.report([] if line is None else [line])
    return mesh
