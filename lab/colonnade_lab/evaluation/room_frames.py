"""Relit frames that show a whole room: three objects in each of two rooms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import registers_of
from colonnade.scene.model import Camera, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.room_lights import as_vector
from colonnade.scene.standing import surface_point
from colonnade.scene.view import make_view
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

from colonnade_lab.evaluation.studies.ar_losses import OBJECTS, PLACEMENTS, placed_scene

#: Of moved frames: the camera's way, metres, and the shares of the rows that show the room.
METRES, ROWS = 0.2, (0.0, 0.25, 0.5, 1.0)


@dataclass(frozen=True)
class RoomFrame:
    """A frame for the device.

    Attributes:
        room: Name of the room.
        name: The object and its material.
        image: What the device holds.
        registers: All rw registers by name.
        first_row: The first row that shows the room.
    """

    room: str
    name: str
    image: SceneImage
    registers: dict[str, int]
    first_row: int


def room_frames(
    manifest: Manifest, size: tuple[int, int], moved: bool = False, objects: Iterable[str] = tuple(OBJECTS)
) -> Iterator[RoomFrame]:
    """All frames of a size.

    Args:
        manifest: The design's manifest.
        size: Width and height, pixels.
        objects: Those of `OBJECTS` by name.
        moved: Only mirrors, from a camera beside the maps', with the room in each of `ROWS`.
    """
    width, height = size
    for room in ("living", "office"):
        environment = load_environment(project_root() / "scenes" / "rooms" / room)
        encoded = EncodedEnvironment.of(environment, manifest)
        for name in objects:
            mesh_name, material = OBJECTS[name]
            if moved and material.kind != "mirror":
                continue
            mesh = load_mesh(mesh_name)
            scene = placed_scene(mesh_name, material, environment, PLACEMENTS[room])
            if moved:
                scene = replace(scene, camera=moved_camera(scene, environment))
            view = make_view(Placed(scene, mesh.extent, environment), width, height, mesh.materials)
            packed = with_environment(pack(mesh, manifest, view.materials), encoded, manifest)
            registers = registers_of(view, packed.header, manifest, encoded)
            for share in ROWS if moved else (1.0,):
                first = round((1.0 - share) * height)
                yield RoomFrame(room, name, packed, {**registers, "environment.window.y0": first}, first)


def moved_camera(scene: Scene, environment: Environment) -> Camera:
    """The camera of the maps, moved to the right and turned to the object."""
    assert scene.placement is not None and scene.placement.stand_at is not None
    right, eye = environment.camera_to_world[:, 0], environment.camera_to_world[:, 3]
    target = surface_point(scene.placement.stand_at, environment, "object.stand_at")
    return Camera(position=as_vector(eye + METRES * right), target=as_vector(target))
