"""Scenes of instances for the model and the RTL."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import new_model
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.instances import instance_registers
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene_image.header import Instance, ObjectFrame
from colonnade.scene_image.joined_images import joined_records
from colonnade.scene_image.packer import pack
from colonnade.scene_image.world import world_frame

Floats = NDArray[np.float64]
MESHES = ("sphere:2", "torus", "cube")
FRAME = ObjectFrame(65000.0, (-0.5, -0.5, -0.5))


def transform(random: np.random.Generator, kind: str = "rigid", spread: float = 2.0) -> Floats:
    """A random transform: turned and moved, also scaled, mirrored or sheared."""
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    linear = {
        "rigid": turn,
        "scaled": turn * random.uniform(0.3, 1.5),
        "mirrored": turn @ np.diag([1.0, -1.0, 1.0]),
        "sheared": turn @ np.array([[1, 0.6, 0], [0, 0.5, 0.2], [0, 0, 1.4]]),
    }[kind]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, random.uniform(-spread, spread, size=3)
    return matrix


def instance(linear: Floats, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Instance:
    """A mesh of that frame, with another transform."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, place
    rows = tuple(tuple(row) for row in matrix.tolist())
    return Instance(FRAME, (0, 20000, 30000), (65000, 40000, 31000), 2000, rows, 7, 3)


class World:
    """The model with a scene of instances of the meshes in turn, each packed once. The camera sees the world's cube."""

    def __init__(
        self, manifest: Manifest, transforms: Sequence[Floats], meshes: Sequence[str] = MESHES, size: int = 64
    ) -> None:
        self.manifest, self.numbers = manifest, manifest.numbers
        self.meshes = [load_mesh(name) for name in meshes]
        images = [pack(mesh, manifest) for mesh in self.meshes]
        records, self.roots = joined_records(images, manifest)
        faces = np.concatenate([image.source_faces for image in images])
        self.images = images
        self.image = replace(images[0], records=records, source_faces=faces)
        self.model = new_model(manifest)
        self.model.load(records)
        self.count = len(transforms)
        self.instances = [
            Instance.of(images[i % len(images)].header, matrix, self.roots[i % len(images)], i % 2)
            for i, matrix in enumerate(transforms)
        ]
        self.frame = world_frame(self.instances, self.numbers)
        self.base = frame_registers(Scene(MeshSource(name="cube")), images[0].header, manifest, size, size)
        self.base |= {"scene.recordCount": len(records)}
        self.renumber(range(self.count))

    def renumber(self, order: Sequence[int]) -> None:
        self.order = np.array(order)
        instances = [self.instances[i] for i in order]
        self.registers = self.base | instance_registers(instances, self.frame, self.manifest)
        self.model.start(self.registers)

    @property
    def steps(self) -> float:
        return self.frame.scale * 2.0 ** self.numbers["gridFraction"]

    def on_grid(self, points: Floats) -> NDArray[np.int64]:
        return np.rint((points - np.array(self.frame.offset)) * self.steps).astype(np.int64)

    def rays(self, random: np.random.Generator, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """From around and within the scene, on the world's grid, to places in it."""
        cube = 1 << (self.numbers["vertexBits"] + self.numbers["gridFraction"])
        starts = random.integers(-cube, 2 * cube, size=(count, 3))
        return starts, random.integers(0, cube, size=(count, 3)) - starts

    def nearest(self, starts: NDArray[np.int64], ways: NDArray[np.int64]) -> dict[str, Any]:
        """Hits, with instances by their numbers before `renumber`."""
        hits: dict[str, Any] = self.model.nearest(starts, ways)
        hits["instance"] = np.where(hits["triangle"] < 0, -1, self.order[hits["instance"]])
        return hits

    def triangles(self, i: int) -> tuple[Floats, NDArray[np.int64]]:
        """Vertices of an instance on the world's grid, and its faces."""
        mesh, matrix = self.meshes[i % len(self.meshes)], np.array(self.instances[i].transform)
        placed = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        return (placed - np.array(self.frame.offset)) * self.steps, mesh.faces.astype(np.int64)
