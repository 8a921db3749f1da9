"""The objects of a scene as instances: each mesh packed once, with a transform for each object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.maps.encoders import Encoder
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.instances import instance_registers
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.header import ImageHeader, Instance, TreeStatistics
from colonnade.scene_image.joined_images import joined_records
from colonnade.scene_image.packer import pack
from colonnade.scene_image.world import world_bounds, world_frame


def pack_objects(
    mesh: Mesh,
    manifest: Manifest,
    materials: Sequence[MeshMaterial],
    headroom: float = 1.0,
    encoder: Encoder | None = None,
    children: int = 4,
) -> SceneImage:
    """Pack a mesh, or the objects of a joined mesh as instances if the design and its tables can hold them so.

    Objects of equal records share them. One mesh holds, and a note says: more objects than `frame.instances`,
    animations, textures, and objects too small for a transform. Arguments and errors are those of `pack`.
    """
    if mesh.objects and (limit := int(manifest.config["frame"].get("instances", 0))):
        try:
            _check(mesh, limit)
            parts = _parts(mesh, materials)
            own = [pack(part, manifest, part.materials, headroom, encoder, children) for part in parts]
            return _joined(own, mesh, manifest)
        except _OneMesh as reason:
            notes.tell(f"the objects are packed as one mesh: {reason}")
    return pack(mesh, manifest, materials, headroom, encoder, children)


def placed_image(image: SceneImage, mesh: Mesh, manifest: Manifest) -> SceneImage:
    """An image of instances with the transforms of a joined mesh of the same objects; the records stay.

    Raises:
        UserError: An object is too small for the scene.
    """
    pairs = zip(image.header.instances, mesh.objects, strict=True)
    instances = [
        replace(one, transform=tuple(tuple(row) for row in placed.transform.tolist())) for one, placed in pairs
    ]
    return replace(image, header=_placed(image.header, instances, mesh, manifest))


def _parts(mesh: Mesh, materials: Sequence[MeshMaterial]) -> list[Mesh]:
    """The objects in their own spaces, each with the materials of its faces alone."""
    parts: list[Mesh] = []
    first = 0
    for one in mesh.objects:
        own = np.s_[first : first + len(one.faces)]
        used, index = np.unique(mesh.face_materials[own], return_inverse=True)
        parts.append(
            replace(
                mesh,
                vertices=one.vertices,
                faces=one.faces,
                corner_normals=one.corner_normals,
                materials=tuple(materials[number] for number in used),
                face_materials=index.astype(np.uint8),
                source_faces=mesh.source_faces[own],
                corner_colours=None if mesh.corner_colours is None else mesh.corner_colours[own],
                corner_uvs=None if mesh.corner_uvs is None else mesh.corner_uvs[own],
                name=mesh.parts[len(parts)].name,
                parts=(),
                objects=(),
            )
        )
        first += len(one.faces)
    return parts


class _OneMesh(Exception):
    """Why one mesh holds the objects."""


def _check(mesh: Mesh, limit: int) -> None:
    """Refuse objects that are no instances of a design with so many."""
    if len(mesh.objects) > limit:
        raise _OneMesh(f"they are {len(mesh.objects)}, frame.instances is {limit}")
    if mesh.clip or mesh.textures:
        raise _OneMesh("an instance is neither animated nor textured")


def _joined(own: Sequence[SceneImage], mesh: Mesh, manifest: Manifest) -> SceneImage:
    """The image of all objects.

    Raises:
        _OneMesh: They need more materials, only some have colours, or one is too small.
    """
    keys = [image.records.tobytes() for image in own]
    tables = list(dict.fromkeys(image.header.materials for image in own))
    bases = dict(zip(tables, np.cumsum([0, *map(len, tables)]).tolist(), strict=False))
    count, limit = sum(map(len, tables)), int(manifest.config["frame"]["materials"])
    if count > limit:
        raise _OneMesh(f"they have {count} materials, frame.materials is {limit}")
    if len({image.header.has_colours for image in own}) > 1:
        raise _OneMesh("only some have corner colours")
    images = [own[keys.index(key)] for key in dict.fromkeys(keys)]
    records, roots = joined_records(images, manifest)
    root_of = dict(zip(dict.fromkeys(keys), roots, strict=True))
    instances = [
        Instance.of(image.header, placed.transform, root_of[key], bases[image.header.materials])
        for image, key, placed in zip(own, keys, mesh.objects, strict=True)
    ]
    headers = [image.header for image in images]
    header = replace(
        headers[0],
        mesh=mesh.name,
        source_triangles=mesh.source_count,
        triangles=sum(one.triangles for one in headers),
        record_count=len(records),
        nodes=sum(one.nodes for one in headers),
        leaves=sum(one.leaves for one in headers),
        largest_triangle=max(one.largest_triangle for one in headers),
        materials=tuple(material for table in tables for material in table),
        tree=_tree([one.tree for one in headers if one.tree is not None]),
    )
    try:
        header = _placed(header, instances, mesh, manifest)
    except UserError as error:
        raise _OneMesh(str(error)) from None
    return replace(
        images[0], header=header, records=records, source_faces=np.concatenate([one.source_faces for one in images])
    )


def _placed(header: ImageHeader, instances: Sequence[Instance], mesh: Mesh, manifest: Manifest) -> ImageHeader:
    """The header of instances in the world that holds them."""
    frame = world_frame(instances, manifest.numbers)
    instance_registers(instances, frame, manifest.numbers)
    low, high = world_bounds(instances, frame, manifest.numbers)
    return replace(
        header,
        frame=frame,
        bounds_low=low,
        bounds_high=high,
        extent=mesh.extent,
        parts=mesh.parts,
        instances=tuple(instances),
    )


def _tree(trees: Sequence[TreeStatistics]) -> TreeStatistics:
    """Of several trees; a ray visits one after the other, each with the same stack."""
    return TreeStatistics(
        nodes=sum(tree.nodes for tree in trees),
        leaves=sum(tree.leaves for tree in trees),
        depth=max(tree.depth for tree in trees),
        stack_bound=max(tree.stack_bound for tree in trees),
        cost=sum(tree.cost for tree in trees),
        height_limit=max(tree.height_limit for tree in trees),
    )
