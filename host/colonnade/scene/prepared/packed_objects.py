"""The objects of a scene as instances: each mesh packed once, with a transform for each object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.maps.encoders import Encoder
from colonnade.mesh.clips.joined import Place, joined_clip, still_clip
from colonnade.mesh.clips.keys import Keys, keys_of
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.instances import AXES, instance_registers
from colonnade.registers.motion_file import Motion, TargetMotion
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.header import ImageHeader, Instance, ObjectFrame, TreeStatistics
from colonnade.scene_image.joined_images import joined_records
from colonnade.scene_image.packer import pack, pack_geometry, surface_colours, texture_count
from colonnade.scene_image.textures import with_textures
from colonnade.scene_image.world import world_frame

#: Share of the longest edge of the scene at rest by which interpolated transforms may miss a motion.
_TOLERANCE = 2.0**-12


def pack_objects(
    mesh: Mesh,
    manifest: Manifest,
    materials: Sequence[MeshMaterial],
    headroom: float = 1.0,
    encoder: Encoder | None = None,
    children: int = 4,
) -> SceneImage:
    """Pack a mesh, or the objects of a joined mesh as instances if the design and its tables can hold them so.

    Objects of equal records share them, if they bend alike. One mesh holds, and a note says: more objects than
    `frame.instances`, and objects too small for a transform. Arguments and errors are as for `pack`.
    """
    if mesh.objects and (limit := int(manifest.config["frame"].get("instances", 0))):
        try:
            if len(mesh.objects) > limit:
                raise _OneMesh(f"they are {len(mesh.objects)}, frame.instances is {limit}")
            colours, atlas = surface_colours(mesh, manifest, materials, headroom)
            parts = zip(_parts(mesh, materials), _faces_of(mesh), strict=True)
            own = [
                pack_geometry(part, manifest, part.materials, None if colours is None else colours[faces], children)
                for part, faces in parts
            ]
            return with_textures(_joined(own, mesh, manifest), atlas, texture_count(materials), manifest, encoder)
        except _OneMesh as reason:
            notes.tell(f"the objects are packed as one mesh: {reason}")
    return pack(mesh, manifest, materials, headroom, encoder, children)


def placed_image(image: SceneImage, mesh: Mesh, manifest: Manifest) -> SceneImage:
    """An image of instances with the transforms of a joined mesh of the same objects; the records stay.

    Raises:
        UserError: An object is too small for the scene.
    """
    pairs = zip(image.header.instances, mesh.objects, strict=True)
    instances = [replace(one, transform=_rows(placed.transform)) for one, placed in pairs]
    header = replace(image.header, extent=mesh.extent, parts=mesh.parts)
    return replace(image, header=_placed(header, instances, world_frame(instances, manifest.numbers), manifest))


def _rows(matrix: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())


def _parts(mesh: Mesh, materials: Sequence[MeshMaterial]) -> list[Mesh]:
    """The objects in their own spaces, each with the materials of its faces alone."""
    parts: list[Mesh] = []
    for one, own in zip(mesh.objects, _faces_of(mesh), strict=True):
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
                corner_colours=None,
                corner_uvs=None,
                name=mesh.parts[len(parts)].name,
                parts=(),
                objects=(),
                clip=one.clip,
                clip_corners=one.clip_corners,
            )
        )
    return parts


def _faces_of(mesh: Mesh) -> list[slice]:
    """The faces of each object."""
    ends = np.cumsum([len(one.faces) for one in mesh.objects]).tolist()
    return [slice(end - len(one.faces), end) for one, end in zip(mesh.objects, ends, strict=True)]


class _OneMesh(Exception):
    """Why one mesh holds the objects."""


def _joined(own: Sequence[SceneImage], mesh: Mesh, manifest: Manifest) -> SceneImage:
    """The image of all objects.

    Raises:
        _OneMesh: They need more materials, or one is too small.
    """
    keys = [_key(image) for image in own]
    tables = list(dict.fromkeys(image.header.materials for image in own))
    bases = dict(zip(tables, np.cumsum([0, *map(len, tables)]).tolist(), strict=False))
    count, limit = sum(map(len, tables)), int(manifest.config["frame"]["materials"])
    if count > limit:
        raise _OneMesh(f"they have {count} materials, frame.materials is {limit}")
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
        extent=mesh.extent,
        parts=mesh.parts,
    )
    moves = None
    try:
        header = _placed(header, instances, world_frame(instances, manifest.numbers), manifest)
        if mesh.clip is not None:
            moves = MovingInstances.of(tuple(images), roots, instances, mesh, manifest)
    except UserError as error:
        raise _OneMesh(str(error)) from None
    return replace(
        images[0],
        header=header,
        records=records,
        source_faces=np.concatenate([one.source_faces for one in images]),
        moves=moves,
    )


def _key(image: SceneImage) -> tuple[bytes, bytes]:
    """What objects share that have it in common: records, and what bends them."""
    return image.records.tobytes(), image.moves.file if isinstance(image.moves, Bending) else b""


@dataclass(frozen=True)
class MovingInstances:
    """Instances that move by their transforms, with an animation also by their own records.

    Attributes:
        images: The meshes, each once.
        target: What moves them, in a world that holds the whole motion.
    """

    images: tuple[SceneImage, ...]
    target: TargetMotion

    @classmethod
    def of(
        cls,
        images: tuple[SceneImage, ...],
        roots: Sequence[int],
        instances: Sequence[Instance],
        mesh: Mesh,
        manifest: Manifest,
    ) -> MovingInstances:
        """The instances of a joined mesh.

        Raises:
            UserError: An object is too small for the scene of all poses.
        """
        keys = _motion_keys(instances, mesh)
        clips = [
            (root, image.moves.file)
            for root, image in zip(roots, images, strict=True)
            if isinstance(image.moves, Bending)
        ]
        motion = Motion(tuple(instances), keys, instances[0].frame, tuple(clips))
        poses = [motion.at_key(key) for key in range(len(keys.times))]
        motion = replace(motion, world=world_frame([one for pose in poses for one in pose], manifest.numbers))
        for pose in poses:
            instance_registers(pose, motion.world, manifest)
        return cls(images, TargetMotion(motion, manifest))

    @property
    def seconds(self) -> float:
        """How long they move; an animation that is shorter stays at its end."""
        return self.target.seconds

    def posed(self, image: SceneImage, progress: float) -> SceneImage:
        """See `Moves`."""
        time, target = progress * self.seconds, self.target
        if any(one.moves is not None for one in self.images):
            bent = [one.posed(min(1.0, time / one.moves.seconds) if one.moves else 0.0) for one in self.images]
            image = replace(image, records=joined_records(bent, target.manifest)[0])
        header = _placed(image.header, target.instances(progress), target.motion.world, target.manifest)
        return replace(image, header=header)


def _motion_keys(instances: Sequence[Instance], mesh: Mesh) -> Keys:
    """The transforms of the objects of a joined mesh over the time of its clip: the transforms of their boxes."""
    assert mesh.clip is not None
    boxes = [still_clip(one.box) for one in instances]
    places = [one.place or Place.of([one.transform]) for one in mesh.objects]
    clip = replace(joined_clip(boxes, places), duration=mesh.clip.duration)
    rest = np.concatenate([one.corners for one in instances])
    return keys_of(clip, _TOLERANCE * float(np.ptp(rest, axis=0).max()))


def _placed(header: ImageHeader, instances: Sequence[Instance], frame: ObjectFrame, manifest: Manifest) -> ImageHeader:
    """The header of instances in a world."""
    registers = instance_registers(instances, frame, manifest)
    low, high = ([registers[f"bounds.{side}.{axis}"] for axis in AXES] for side in ("low", "high"))
    return replace(
        header,
        frame=frame,
        bounds_low=(low[0], low[1], low[2]),
        bounds_high=(high[0], high[1], high[2]),
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
