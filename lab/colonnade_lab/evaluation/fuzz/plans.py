"""Plans of refits (docs/bus-shell.md): plans of meshes, wrong ones, and what the unit does with any of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from colonnade import _core
from colonnade.design.manifest import Manifest
from colonnade.scene.model import Camera, Material, MeshSource, ObjectKey, Scene, SceneObject, Transform
from colonnade.scene.object_mesh import SurfaceFeatures, object_mesh, with_materials
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.packer import pack

from colonnade_lab.evaluation.fuzz.records import write_field

#: Kinds of entries.
LINES, TRIANGLE, PAIR, NODE = range(4)

#: Bytes of a line, which has so many vertices, and of a record; boxes that the unit holds.
LINE_BYTES, LINE_VERTICES, RECORD_BYTES, BOXES = 64, 4, 32, 128

_COUNT_BITS, _CHILDREN = 24, 4

#: Of two objects: so far apart their triangles are so small that leaves are pairs.
_DISTANCE = 16.0

Words = Any  #: uint32 [n, 4]: entries of a plan, or vertices


@dataclass(frozen=True)
class Effect:
    """What the unit does with a plan.

    Attributes:
        names_nothing: It names lines, records or boxes that are not there.
        written: The records that are written, from the root on.
    """

    names_nothing: bool
    written: frozenset[int]


def effect_of(plan: Words, lines: int, count: int, manifest: Manifest) -> Effect:
    """What the unit does with a plan, for any number of lines of vertices and of records."""
    bits = manifest.layouts["node"].fields["first"].width
    is_wrong, written, boxes = False, set[int](), 0
    for head, *words in plan.tolist():
        kind, record = head & 3, head >> 2 & ((1 << bits) - 1)
        if kind == LINES:
            is_wrong |= any(line & ((1 << _COUNT_BITS) - 1) >= lines for line in words[: record & 3])
            continue
        if kind == NODE:
            children = (words[1] & 7) + (words[1] >> 3 & 7)
            if not 0 < children <= min(_CHILDREN, boxes):
                is_wrong = True
                continue
            boxes += 1 - children
        elif boxes == BOXES:
            is_wrong = True
        else:
            boxes += 1
        is_wrong |= record >= count
        written |= {record} if record < count else set()
    return Effect(is_wrong, frozenset(written))


@dataclass(frozen=True)
class BentMesh:
    """A mesh that bends: its records with the root at 0, its clip, and its plan.

    Attributes:
        records: uint8 [n, 32].
        nodes: Addresses of its nodes.
        bending: Its clip.
        target: The driver's, in C.
        plan: uint32 [e, 4].
    """

    records: Any
    nodes: tuple[int, ...]
    bending: Bending
    target: Any
    plan: Words

    def at(self, root: int, manifest: Manifest) -> Any:
        """The records of a copy whose root has an address."""
        field = manifest.layouts["node"].fields["first"]
        copy = self.records.copy()
        for address in self.nodes:
            first = int.from_bytes(copy[address].tobytes(), "little") >> field.offset & ((1 << field.width) - 1)
            write_field(copy[address], field, first + root)
        return copy

    def refitted(self, vertices: Words, root: int, manifest: Manifest) -> tuple[Any, list[int], int]:
        """The records of the driver's refit in C, uint8 [n, 32]; the bounds; pairs without normals."""
        copy = self.at(root, manifest)
        positions, codes = vertices[:, :3].view(np.int32), vertices[:, 3:].copy().view(np.int16)
        low, high, flat = self.target.refit(positions.copy(), codes, copy.view(np.uint32), root)
        return copy, [*low, *high], flat

    def posed(self, share: float) -> Words:
        """The vertices at a part of the clip."""
        positions, codes = self.target.skin(self.target.pose(round(share * self.bending.duration)))
        return vertex_words(positions, codes)


def vertex_words(positions: Any, codes: Any) -> Words:
    """Vertices as the unit reads them, of positions int [v, 3] and codes of normals int [v, 2]."""
    words = np.zeros((len(positions), 4), np.uint32)
    words[:, :3] = positions
    words[:, 3] = codes.astype(np.int16).view(np.uint32).ravel()
    return words


def bent_meshes(manifest: Manifest) -> tuple[BentMesh, ...]:
    """Meshes of triangles, and one of pairs, of two objects."""
    return tuple(_bent_meshes(manifest))


def _bent_meshes(manifest: Manifest) -> Iterator[BentMesh]:
    features = SurfaceFeatures.of(manifest)
    for names in (("cube",), ("torus:8",), ("sphere:1", "torus:6")):
        objects = tuple(
            SceneObject(
                mesh=MeshSource(name=name),
                material=Material(albedo=(0.2 + 0.5 * number, 0.5, 0.5)),
                transform=Transform(translate=(_DISTANCE * number, 0.0, 0.0)),
                motion=(ObjectKey(turn=200.0, translate=(0.0, 0.3 + number, 0.2)),),
            )
            for number, name in enumerate(names)
        )
        scene = Scene(objects[0].mesh, objects=objects, camera=Camera())
        mesh = with_materials(scene, object_mesh(scene), features)
        image = pack(mesh, manifest)
        bending = image.moves
        assert isinstance(bending, Bending)
        target = _core.TargetMesh(bending.format_words, bending.file)
        records = np.ascontiguousarray(image.records)
        nodes = tuple(np.flatnonzero(image.source_faces[::2] < 0).tolist())
        yield BentMesh(records, nodes, bending, target, target.plan(records.view(np.uint32), 0))


def any_plan(random: np.random.Generator, mesh: BentMesh, lines: int, count: int) -> Words:
    """Entries of any bits, of any kinds with numbers near what is there, or of the mesh with some changed."""
    how = random.random()
    if how < 0.35:
        plan = mesh.plan.copy()
        for _ in range(int(random.integers(1, 4))):
            _change(random, plan)
        return plan
    entries = int(random.integers(1, 300))
    plan = random.integers(0, 1 << 32, (entries, 4), dtype=np.uint32)
    if how < 0.5:
        return plan
    shares = ((1, 1, 1, 1), (1, 3, 3, 1), (0, 1, 1, 0), (1, 1, 1, 4))[int(random.integers(4))]
    kinds = random.choice(4, entries, p=np.array(shares) / sum(shares))
    plan[:, 0] = kinds | random.integers(0, count + 2, entries) << 2
    named, are_lines, are_nodes = random.integers(0, lines + 1, (entries, 3)), kinds == LINES, kinds == NODE
    plan[are_lines, 1:] = named[are_lines] if random.random() < 0.5 else named[are_lines] % max(lines, 1)
    plan[are_lines, 0] = random.integers(0, 4, are_lines.sum()) << 2
    plan[are_nodes, 1] = random.integers(0, count + 4, are_nodes.sum())
    children = random.integers(0, 5, (2, entries))
    plan[are_nodes, 2] = (children[0] | children[1] << 3)[are_nodes]
    return plan


def _change(random: np.random.Generator, plan: Words) -> None:
    """Flip a bit, overwrite, swap, copy or drop entries."""
    one, other = random.integers(len(plan), size=2)
    how = int(random.integers(4))
    if how == 0:
        plan[one, random.integers(4)] ^= np.uint32(1 << int(random.integers(32)))
    elif how == 1:
        plan[one] = random.integers(0, 1 << 32, 4, dtype=np.uint32)
    elif how == 2:
        plan[[one, other]] = plan[[other, one]]
    else:
        plan[one] = plan[other]
