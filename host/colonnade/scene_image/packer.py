"""The packer: converts a mesh to the records of the column memory.

It quantises the vertices, drops degenerate triangles, builds the tree, rotates the corners of triangles that share an
edge with the other one of their record, and fills the records by the manifest's layouts.
The sections are nodes, triangles and attributes, in this order. Addresses in nodes are absolute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Bytes, Floats
from colonnade.common.vectors import unit_vectors
from colonnade.design.manifest import Manifest
from colonnade.maps.encoders import Encoder
from colonnade.mesh.materials import MeshMaterial
from colonnade.mesh.mesh import Mesh
from colonnade.mesh.palette import TEXTURE_SETTINGS, table_entries
from colonnade.mesh.topology import drop_faces, merge_rows
from colonnade.scene_image.atlas import Atlas, make_atlas, uv_codes
from colonnade.scene_image.bvh import LEAF, NODE, Bvh, build_bvh
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.header import ImageHeader, ObjectFrame
from colonnade.scene_image.textures import with_textures

Units = npt.NDArray[np.int32]
AXES = "xyz"
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
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    maximum = (1 << vertex_bits) - 1
    edge = float((high - low).max())
    scale = maximum / edge
    start = np.floor((maximum - np.rint((high - low) * scale)) / 2)
    offset = low - start / scale
    vertices = np.clip(np.rint((mesh.vertices - low) * scale) + start, 0, maximum).astype(np.int64)
    # Merge coincident vertices to compare faces
    positions, index = merge_rows(vertices)
    keep = drop_faces(positions, index[mesh.faces])
    if len(keep) == 0:
        raise UserError(f"mesh {mesh.name}: no triangle keeps an area at geometry.vertexBits {vertex_bits}: raise it")
    frame = ObjectFrame(scale, (float(offset[0]), float(offset[1]), float(offset[2])))
    return QuantisedMesh(vertices.astype(np.int32), mesh.faces[keep], keep, frame)


def pack(
    mesh: Mesh,
    manifest: Manifest,
    materials: Sequence[MeshMaterial] | None = None,
    headroom: float = 1.0,
    encoder: Encoder = "offline",
) -> SceneImage:
    """Pack a mesh into a scene image for a design.

    Args:
        mesh: The mesh.
        manifest: The design's manifest.
        materials: Materials that replace the mesh's. The records only contain which faces are glass.
        headroom: Factor of the scene's lights, by which the corner colours of diffuse faces are darker.
        encoder: Of textures.

    Raises:
        UserError: The mesh does not fit, or has corner colours or textures that the design lacks; the message names the
            setting.
    """
    geometry, memory = manifest.config["geometry"], manifest.config["columnBvhMemory"]
    quantised = quantise(mesh, int(geometry["vertexBits"]))
    bvh = build_bvh(
        quantised.vertices,
        quantised.faces,
        triangles_per_record=int(geometry["trianglesPerRecord"]),
        arity=int(geometry["arity"]),
        box_bits=int(geometry["boxBits"]),
        stack_depth=int(memory["stackDepth"]),
    )
    leaf_first, leaf_count = bvh.leaf_first, bvh.leaf_count
    if not manifest.bvh:
        leaf_first, leaf_count = _full_leaves(len(bvh.order), int(geometry["trianglesPerRecord"]))
    faces_per_record = manifest.layouts["attributes"].count_of("faces[{}].material")
    triangle_base = bvh.statistics.nodes if manifest.bvh else 0
    attribute_base = triangle_base + len(leaf_first)
    record_count = attribute_base + -(-len(bvh.order) // faces_per_record)
    _check_fits(mesh.name, manifest, bvh, record_count)

    sections = [_node_records(bvh, manifest, triangle_base)] if manifest.bvh else []
    materials = mesh.materials if materials is None else tuple(materials)
    is_glass = np.array([material.kind == "glass" for material in materials])
    is_clear = is_glass[mesh.face_materials[quantised.mesh_faces]]
    corners = quantised.vertices[quantised.faces[bvh.order]]
    corner_order = shared_edge_order(corners, leaf_first, leaf_count)
    corners = _reordered(corners, corner_order)
    sections.append(_triangle_records(corners, leaf_first, leaf_count, is_clear[bvh.order], manifest))
    atlas = _atlas(mesh, manifest, materials, headroom)
    colours = _corner_colours(mesh, manifest, materials, headroom, atlas)
    entries, index = table_entries(materials)
    indexed = replace(mesh, face_materials=index.astype(np.uint8)[mesh.face_materials])
    sections.append(
        _attribute_records(indexed, quantised, bvh.order, corner_order, manifest, faces_per_record, colours)
    )
    header = ImageHeader(
        format_hash=manifest.format_hash,
        mesh=mesh.name,
        source_triangles=mesh.source_count,
        triangles=len(bvh.order),
        record_bits=manifest.record_bits,
        record_count=record_count,
        triangle_base=triangle_base,
        triangle_records=len(leaf_first),
        attribute_base=attribute_base,
        bounds_low=_corner(corners.min(axis=(0, 1))),
        bounds_high=_corner(corners.max(axis=(0, 1))),
        largest_triangle=int(np.ptp(corners, axis=1).max()),
        frame=quantised.frame,
        extent=mesh.extent,
        materials=entries,
        tree=bvh.statistics if manifest.bvh else None,
        parts=mesh.parts,
    )
    image = SceneImage(header, np.concatenate(sections), mesh.source_faces[quantised.mesh_faces[bvh.order]])
    return with_textures(image, atlas, len({material.texture for material in materials} - {None}), manifest, encoder)


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
            "nodes": header.triangle_base,
            "triangles": header.triangle_records,
            "attributes": header.record_count - header.attribute_base,
        }
    }
    if header.tree is not None:
        stack_depth = int(manifest.config["columnBvhMemory"]["stackDepth"])
        use["stack"] = {"bound": header.tree.stack_bound, "depth": stack_depth}
    if header.room is not None:
        use["physicalAttributeMemory"] = environment_use(header, manifest)
    return use


def _check_fits(name: str, manifest: Manifest, bvh: Bvh, record_count: int) -> None:
    depth = int(manifest.memories["columnBvh"]["depth"])
    ids = 1 << manifest.layouts["triangles"].fields["firstTriangle"].width
    # Ids have one bit more than addresses, and all ones is no id
    enough = 1 << (max(record_count, len(bvh.order) // 2 + 1) - 1).bit_length()
    advice = f"raise columnBvhMemory.depth to {enough}" if enough <= MAX_MEMORY_DEPTH else "use a coarser mesh"
    if record_count > depth:
        raise UserError(f"mesh {name} needs {record_count:,} records, columnBvhMemory.depth is {depth:,}: {advice}")
    stack_depth, bound = int(manifest.config["columnBvhMemory"]["stackDepth"]), bvh.statistics.stack_bound
    if manifest.bvh and bound > stack_depth:
        raise UserError(
            f"mesh {name} needs a stack of {bound} entries even with a balanced tree, columnBvhMemory.stackDepth is"
            f" {stack_depth}: raise columnBvhMemory.stackDepth"
        )
    if len(bvh.order) >= ids:
        raise UserError(f"mesh {name} has {len(bvh.order):,} triangles, packed ids reach {ids - 2:,}: {advice}")


def _full_leaves(triangles: int, per_record: int) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
    """Leaves for the linear-scan baseline: every record but the last is full."""
    first = np.arange(0, triangles, per_record, dtype=np.uint32)
    return first, np.minimum(per_record, triangles - first).astype(np.uint32)


def _node_records(bvh: Bvh, manifest: Manifest, triangle_base: int) -> Bytes:
    """Pack the node records; child addresses are absolute, 0 without a child of that kind."""
    has_nodes, has_leaves = (bvh.kinds == NODE).any(axis=1), (bvh.kinds == LEAF).any(axis=1)
    values: dict[str, npt.NDArray[Any]] = {
        "firstChild": np.where(has_nodes, bvh.first_child, 0),
        "firstTriangles": np.where(has_leaves, bvh.first_triangles.astype(np.int64) + triangle_base, 0),
    }
    values |= _vector("origin", bvh.origin) | _vector("exponent", bvh.exponent)
    for slot in range(bvh.kinds.shape[1]):
        values[f"kinds[{slot}]"] = bvh.kinds[:, slot]
        values |= _vector(f"low[{slot}]", bvh.low[:, slot]) | _vector(f"high[{slot}]", bvh.high[:, slot])
    return manifest.layouts["node"].pack(values)


def shared_edge_order(
    corners: npt.NDArray[np.int32], leaf_first: npt.NDArray[np.uint32], leaf_count: npt.NDArray[np.uint32]
) -> npt.NDArray[np.int64]:
    """The order of each triangle's corners, int64 [m, 3], by which the triangle unit recognises a common edge.

    The second triangle of such a leaf starts with the first one's corners 1 and 0. Windings do not change.

    Args:
        corners: int32 [m, 3, 3], vertex units, in the order of packed ids.
        leaf_first: As in `Bvh`.
        leaf_count: As in `Bvh`.
    """
    first = leaf_first[leaf_count == 2].astype(np.int64)
    rotation = np.zeros(len(corners), dtype=np.int64)
    for i in range(3):
        for j in range(3):
            start, end = corners[first, i], corners[first, (i + 1) % 3]
            shares = (start == corners[first + 1, (j + 1) % 3]).all(axis=1) & (end == corners[first + 1, j]).all(axis=1)
            rotation[first[shares]] = i
            rotation[first[shares] + 1] = j
    return (rotation[:, None] + np.arange(3)) % 3


def _reordered(of_corners: npt.NDArray[Any], corner_order: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Values [m, 3, n] of the corners of packed triangles, in the order of `shared_edge_order`."""
    return np.take_along_axis(of_corners, corner_order[:, :, None], axis=1)


def _triangle_records(
    corners: npt.NDArray[np.int32],
    leaf_first: npt.NDArray[np.uint32],
    leaf_count: npt.NDArray[np.uint32],
    is_clear: npt.NDArray[np.bool_],
    manifest: Manifest,
) -> Bytes:
    """Pack the triangle records; corners and `is_clear` are in the order of packed ids."""
    values: dict[str, npt.NDArray[Any]] = {"firstTriangle": leaf_first, "count": leaf_count}
    for k in range(int(manifest.config["geometry"]["trianglesPerRecord"])):
        present = leaf_count > k
        packed = np.minimum(leaf_first + k, len(corners) - 1)
        values[f"isClear[{k}]"] = is_clear[packed] & present
        for j in range(3):
            values |= _vector(f"vertices[{3 * k + j}]", corners[packed, j] * present[:, None])
    return manifest.layouts["triangles"].pack(values)


def _atlas(mesh: Mesh, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float) -> Atlas | None:
    """The atlas of a mesh; None without textures."""
    if manifest.texture is None:
        if any(material.texture is not None for material in materials):
            raise UserError(f"mesh {mesh.name} has textures, the hardware has none: set {TEXTURE_SETTINGS}")
        return None
    return make_atlas(mesh, materials, headroom, manifest.texture.sizes["width"])


def _corner_colours(
    mesh: Mesh, manifest: Manifest, materials: Sequence[MeshMaterial], headroom: float, atlas: Atlas | None
) -> npt.NDArray[np.int64] | None:
    """The colours of the records, int64 [faces of the mesh, 3, 3]; None for a design without them.

    On textured faces red and green are positions in the atlas.
    """
    if not manifest.corner_colours:
        if any(material.has_corner_colours for material in materials):
            raise UserError(
                f"mesh {mesh.name} has colours at its corners, the hardware has none: set geometry.cornerColours=true"
            )
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


def _attribute_records(
    mesh: Mesh,
    quantised: QuantisedMesh,
    order: npt.NDArray[np.uint32],
    corner_order: npt.NDArray[np.int64],
    manifest: Manifest,
    per_record: int,
    colours: npt.NDArray[np.int64] | None,
) -> Bytes:
    """Pack the attribute records in the order of packed ids; the last record may have empty slots."""
    one = (1 << manifest.numbers["normalFraction"]) - 1
    rows = quantised.mesh_faces[order]
    count = -(-len(order) // per_record)
    normals = np.zeros((count * per_record, 4, 3), dtype=np.int64)
    normals[: len(order), :3] = np.rint(_reordered(mesh.corner_normals[rows], corner_order) * one)
    normals[: len(order), 3] = np.rint(geometric_normals(quantised)[order] * one)
    materials = np.zeros(count * per_record, dtype=np.int64)
    materials[: len(order)] = mesh.face_materials[rows]
    values: dict[str, npt.NDArray[Any]] = {}
    for k in range(per_record):
        face = slice(k, None, per_record)
        for j in range(3):
            values |= _vector(f"faces[{k}].normals[{j}]", normals[face, j])
        values |= _vector(f"faces[{k}].geometricNormal", normals[face, 3])
        values[f"faces[{k}].material"] = materials[face]
        if colours is not None:
            of_corners = _reordered(colours[rows], corner_order)
            for j in range(3):
                values |= {f"faces[{k}].colours[{j}].{name}": of_corners[:, j, c] for c, name in enumerate("rgb")}
    return manifest.layouts["attributes"].pack(values)


def geometric_normals(quantised: QuantisedMesh) -> npt.NDArray[np.float64]:
    """Unit normals of the quantised triangles by their winding, float64 [m, 3]; the cross product is exact."""
    corners = quantised.vertices[quantised.faces].astype(np.int64)
    return unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64))


def _vector(name: str, values: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
    return {f"{name}.{axis}": values[:, a] for a, axis in enumerate(AXES)}


def _corner(values: Units) -> tuple[int, int, int]:
    return int(values[0]), int(values[1]), int(values[2])
