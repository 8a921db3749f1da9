"""The packer: converts a mesh to the records of the column memory.

The C++ packer (``cpp/packer``) quantises the vertices, drops degenerate triangles, and builds the tree. Its leaves are
pairs of triangles with a common edge, or triangles. It fills the records by the manifest's layouts.
The tree begins at record 0, without one its leaves alone in the same order. If a material uses colours, each leaf's
companion follows it. Addresses in nodes are absolute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest, field_places
from colonnade.maps.encoders import Encoder
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.palette import TEXTURE_HARDWARE, table_entries
from colonnade.scene_image.atlas import Atlas, make_atlas, uv_codes
from colonnade.scene_image.bending import Bending, at_rest
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.grid_clip import grid_clip
from colonnade.scene_image.header import ImageHeader, ObjectFrame, TreeStatistics
from colonnade.scene_image.textures import with_textures

Units = npt.NDArray[np.int32]
#: Largest configurable depth of the column memory, records.
MAX_MEMORY_DEPTH = 1 << 22


@dataclass(frozen=True)
class QuantisedMesh:
    """A mesh with vertices rounded to vertex units.

    Attributes:
        vertices: int32 [n, 3], 0 to 2^vertexBits − 1; one for each vertex of the mesh.
        faces: int32 [m, 3], without degenerate faces.
        mesh_faces: int64 [m], their indices in the mesh's faces.
        frame: Transform from mesh space to vertex units.
    """

    vertices: Units
    faces: npt.NDArray[np.int32]
    mesh_faces: npt.NDArray[np.int64]
    frame: ObjectFrame


def quantise(mesh: Mesh, vertex_bits: int) -> QuantisedMesh:
    """Scale a mesh uniformly into the centre of the cube [0, 2^vertex_bits − 1]³ and round to nearest.

    The low planes of its box are integers, so that a flat side stays flat. Faces that become degenerate, or equal to an
    earlier face, are dropped.

    Raises:
        UserError: All faces become degenerate.
    """
    from colonnade import _core

    values: dict[str, Any] = _core.quantise(mesh.vertices, mesh.faces, vertex_bits)
    if len(values["mesh_faces"]) == 0:
        raise UserError(f"mesh {mesh.name}: no triangle keeps an area at geometry.vertexBits {vertex_bits}: raise it")
    frame = ObjectFrame(values.pop("scale"), tuple(values.pop("offset")))
    return QuantisedMesh(**values, frame=frame)


def pack(
    mesh: Mesh,
    manifest: Manifest,
    materials: Sequence[MeshMaterial] | None = None,
    headroom: float = 1.0,
    encoder: Encoder | None = None,
    children: int = 4,
) -> SceneImage:
    """Pack a mesh into a scene image for a design.

    Args:
        mesh: The mesh.
        manifest: The design's manifest.
        materials: Materials that replace the mesh's. The records only contain which faces are glass.
        headroom: Factor of the scene's lights, by which the corner colours of diffuse faces are darker.
        encoder: Of textures.
        children: Most children of a node, 2 to 4.

    Raises:
        UserError: The mesh does not fit, or has corner colours or textures that the design lacks; the message names the
            setting.
    """
    materials = mesh.materials if materials is None else tuple(materials)
    colours, atlas = surface_colours(mesh, manifest, materials, headroom)
    image = pack_geometry(mesh, manifest, materials, colours, children)
    return with_textures(image, atlas, texture_count(materials), manifest, encoder)


def surface_colours(
    mesh: Mesh, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float
) -> tuple[npt.NDArray[np.int64] | None, Atlas | None]:
    """The colours of a mesh's corners as records hold them, int64 [faces, 3, 3], and its atlas; None without any.

    Arguments and errors are as for `pack`.
    """
    atlas = _atlas(mesh, manifest, materials, headroom)
    return _corner_colours(mesh, manifest, materials, headroom, atlas), atlas


def texture_count(materials: Sequence[MeshMaterial]) -> int:
    """Number of the textures of materials."""
    return len({material.texture for material in materials} - {None})


def pack_geometry(
    mesh: Mesh,
    manifest: Manifest,
    materials: Sequence[MeshMaterial],
    colours: npt.NDArray[np.int64] | None,
    children: int = 4,
) -> SceneImage:
    """Pack a mesh without its textures; `colours` are by `surface_colours`, the rest as in `pack`."""
    from colonnade import _core

    bits = int(manifest.config["geometry"]["vertexBits"])
    clip = None if mesh.clip is None else grid_clip(mesh, bits)
    if clip is None:
        quantised, corner_normals = quantise(mesh, bits), mesh.corner_normals
    else:
        vertices, normals = at_rest(clip, manifest)
        quantised = QuantisedMesh(vertices, clip.corners, np.arange(len(clip.corners)), clip.frame)
        corner_normals = normals[clip.corners]
    entries, index = table_entries(materials)
    is_glass = np.array([material.kind == "glass" or material.coverage < 0.5 for material in materials])
    check_triangles(mesh.name, len(quantised.faces), manifest, 1 if colours is None else 2)
    packing: Any = _core.Packing(
        quantised.vertices,
        quantised.faces,
        quantised.mesh_faces,
        corner_normals,
        index.astype(np.uint8)[mesh.face_materials],
        is_glass[mesh.face_materials],
        colours,
        record_format(manifest) | {"children": children, "bends": int(clip is not None)},
        field_places(manifest.layouts),
    )
    sections, faces = packing.sections(), packing.faces()
    tree = TreeStatistics(**packing.statistics())
    _check_fits(mesh.name, manifest, tree, sections["record_count"])
    header = ImageHeader(
        format_hash=manifest.format_hash,
        mesh=mesh.name,
        source_triangles=mesh.source_count,
        triangles=len(quantised.faces),
        record_bits=manifest.record_bits,
        frame=quantised.frame,
        extent=mesh.extent,
        materials=entries,
        tree=tree if manifest.bvh else None,
        parts=mesh.parts,
        **sections,
    )
    bending = None
    if clip is not None:
        edge = max(high - low for low, high in zip(clip.low, clip.high, strict=True))
        header = replace(header, bounds_low=clip.low, bounds_high=clip.high, largest_triangle=edge)
        corners = packing.leaf_corners()
        leaves = np.where(corners < 0, -1, clip.corners.reshape(-1)[corners])
        bending = Bending.of(clip, manifest, sections["record_count"], tree.depth, leaves, colours is not None)
    sources = np.where(faces < 0, -1, mesh.source_faces[quantised.mesh_faces[faces]])
    return SceneImage(header, packing.records(), sources.astype(np.int32), moves=bending)


def record_format(manifest: Manifest) -> dict[str, int]:
    """What records depend on beside their layouts, as the C++ packer names it."""
    geometry = manifest.config["geometry"]
    names = ("vertexBits", "boxBits", "bvh")
    return {
        **{name: int(geometry[name]) for name in names},
        "recordBits": manifest.record_bits,
        "stackDepth": int(manifest.config["columnBvhMemory"]["stackDepth"]),
        "normalFraction": manifest.numbers["normalFraction"],
    }


def memory_use(header: ImageHeader, manifest: Manifest) -> dict[str, Any]:
    """Use of each memory for reports: records, bytes, stack entries, and a room's maps."""
    from colonnade.scene_image.environment import environment_use

    depth = int(manifest.memories["columnBvh"]["depth"])
    use: dict[str, Any] = {
        "columnBvhMemory": {
            "records": header.record_count,
            "depth": depth,
            "share": header.record_count / depth,
            "bytes": header.record_count * header.record_bits // 8,
            "nodes": header.nodes,
            "triangles": header.leaves,
            "attributes": header.leaves if header.has_colours else 0,
        }
    }
    if header.tree is not None:
        stack_depth = int(manifest.config["columnBvhMemory"]["stackDepth"])
        use["stack"] = {"bound": header.tree.stack_bound, "depth": stack_depth}
    if header.room is not None:
        use["physicalAttributeMemory"] = environment_use(header, manifest)
    return use


def _check_fits(name: str, manifest: Manifest, tree: TreeStatistics, record_count: int) -> None:
    _check_records(name, manifest, record_count)
    stack_depth = int(manifest.config["columnBvhMemory"]["stackDepth"])
    if manifest.bvh and tree.stack_bound > stack_depth:
        raise UserError(
            f"mesh {name} needs a stack of {tree.stack_bound} entries even with a balanced tree,"
            f" columnBvhMemory.stackDepth is {stack_depth}: raise columnBvhMemory.stackDepth"
        )


def check_triangles(name: str, triangles: int, manifest: Manifest, leaf_records: int = 1, about: str = "") -> None:
    """Refuse a mesh of more triangles than a design holds if all are in pairs: its tree may take minutes.

    Args:
        name: Of the mesh.
        triangles: Their number.
        manifest: The design's manifest.
        leaf_records: Records of a leaf.
        about: What the message says before the number.

    Raises:
        UserError: They are too many.
    """
    depth = int(manifest.memories["columnBvh"]["depth"])
    # A tree of n leaves has (n - 1) / 3 nodes of four children
    max_triangles = 2 * ((3 * depth + 1) // (3 * leaf_records + 1) if manifest.bvh else depth // leaf_records)
    if triangles > max_triangles:
        # Nodes, and triangles without a partner, are about half as many as pairs
        advice = _advice(manifest, -(-triangles // 2) * leaf_records * 3 // 2)
        raise UserError(
            f"mesh {name} has {about}{triangles:,} triangles, the {depth:,} records of columnBvhMemory.depth hold"
            f" {max_triangles:,} at most: {advice}"
        )


def _advice(manifest: Manifest, record_count: int) -> str:
    """What to do with a mesh of so many records."""
    enough = 1 << (record_count - 1).bit_length()
    advice = "simplify the mesh (--simplify)"
    if manifest.memories["columnBvh"].get("line") is None:
        advice += ", or take a preset whose scene lies in DRAM, such as edge"
    if enough <= MAX_MEMORY_DEPTH:
        advice = f"raise columnBvhMemory.depth to {enough}, {advice}"
    return advice


def _check_records(name: str, manifest: Manifest, record_count: int) -> None:
    depth = int(manifest.memories["columnBvh"]["depth"])
    if record_count > depth:
        raise UserError(
            f"mesh {name} needs {record_count:,} records, columnBvhMemory.depth is {depth:,}:"
            f" {_advice(manifest, record_count)}"
        )


def _atlas(mesh: Mesh, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float) -> Atlas | None:
    """The atlas of a mesh; None without textures."""
    if manifest.texture is None:
        if any(material.texture is not None for material in materials):
            raise UserError(f"mesh {mesh.name} has textures, the hardware has none: {TEXTURE_HARDWARE}")
        return None
    return make_atlas(mesh, materials, headroom, manifest.texture.sizes["width"])


def _corner_colours(
    mesh: Mesh, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float, atlas: Atlas | None
) -> npt.NDArray[np.int64] | None:
    """The colours of the records, int64 [faces of the mesh, 3, 3]; None if no material uses them.

    On textured faces red and green are positions in the atlas.
    """
    if not manifest.corner_colours:
        if any(material.has_corner_colours for material in materials):
            raise UserError(
                f"mesh {mesh.name} has colours at its corners, the hardware has none: set geometry.cornerColours=true"
            )
        return None
    if atlas is None and not any(material.has_corner_colours for material in materials):
        return None
    values = np.zeros((len(mesh.faces), 3, 3), dtype=np.int64)
    if mesh.corner_colours is not None:
        values = _colour_codes(mesh, mesh.corner_colours, manifest, materials, headroom)
    if atlas is not None and manifest.texture is not None:
        is_textured = np.array([material.texture is not None for material in materials])[mesh.face_materials]
        values[is_textured, :, :2] = uv_codes(atlas, manifest.texture.sizes["fractionBits"])[is_textured]
    return values


def _colour_codes(
    mesh: Mesh, colours: Floats, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float
) -> npt.NDArray[np.int64]:
    white = (1 << manifest.numbers["colourBits"]) - 1
    factors = [
        np.array(material.albedo) / (headroom if material.kind == "diffuse" else 1.0) * material.has_corner_colours
        for material in materials
    ]
    return np.rint(colours * np.array(factors)[mesh.face_materials][:, None] * white).astype(np.int64)
