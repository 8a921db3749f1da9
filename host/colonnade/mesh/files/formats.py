"""Reads mesh files: their triangles, and for each a material or colour and three normals."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_MESH_BYTES
from colonnade.mesh.clips.tracks import Animation
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.surface import RawSurface

#: Suffixes of the formats that trimesh reads for us, and of all mesh files.
TRIMESH_SUFFIXES = (".3mf", ".dae", ".zae", ".3dxml", ".xaml")
SUFFIXES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf", *TRIMESH_SUFFIXES)


@dataclass(frozen=True)
class MeshFile:
    """What a mesh file holds, and what of it is lost."""

    surface: RawSurface
    losses: Losses


def read_surface(path: Path, animation: Animation | None = None) -> MeshFile:
    """Read a mesh file and join its parts.

    Args:
        path: The file.
        animation: An animation, which the surface plays. None: it does not move.

    Raises:
        UserError: The file is invalid, or has no such animation.
    """
    content = read_input(path, "the mesh", MAX_MESH_BYTES)
    kind, losses, references = path.suffix.lower(), Losses(), References(path)
    if animation is not None and kind not in (".glb", ".gltf"):
        raise UserError(f"mesh {path} has no animations: leave out mesh.animation, or give a glTF file")
    if kind in (".glb", ".gltf"):
        from colonnade.mesh.files.gltf import read_gltf

        surface = read_gltf(content, path, references, losses, animation)
    elif kind in TRIMESH_SUFFIXES:
        from colonnade.mesh.files.trimesh_files import read_by_trimesh

        surface = read_by_trimesh(content, path, references, losses)
    else:
        from colonnade.mesh.files.polygon_files import read_polygons

        surface = read_polygons(content, path, references, losses)
    if len(surface.faces) == 0:
        raise UserError(f"mesh {path} has no faces: {'; '.join(losses.lines()) or 'it holds no polygons'}")
    return MeshFile(surface, losses)
