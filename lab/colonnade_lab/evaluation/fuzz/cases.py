"""Legal frames to corrupt: small scenes that use all features of a design."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from colonnade.design.manifest import Manifest
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture
from colonnade.scene.model import Background, Camera, Colour, Light, Material, MeshSource, Paths, Scene
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.file import SceneImage

#: Width and height of a legal frame, pixels.
SIZE = (12, 9)

#: Far more cycles than a legal frame of this size takes.
WATCHDOG_CYCLES = 400_000

#: Names of the scenes whose corners have colours, or positions in a texture, and whose surfaces gather light.
COLOURED, TEXTURED, GATHERED = "corner colours", "texture", "gathered light"

SKY = Background(colour=(0.2, 0.3, 0.5))


@dataclass(frozen=True)
class Case:
    """The inputs of a frame.

    Attributes:
        name: Name of the legal scene.
        image: Scene image.
        registers: All rw registers by name.
    """

    name: str
    image: SceneImage
    registers: Mapping[str, int]

    @property
    def gathers(self) -> bool:
        """Whether the frame gathers light (docs/gather.md)."""
        return self.registers.get("gather.bounces", 0) > 0

    @property
    def has_instances(self) -> bool:
        """Whether the frame has instances (docs/path-tracer.md)."""
        return self.registers.get("scene.instances", 0) > 0


def legal_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames that a design can render."""
    return tuple(_case(name, scene, manifest) for name, scene in _scenes(manifest))


def _scenes(manifest: Manifest) -> Iterator[tuple[str, Scene]]:
    frame = manifest.config["frame"]
    cube, sphere = Scene(MeshSource(name="cube"), background=SKY), Scene(MeshSource(name="sphere:1"), background=SKY)
    # Narrower than the object's cube, so that its bounds can be inverted one by one
    torus = Scene(MeshSource(name="torus:3"), background=SKY)
    yield "cube", cube
    yield "torus", torus
    yield "sphere", replace(sphere, light=Light(falloff=2.0))
    yield "inside", replace(sphere, camera=Camera(position=(0.1, 0.2, 0.3), target=(1.0, 0.5, 0.0)))
    if int(frame["lights"]) > 1:
        yield "two lights", replace(sphere, light=Light(falloff=3.0), more_lights=(Light(offset=(-1.0, 0.5, 2.0)),))
    if manifest.corner_colours:
        yield COLOURED, sphere
    if manifest.texture is not None:
        yield TEXTURED, sphere
    if int(frame["maxBounces"]) > 0:
        mirror, glass = Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), Material(kind="glass", ior=1.45)
        yield "mirror", replace(cube, material=mirror, paths=Paths(bounces=3))
        yield "glass", replace(sphere, material=glass, paths=Paths(bounces=4))
    if manifest.gathers:
        lamp, ambient = Light(falloff=3.0, radius=0.5), Colour((0.3, 0.2, 0.3))
        near, paths = Camera(direction=(0.3, 1.0, 0.5), framing=1.5), Paths(bounces=1, gather=4)
        yield GATHERED, replace(torus, camera=near, light=lamp, ambient=ambient, paths=paths)


def _case(name: str, scene: Scene, manifest: Manifest) -> Case:
    mesh = object_mesh(scene)
    if name == COLOURED:
        mesh = coloured(mesh)
    if name == TEXTURED:
        mesh = textured(mesh)
    if name == GATHERED:
        mesh = patchwork(mesh, manifest)
    prepared = DeviceScene.of(scene, manifest, mesh)
    return Case(name, prepared.image, prepared.registers(SIZE) | {"frame.watchdogCycles": WATCHDOG_CYCLES})


def coloured(mesh: Mesh) -> Mesh:
    """The mesh with a colour at each vertex, by position."""
    colours = (mesh.vertices - mesh.extent.low) / mesh.extent.edge
    materials = tuple(replace(material, has_corner_colours=True) for material in mesh.materials)
    return replace(mesh, materials=materials, corner_colours=colours[mesh.faces])


def textured(mesh: Mesh) -> Mesh:
    """The mesh with a texture of random squares, placed by two of the axes."""
    random = np.random.default_rng(1)
    squares = random.integers(0, 256, (24, 24, 3), dtype=np.uint8)
    texture = Texture("squares", squares.repeat(8, axis=0).repeat(8, axis=1))
    positions = ((mesh.vertices - mesh.extent.low) / mesh.extent.edge)[:, :2]
    materials = tuple(replace(material, texture=0) for material in mesh.materials)
    return replace(mesh, materials=materials, textures=(texture,), corner_uvs=positions[mesh.faces])


def patchwork(mesh: Mesh, manifest: Manifest) -> Mesh:
    """The mesh with faces of all kinds of materials beside each other, so that rays go from one to the other.

    Where the design has textures, each material has one, and where it has emission, some.
    """
    mesh = mesh if manifest.texture is None else textured(mesh)
    plain = replace(mesh.materials[0], emission=(0.1, 0.2, 0.0)) if manifest.emission else mesh.materials[0]
    surfaces = [("diffuse", 0.0), ("mirror", 0.6), ("mirror", 0.2), ("glass", 0.4)]
    materials = tuple(replace(plain, kind=kind, roughness=roughness) for kind, roughness in surfaces)
    materials = materials[: int(manifest.config["frame"]["materials"])]
    parts = np.arange(len(mesh.faces)) % len(materials)
    return replace(mesh, materials=materials, face_materials=parts.astype(mesh.face_materials.dtype))
