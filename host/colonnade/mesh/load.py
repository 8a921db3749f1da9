"""Loads triangle meshes by name, or from a file (OBJ, PLY, STL, OFF, glTF, 3MF, COLLADA …).

Every loaded mesh is clean: vertices are merged by position, degenerate faces, duplicate faces and unused vertices are
removed, and closed parts point outward. Its corner normals are the file's, else smooth up to a crease angle.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.input_files import is_file, require_regular
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh import losses as lost
from colonnade.mesh.clips.faces import ClipFaces
from colonnade.mesh.clips.tracks import Animation
from colonnade.mesh.files import catalog, stated
from colonnade.mesh.files.formats import SUFFIXES, read_surface
from colonnade.mesh.geometry import primitives, teapot
from colonnade.mesh.geometry.cleaning import clean
from colonnade.mesh.geometry.topology import Faces, subdivide, subdivide_corners
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.coverage import without_alpha
from colonnade.mesh.materials.materials import PLAIN, MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.normal_baking import baked
from colonnade.mesh.materials.palette import MAX_MATERIALS, coloured_materials, corner_coloured_materials
from colonnade.mesh.materials.relief import Relief
from colonnade.mesh.materials.swatches import with_swatches
from colonnade.mesh.materials.texture import Texture
from colonnade.mesh.simplify import simplified

TEAPOT_LEVEL = 10
TEAPOT_LIMIT = 200
SUBDIVISION_LIMIT = 5


def load_mesh(
    name_or_path: str | Path,
    crease: float | None = None,
    corner_colours: bool = False,
    simplify: int | None = None,
    animation: str | Animation | None = None,
) -> Mesh:
    """Load the mesh of a name or a file, and report its notes (`colonnade.common.notes`).

    Names are ``teapot`` and ``teapot:LEVEL``, the solids (``sphere:TRIANGLES``, ``cube`` …), the well-known meshes
    (``bunny`` …), and the files without their suffix in the folders of the environment variable COLONNADE_MESHES. With
    ``:N`` each triangle of a file of these is cut in four, N times.

    Args:
        name_or_path: The name or file.
        crease: Angle up to which edges are smooth, degrees, in place of the file's normals. None: the file's normals,
            without them the default angle.
        corner_colours: Keep the colours of the corners. Otherwise a face has one colour, the mean of its corners.
        simplify: Simplify a mesh of more triangles to about so many; a line tells both numbers. None: all of them.
        animation: An animation of a glTF file, or the name or number of one of the mesh's own file, whose clip the mesh
            gets. It cannot be simplified.

    Raises:
        UserError: The mesh does not exist or cannot be rendered.
    """
    animation = Animation(animation) if isinstance(animation, str) else animation
    mesh = _loaded(name_or_path, crease, corner_colours, animation)
    notes.report(mesh.notes)
    return mesh if simplify is None or len(mesh.faces) <= simplify else _simplified(mesh, simplify)


def _simplified(mesh: Mesh, triangles: int) -> Mesh:
    parts = simplified(mesh, triangles)
    result = clean_mesh(
        parts.vertices,
        parts.faces,
        name=mesh.name,
        materials=mesh.materials,
        face_materials=mesh.face_materials[parts.owners],
        normals=parts.corner_normals,
        colours=parts.corner_colours,
        textures=mesh.textures,
        uvs=parts.corner_uvs,
        sources=(mesh.source_faces[parts.owners].astype(np.int64), mesh.source_count),
    )
    line = f"mesh {mesh.name}: {len(mesh.faces):,} triangles are simplified to {len(result.faces):,}"
    if len(result.faces) > 1.1 * triangles:
        line += f", not to {triangles:,}, since more would fold it"
    if parts.seams:
        line += f", of which {parts.seams:,} across seams of textures have the coordinates of one side"
    notes.tell(line)
    return replace(result, notes=mesh.notes)


def _loaded(name_or_path: str | Path, crease: float | None, corner_colours: bool, animation: Animation | None) -> Mesh:
    text = str(name_or_path)
    if isinstance(name_or_path, str) and (built := _built_in(text)) is not None:
        if animation is not None:
            raise UserError(f"mesh {text} has no animations: leave out mesh.animation, or give a glTF file")
        return clean_mesh(*built, name=text, crease=crease)
    file = _file_of(name_or_path)
    mesh = _read(file.path, file.subdivisions, crease, corner_colours, animation)
    return mesh if file.is_path else replace(mesh, name=text)


@dataclass(frozen=True)
class _File:
    """The file of a mesh, how often its triangles are cut in four, and whether its path was given, not its name."""

    path: Path
    subdivisions: int
    is_path: bool


def _file_of(name_or_path: str | Path) -> _File:
    """The file of a mesh that is not built in."""
    text = str(name_or_path)
    looks_like_path = os.sep in text or Path(text).suffix.lower() in SUFFIXES
    if not isinstance(name_or_path, str) or looks_like_path or is_file(Path(text)):
        return _File(Path(text), 0, True)
    base, colon, number = text.partition(":")
    found = catalog.find(base)
    return _File(found.path, found.subdivisions + _size(text, number, 0, 0, SUBDIVISION_LIMIT, bool(colon)), False)


def stated_triangles(name_or_path: str | Path) -> int:
    """The least number of triangles of a mesh, from the header of its file; 0 if it is unknown, or built in.

    Raises:
        UserError: There is no mesh of this name.
    """
    base = str(name_or_path).partition(":")[0]
    if isinstance(name_or_path, str) and base in ("teapot", *primitives.PLAIN, *primitives.SIZED):
        return 0
    file = _file_of(name_or_path)
    return stated.stated_triangles(file.path) << 2 * file.subdivisions


def _built_in(name: str) -> tuple[Floats, Faces] | None:
    """Make the teapot or a solid; None for other names."""
    base, colon, argument = name.partition(":")
    if base in primitives.PLAIN and not colon:
        return primitives.PLAIN[base]()
    if base == "teapot":
        return teapot.tessellate(_size(name, argument, TEAPOT_LEVEL, 1, TEAPOT_LIMIT, bool(colon)))
    if base in primitives.SIZED:
        make, default, minimum, maximum = primitives.SIZED[base]
        return make(_size(name, argument, default, minimum, maximum, bool(colon)))
    return None


def _size(name: str, argument: str, default: int, minimum: int, maximum: int, given: bool) -> int:
    if not given:
        return default
    if not re.fullmatch("[0-9]{1,9}", argument) or not minimum <= int(argument) <= maximum:
        raise UserError(f"mesh {name}: the number after the colon must be from {minimum} to {maximum:,}")
    return int(argument)


def _read(
    path: Path, subdivisions: int, crease: float | None, corner_colours: bool, animation: Animation | None
) -> Mesh:
    """Read a mesh file and split each triangle into four ``subdivisions`` times."""
    require_regular(path, "mesh file")
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: the suffix of a mesh file must be one of {', '.join(SUFFIXES)}")
    if animation is not None and subdivisions:
        raise UserError(f"mesh {path} is subdivided, a clip is not: leave out mesh.animation, or the subdivisions")
    if path.stat().st_size == 0:
        raise UserError(f"mesh file {path} is empty")
    try:
        with np.errstate(all="ignore"):  # of numbers that are refused or noted
            file = read_surface(path, animation)
    except (ImportError, MemoryError):
        raise
    except UserError as error:
        raise error if str(path) in str(error) else UserError(f"mesh {path}: {error}") from None
    except (ValueError, IndexError) as error:  # of a number or a list that is not one
        raise UserError(f"{path} cannot be read as a mesh: a value is not valid: {error}") from None
    except Exception as error:  # readers raise many types on invalid data
        raise UserError(f"{path} cannot be read as a mesh: {type(error).__name__}: {error}") from None
    losses = file.losses
    try:
        surface = with_swatches(without_alpha(file.surface, losses))
    except UserError as error:
        raise UserError(f"mesh {path}: {error}") from None
    vertices, faces, normals = surface.vertices, surface.faces, surface.normals
    materials, face_materials, colours = surface.materials, surface.material_index, surface.colours
    uvs, relief = surface.uvs, surface.relief
    if colours is not None and corner_colours:
        materials, face_materials, colours = corner_coloured_materials(materials, face_materials, colours)
    else:
        means = None if colours is None else colours.mean(axis=1)
        materials, face_materials, number = coloured_materials(materials, face_materials, means)
        losses.add(lost.COLOURS, number)
        colours = None
    for _ in range(subdivisions):
        if relief is not None:
            quarters = subdivide_corners(np.repeat(np.eye(3)[None], len(faces), axis=0))
            relief = relief.pieces(np.repeat(np.arange(len(faces)), 4), quarters)
        vertices, faces = subdivide(vertices, faces)
        normals = None if normals is None else subdivide_corners(unit_vectors(normals))
        colours = None if colours is None else subdivide_corners(colours)
        uvs = None if uvs is None else subdivide_corners(uvs)
    if len(materials) > MAX_MATERIALS:
        raise UserError(f"mesh {path} has {len(materials):,} materials: use at most {MAX_MATERIALS}")
    return clean_mesh(
        vertices,
        faces.astype(np.int32),
        name=path.stem,
        where=str(path),
        materials=materials,
        face_materials=np.repeat(face_materials.astype(np.uint8), 4**subdivisions),
        normals=normals,
        crease=crease,
        losses=losses,
        colours=colours,
        textures=surface.textures,
        uvs=uvs,
        single_sided=None if surface.single_sided is None else np.repeat(surface.single_sided, 4**subdivisions),
        sources=None if surface.source_faces is None or subdivisions else (surface.source_faces, surface.source_count),
        relief=relief,
        moves=surface.moves,
    )


def clean_mesh(
    vertices: Floats,
    faces: Faces,
    name: str,
    where: str | None = None,
    materials: tuple[MeshMaterial, ...] = (PLAIN,),
    face_materials: npt.NDArray[np.uint8] | None = None,
    normals: Floats | None = None,
    crease: float | None = None,
    losses: Losses | None = None,
    colours: Floats | None = None,
    textures: tuple[Texture, ...] = (),
    uvs: Floats | None = None,
    single_sided: npt.NDArray[np.bool_] | None = None,
    sources: tuple[Indices, int] | None = None,
    relief: Relief | None = None,
    moves: ClipFaces | None = None,
) -> Mesh:
    """Clean raw vertices and faces.

    Args:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
        name: Name of the mesh.
        where: Its source, in messages.
        materials: The materials.
        face_materials: uint8 [m]; None: all faces have the first material.
        normals: Normals of the file, float64 [m, 3, 3]; see `colonnade.mesh.geometry.cleaning.clean`.
        crease: Crease angle, degrees, in place of ``normals``.
        losses: What the file lost so far; what is repaired here is added.
        colours: Corner colours, float64 [m, 3, 3]; see `Mesh.corner_colours`.
        textures: The textures of the materials.
        uvs: Texture coordinates of the corners, float64 [m, 3, 2]; see `Mesh.corner_uvs`.
        single_sided: Faces whose back viewers do not show, bool [m]; None: none.
        sources: The face of the file that each is a part of, int64 [m], and their number; None: themselves.
        relief: Normal maps, which are baked into the corner normals; None: none.
        moves: What moves the faces; None: nothing.

    Raises:
        UserError: A vertex is not finite, the size is out of range, or no face has an area.
    """
    label = f"mesh {where or name}"
    losses = Losses() if losses is None else losses
    source_faces, source_count = (np.arange(len(faces)), len(faces)) if sources is None else sources
    cleaned = clean(vertices, faces, normals, crease, source_count)
    if isinstance(cleaned, str):
        raise UserError(label + cleaned.removeprefix("the mesh"))
    keep = cleaned.sources
    vertices, faces = cleaned.vertices, cleaned.faces
    colours, uvs = (None if values is None else values[keep] for values in (colours, uvs))
    has_backs = single_sided is not None and bool((single_sided[keep] & cleaned.is_open).any())
    for values in (colours, uvs):
        if values is not None:
            values[cleaned.reversed] = values[cleaned.reversed][:, ::-1]
    relief = None if relief is None else relief.kept(keep).reversed(cleaned.reversed)
    moves = None if moves is None else moves.kept(keep).reversed(cleaned.reversed)
    repairs = (lost.MIXED, lost.INVERTED, lost.FLIPPED, lost.REPLACED, lost.MISSING)
    for loss, number in zip(repairs, cleaned.repairs, strict=True):
        losses.add(loss, number)
    sources_kept = source_faces[keep].astype(np.int32)
    materials_kept = np.zeros(len(faces), dtype=np.uint8) if face_materials is None else face_materials[keep]
    corners_normals = cleaned.normals
    if relief is not None and (relief.index >= 0).any():
        parts = baked(vertices, faces, cleaned.normals, relief, losses)
        colours, uvs = (None if values is None else parts.corners(values) for values in (colours, uvs))
        sources_kept, materials_kept = sources_kept[parts.owners], materials_kept[parts.owners]
        vertices, faces, corners_normals = parts.vertices, parts.faces, parts.normals
        moves = None if moves is None else moves.pieces(parts.owners, parts.weights)
    clip, clip_corners = (None, None) if moves is None else moves.with_vertices()
    return Mesh(
        vertices=vertices,
        faces=faces,
        corner_normals=corners_normals,
        materials=materials,
        face_materials=materials_kept,
        source_faces=sources_kept,
        source_count=source_count,
        name=name,
        notes=losses.lines(label) + ((f"{label}: {lost.BACKS}",) if has_backs else ()),
        corner_colours=colours,
        textures=textures,
        corner_uvs=uvs,
        clip=clip,
        clip_corners=clip_corners,
    )
