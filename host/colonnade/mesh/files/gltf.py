"""Reads glTF files: the triangles of the default scene with normals, materials, base-colour textures, vertex colours.

This is our own code because trimesh drops transmission, mixes up normals under scaling, and does not say what it
leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order
from colonnade.common.input_files import read_input, require_regular
from colonnade.common.limits import MAX_MESH_BYTES, MAX_TRIANGLES
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import cofactors, unit_vectors
from colonnade.mesh import losses as lost
from colonnade.mesh.clips.tracks import Animation
from colonnade.mesh.files.gltf_clip import ClipReader
from colonnade.mesh.files.gltf_document import COMPRESSION, DRACO, INSTANCING, GltfDocument
from colonnade.mesh.files.gltf_draco import DracoPrimitives, PrimitiveArrays
from colonnade.mesh.files.gltf_emission import emission_of, emission_pieces
from colonnade.mesh.files.gltf_metal import metal_of, of_map
from colonnade.mesh.files.gltf_relief import relief_of
from colonnade.mesh.files.gltf_textures import GltfTextures, TextureUse
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses, extension_loss
from colonnade.mesh.materials.materials import (
    DARK,
    PLAIN,
    MeshMaterial,
    Vector,
    from_gltf,
    gltf_emission,
    gltf_losses,
    metal_factors,
    unused_extensions,
)
from colonnade.mesh.materials.palette import MAX_MATERIALS
from colonnade.mesh.materials.roughness import merged_roughness, surface_areas
from colonnade.mesh.materials.surface import Pieces, RawSurface, joined
from colonnade.mesh.materials.texture import MAX_UV

#: Materials of a file up to which those with a map have all of its roughnesses.
_MAPPED_MATERIALS = 64

#: Modes of primitives.
_POINTS, _LINE_MODES, _TRIANGLES, _STRIP, _FAN = 0, (1, 2, 3), 4, 5, 6


def read_gltf(
    data: bytes, path: Path, references: References, losses: Losses, animation: Animation | None = None
) -> RawSurface:
    """Read a glTF file, text or binary, with the transforms of its nodes.

    Args:
        data: Its bytes.
        path: Its path, for messages.
        references: The files beside it.
        losses: Counts what is not read.
        animation: An animation, whose clip the surface gets. None: skins and morph targets are not applied.

    Raises:
        UserError: The file is invalid, or requires an extension that is not supported.
    """
    document = GltfDocument(data, path, references)
    document.check_extensions()
    textures = GltfTextures(document, references, losses)
    clip = None if animation is None else ClipReader(document, animation.name, losses, _source_of(animation))
    surfaces, parts = _parts(document, textures, losses, clip)
    materials = (*(from_gltf(material) for material in document.json.get("materials", [])), PLAIN)
    found = list(materials)
    for index in sorted({part.material for part in parts} - {len(materials) - 1}):
        material = document.entry("materials", index)
        losses.update(gltf_losses(material))
        losses.update((extension_loss(name), 1) for name in unused_extensions(material))
        if textures.emission_of(index) is not None:
            found[index] = replace(found[index], emission=DARK)
        losses.add(lost.BRIGHT, any(found[index].emission) and max(gltf_emission(material)) > 1.0)
    _count_other(document, losses, clip is not None)
    textures.reader.count_losses()
    if not parts:
        if len(document.json.get("scenes", [])) > 1:
            raise document.error("its default scene has no faces: choose another one by scene in the file")
        if document.json.get("animations"):
            raise document.error("it has animations and no faces: give it as mesh.animation_file of a mesh")
        return RawSurface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    surface = joined(surfaces)
    if clip is not None:
        surface, is_mirrored = clip.surface(surface)
        ends = np.cumsum([part.count for part in parts])[:-1]
        parts = [part.reversed(own) for part, own in zip(parts, np.split(is_mirrored, ends), strict=True)]
    surface, parts = _bisected(surface, parts, document, materials, textures)
    parts = _with_emission(surface, parts, document, materials, textures, losses)
    materials, face_materials = _materials_of(tuple(found), parts, textures)
    areas = surface_areas(surface.vertices, surface.faces, face_materials, len(materials))
    materials, _ = merged_roughness(materials, areas, max(_MAPPED_MATERIALS, len(found)))
    two_sided = [bool(material.get("doubleSided", False)) for material in document.json.get("materials", [])] + [True]
    single_sided = np.concatenate([np.full(part.count, not two_sided[part.material]) for part in parts])
    colours = surface.colours
    if colours is not None:
        colours = colours * np.array([material.albedo for material in materials])[face_materials][:, None]
    return replace(
        surface,
        materials=materials,
        face_materials=face_materials,
        colours=colours,
        textures=tuple(textures.reader.textures),
        single_sided=single_sided,
    )


def _source_of(animation: Animation) -> GltfDocument | None:
    """The file of an animation; None: it is in that of the mesh."""
    file = animation.file
    if file is None:
        return None
    require_regular(file, "animation file")
    return GltfDocument(read_input(file, "the animation", MAX_MESH_BYTES), file, References(file), "animation file")


@dataclass(frozen=True)
class _Part:
    """What the faces of a primitive are.

    Attributes:
        count: Their number.
        material: The number of their material in the file.
        is_textured: Whether they show its texture.
        metal: Faces that are metal by a map, bool [m], and their roughness, float64 [m]; None without a map.
        emission_uvs: Positions of the corners in an emission map, float64 [m, 3, 2]; None without them.
        emission: Of faces by a map, linear, float64 [m, 3]; None without a map.
    """

    count: int
    material: int
    is_textured: bool
    metal: tuple[NDArray[np.bool_], Floats] | None = None
    emission_uvs: Floats | None = None
    emission: Floats | None = None

    def numbers(self, material: MeshMaterial, number: int, number_of: Callable[[MeshMaterial], int]) -> Indices:
        """The material of each face: that of a number, or what its maps make of it, int64 [m]."""
        metal = self.metal if material.kind == "diffuse" else None
        columns = [*(() if metal is None else metal), *(() if self.emission is None else self.emission.T)]
        if not columns:
            return np.full(self.count, number)
        kinds, places = np.unique(np.column_stack(columns), axis=0, return_inverse=True)
        found = []
        for values in kinds.tolist():
            own = material if self.emission is None else replace(material, emission=tuple(values[-3:]))
            found.append(number_of(own if metal is None else of_map(own, bool(values[0]), values[1])))
        return np.array(found)[places.reshape(-1)]

    def pieces(self, pieces: Pieces) -> _Part:
        """That of parts of the faces."""
        uvs, metal = self.emission_uvs, self.metal
        return replace(
            self,
            count=len(pieces.owners),
            metal=None if metal is None else (metal[0][pieces.owners], metal[1][pieces.owners]),
            emission_uvs=None if uvs is None else pieces.corners(uvs),
        )

    def reversed(self, faces: NDArray[np.bool_]) -> _Part:
        """That of faces some of which have the other winding, bool [m]."""
        uvs = self.emission_uvs
        return self if uvs is None else replace(self, emission_uvs=np.where(faces[:, None, None], uvs[:, ::-1], uvs))


def _parts(
    document: GltfDocument, textures: GltfTextures, losses: Losses, clip: ClipReader | None
) -> tuple[list[RawSurface], list[_Part]]:
    """The primitives of the default scene, whose vertices a clip takes; refused if they have too many materials."""
    compressed, default = DracoPrimitives(document), len(document.json.get("materials", []))
    skins = lost.PLAYABLE_SKINS if document.json.get("animations") else lost.SKINS
    surfaces: list[RawSurface] = []
    parts: list[_Part] = []
    # Of surfaces that no texture or corner colours; metal by a map keeps these, too
    plain: set[tuple[Vector, float]] = set()
    triangles = 0
    for index, matrices in document.placements(losses, is_animated=clip is not None):
        node = document.entry("nodes", index)
        losses.add(skins, len(matrices) if clip is None and "skin" in node else 0)
        for primitive in document.entry("meshes", node["mesh"]).get("primitives", []):
            losses.add(lost.MORPHS, 0 if clip is not None else len(matrices) * len(primitive.get("targets", [])))
            to_scene = matrices if clip is None else np.eye(4)[np.newaxis]
            left = MAX_TRIANGLES - triangles
            found = _primitive(document, primitive, to_scene, default, losses, textures, compressed, left)
            if found is None:
                continue
            surface, part = found
            if clip is not None:
                clip.add(index, primitive, compressed.arrays(primitive), surface.vertices)
                surface = replace(surface, relief=None if surface.relief is None else surface.relief.without_tangents)
            surfaces.append(surface)
            parts.append(part)
            triangles += part.count
            if part.material != default and part.count and not part.is_textured and surface.colours is None:
                material = from_gltf(document.entry("materials", part.material))
                if material.alpha is None:
                    plain.add((material.albedo, material.ior))
            if len(plain) > MAX_MATERIALS:
                raise document.error(f"it has more than {MAX_MATERIALS} materials: use at most {MAX_MATERIALS}")
    return surfaces, parts


def _bisected(
    surface: RawSurface,
    parts: list[_Part],
    document: GltfDocument,
    materials: tuple[MeshMaterial, ...],
    textures: GltfTextures,
) -> tuple[RawSurface, list[_Part]]:
    """A surface and its parts, with pieces of faces on which the emission by a map varies, and of their neighbours."""
    for number in sorted({part.material for part in parts if part.emission_uvs is not None}):
        use = textures.emission_of(number)
        if use is None or not any(materials[number].emission):
            continue
        counts = [part.count for part in parts]
        shows = [part.material == number and part.emission_uvs is not None for part in parts]
        found = emission_pieces(
            textures.reader.textures[use.texture],
            gltf_emission(document.entry("materials", number)),
            surface,
            np.repeat(shows, counts),
            np.concatenate(
                [
                    np.zeros((count, 3, 2)) if part.emission_uvs is None else part.emission_uvs
                    for part, count in zip(parts, counts, strict=True)
                ]
            ),
        )
        if len(found.owners) == sum(counts):
            continue
        surface = surface.pieces(found)
        starts = np.cumsum([0, *counts])
        ends = np.searchsorted(found.owners, starts)
        parts = [
            part.pieces(Pieces(found.owners[first:last] - start, found.weights[first:last]))
            for part, start, first, last in zip(parts, starts[:-1], ends[:-1], ends[1:], strict=True)
        ]
    return surface, parts


def _with_emission(
    surface: RawSurface,
    parts: list[_Part],
    document: GltfDocument,
    materials: tuple[MeshMaterial, ...],
    textures: GltfTextures,
    losses: Losses,
) -> list[_Part]:
    """The parts of a surface with what their faces emit by the emission maps of their materials."""
    found = list(parts)
    ends = np.cumsum([part.count for part in parts])
    corners = np.split(surface.vertices[surface.faces], ends[:-1])
    for number in {part.material for part in parts} - {len(materials) - 1}:
        use, own = textures.emission_of(number), [i for i, part in enumerate(parts) if part.material == number]
        if use is None or not any(materials[number].emission):
            continue
        factor = np.array(gltf_emission(document.entry("materials", number)))
        texture, mapped = textures.reader.textures[use.texture], [i for i in own if parts[i].emission_uvs is not None]
        colours = {i: np.tile(texture.mean * factor, (parts[i].count, 1)) for i in own}
        if mapped:
            emission = factor * emission_of(
                texture,
                np.concatenate([parts[i].emission_uvs for i in mapped]),  # type: ignore[misc]
                np.concatenate([corners[i] for i in mapped]),
            )
            colours |= zip(mapped, np.split(emission, np.cumsum([parts[i].count for i in mapped])[:-1]), strict=True)
        losses.add(lost.BRIGHT, any((values > 1.0).any() for values in colours.values()))
        for i, values in colours.items():
            found[i] = replace(parts[i], emission=values / values.max(axis=1, initial=1.0, keepdims=True))
    return found


def _materials_of(
    materials: tuple[MeshMaterial, ...], parts: list[_Part], textures: GltfTextures
) -> tuple[tuple[MeshMaterial, ...], Indices]:
    """The materials, with further ones for parts that show their texture, and for metal; that of each face."""
    found, numbers = list(materials), []
    first = {material: number for number, material in reversed(list(enumerate(found)))}

    def number_of(material: MeshMaterial) -> int:
        number = first.setdefault(material, len(found))
        if number == len(found):
            found.append(material)
        return number

    for part in parts:
        use = textures.uses[part.material] if part.is_textured else None
        material, number = materials[part.material], part.material
        if use is not None:
            material = replace(material, texture=use.texture)
            number = number_of(material)
        numbers.append(part.numbers(material, number, number_of))
    return tuple(found), np.concatenate(numbers)


def _count_other(document: GltfDocument, losses: Losses, is_animated: bool) -> None:
    """Count what the file holds beside meshes and materials."""
    json = document.json
    losses.add(lost.CAMERAS, len(json.get("cameras", [])))
    losses.add(lost.ANIMATIONS, 0 if is_animated else len(json.get("animations", [])))
    extensions = json.get("extensions", {})
    extensions = extensions if isinstance(extensions, Mapping) else {}
    for name, content in extensions.items():
        lights = content.get("lights", []) if isinstance(content, Mapping) else []
        if name == "KHR_lights_punctual":
            losses.add(lost.LIGHTS, len(lights))
        else:
            losses.add(extension_loss(name))
    for node in json.get("nodes", []):
        names = node.get("extensions", {})
        losses.update((extension_loss(name), 1) for name in names if name not in ("KHR_lights_punctual", INSTANCING))


def _primitive(
    document: GltfDocument,
    primitive: Mapping[str, Any],
    matrices: Floats,
    default: int,
    losses: Losses,
    textures: GltfTextures,
    compressed: DracoPrimitives,
    left: int,
) -> tuple[RawSurface, _Part] | None:
    """The copies of a primitive, one after the other; None for points and lines.

    Args:
        document: Its document.
        primitive: Its JSON.
        matrices: Transforms of the copies to the scene, float64 [c, 4, 4].
        default: Number of the default material.
        losses: Counts what is not read.
        textures: Those of the document.
        compressed: The decoder of the document's primitives.
        left: Triangles that they may have.
    """
    copies = len(matrices)
    mode, attributes = primitive.get("mode", _TRIANGLES), primitive.get("attributes", {})
    if mode == _POINTS or mode in _LINE_MODES:
        losses.add(lost.POINTS if mode == _POINTS else lost.LINES, copies)
        return None
    if mode not in (_TRIANGLES, _STRIP, _FAN):
        raise document.error(f"a primitive has the unknown mode {mode}")
    for name in primitive.get("extensions", {}):
        if name in COMPRESSION and "bufferView" not in document.entry("accessors", attributes.get("POSITION")):
            raise document.compressed(name)
        losses.add(extension_loss(name), 0 if name in (DRACO, *COMPRESSION) else copies)
    if "POSITION" not in attributes:
        raise document.error("a primitive has no positions")
    arrays = compressed.arrays(primitive)
    positions = arrays.attribute("POSITION").astype(np.float64, copy=False)
    if positions.shape[1] != 3:
        raise document.error("the positions of a primitive are not of type VEC3: export it again")
    count = len(positions)

    def attribute(name: str, width: int) -> Floats | None:
        if name not in attributes:
            return None
        values = arrays.attribute(name)
        if len(values) != count or values.shape[1] < width:
            raise document.error(f"a primitive has {len(values):,} of {name} for {count:,} positions")
        return np.asarray(values[:, :width], dtype=np.float64)

    corners = _corners(document, arrays, count)
    mode = mode if arrays.mesh is None else _TRIANGLES
    own = _faces(corners, mode)
    if copies * len(own) > left:
        raise document.error(f"it has more than {MAX_TRIANGLES:,} triangles: leave some out")
    losses.add(lost.SPARE_CORNERS, copies * (len(corners) % 3) if mode == _TRIANGLES else 0)
    width = arrays.attribute("COLOR_0").shape[1] if "COLOR_0" in attributes else 0
    colours, alphas = attribute("COLOR_0", max(width, 3)), None
    if colours is not None:
        if not np.isfinite(colours).all():
            raise document.error("a primitive has a COLOR_0 that is not a finite number: export it again")
        losses.add(lost.CLIPPED_COLOURS, copies * int(((colours < 0) | (colours > 1)).any(axis=1).sum()))
        colours, alphas = colours[:, :3], np.clip(colours[:, 3], 0.0, 1.0) if width == 4 else None
    normals = attribute("NORMAL", 3)
    linear = matrices[:, :3, :3]
    turning = cofactors(linear)
    is_mirrored = fixed_order.dot(linear[:, :, 0], turning[:, :, 0])[:, np.newaxis, np.newaxis] < 0
    if normals is not None:
        turned = fixed_order.product(unit_vectors(normals), turning.transpose(0, 2, 1))
        normals = unit_vectors(turned * np.where(is_mirrored, -1.0, 1.0)).reshape(-1, 3)
    # Faces of the copies: in the vertices of all of them, and in those of the file
    placed = np.where(is_mirrored, own[:, ::-1], own)
    places = placed.reshape(-1, 3)
    faces = (placed + count * np.arange(copies)[:, np.newaxis, np.newaxis]).reshape(-1, 3)
    material = primitive.get("material", default)
    has_alpha = False
    if material != default or "material" in primitive:
        has_alpha = from_gltf(document.entry("materials", material)).alpha is not None
    if alphas is not None and not has_alpha:
        losses.add(lost.ALPHA, copies * int((alphas < 1.0).sum()))
    use = textures.use_of(int(material)) if material != default else None
    uvs = None if use is None else attribute(use.coordinates, 2)
    if uvs is not None and use is not None:
        uvs = use.uvs(uvs)
    if uvs is not None and not (np.abs(uvs) <= MAX_UV).all():
        raise document.error(
            f"a primitive has texture coordinates beyond {MAX_UV:,.0f}, or not finite: export it again"
        )
    if use is not None:
        losses.add(lost.NO_UVS, len(faces) if uvs is None else 0)
    relief = textures.normals_of(int(material)) if material != default else None
    shows_colours = colours is not None and not (colours == 1.0).all()
    if uvs is not None:
        losses.add(lost.TEXTURED_COLOURS, len(faces) if shows_colours else 0)
        shows_colours = False
    surface = RawSurface(
        vertices=(fixed_order.product(positions, linear.transpose(0, 2, 1)) + matrices[:, np.newaxis, :3, 3]).reshape(
            -1, 3
        ),
        faces=faces,
        normals=None if normals is None else normals[faces],
        colours=np.clip(colours, 0, 1)[places] if colours is not None and shows_colours else None,
        uvs=None if uvs is None else uvs[places],
        alphas=None if alphas is None else alphas[places],
        relief=relief_of(relief, attribute, faces, linear, losses),
    )

    def positions_in(use: TextureUse | None) -> Floats | None:
        found = None if use is None else attribute(use.coordinates, 2)
        known = use is not None and found is not None and bool((np.abs(found) <= MAX_UV).all())
        return use.uvs(found)[places] if known and use is not None and found is not None else None

    part = _Part(len(faces), int(material), uvs is not None)
    if material == default:
        return surface, part
    metal, emission = textures.metal_of(int(material)), textures.emission_of(int(material))
    if metal is not None and (at := positions_in(metal)) is not None:
        factors = metal_factors(document.entry("materials", material))
        part = replace(part, metal=metal_of(textures.reader.textures[metal.texture], at, factors))
    return surface, replace(part, emission_uvs=positions_in(emission))


def _corners(document: GltfDocument, arrays: PrimitiveArrays, count: int) -> Indices:
    """The vertices of a primitive in order, int64 [k]."""
    values = arrays.indices()
    if values is None:
        return np.arange(count, dtype=np.int64)
    if values.shape[1] != 1 or values.dtype.kind not in "iu":
        raise document.error("the indices of a primitive are not whole numbers")
    corners = values[:, 0].astype(np.int64, copy=False)
    if len(corners) and int(corners.max()) >= count:
        raise document.error(
            f"a face names vertex {corners.max()}, which does not exist: its primitive has {count:,} vertices,"
            " numbered from 0"
        )
    return corners


def _faces(corners: Indices, mode: int) -> Indices:
    """The triangles of a primitive, int64 [m, 3]."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    start = np.arange(max(0, len(corners) - 2))
    if mode == _FAN:
        return np.stack([corners[start + 1], corners[start + 2], corners[np.zeros_like(start)]], axis=1)
    odd = start % 2
    return np.stack([corners[start], corners[start + 1 + odd], corners[start + 2 - odd]], axis=1)
