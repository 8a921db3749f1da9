"""A scene as a design renders it: the image that the design loads, and the registers of its frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.common.framebuffer_formats import photo_lines
from colonnade.common.image_io import resized_photo
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.maps.encoded import Encode, EncodedEnvironment, check_layout
from colonnade.maps.encoders import Encoder
from colonnade.registers.frame import placed_registers
from colonnade.registers.frame_file import frame_file
from colonnade.registers.view_file import view_file
from colonnade.scene.cameras import check_camera
from colonnade.scene.joined_mesh import with_transform
from colonnade.scene.lit_room import LitRoom, device_room, fixed_in_world, lit_room, view_photo
from colonnade.scene.model import Camera, Scene, Transform
from colonnade.scene.object_mesh import SurfaceFeatures, object_mesh, stated_triangles, with_materials
from colonnade.scene.object_pose import Placed
from colonnade.scene.passes import frame_passes
from colonnade.scene.prepared.gathered_light import scene_cube, with_cube
from colonnade.scene.prepared.packed_objects import MovingInstances, pack_objects, placed_image
from colonnade.scene.view import View, make_view, rendered_materials, world_view
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.device_image import device_image, maps_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.packer import check_triangles

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment, EnvironmentCamera
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.scene_image.file import SceneImage


@dataclass(frozen=True)
class DeviceScene:
    """A scene that is ready for a design.

    Attributes:
        lit: The scene in its room, with the bounds of the mesh in `image`.
        manifest: The design's manifest.
        image: Records of the mesh, textures, and maps of the room.
        maps: The room and its encoded maps; None without a room.
        photo: The photo of the frames' view, sRGB, uint8 [rows, columns, 3]; None without one.
        mesh: The mesh, with the materials that the device shows; None: unknown.
    """

    lit: LitRoom
    manifest: Manifest
    image: SceneImage
    maps: EncodedEnvironment | None
    photo: NDArray[np.uint8] | None = None
    mesh: Mesh | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        manifest: Manifest,
        mesh: Mesh | None = None,
        *,
        size: Size | None = None,
        relit: bool = False,
        encoder: Encoder | None = None,
        room: Environment | None = None,
        encode: Encode | None = None,
        progress: Progress = QUIET,
    ) -> DeviceScene:
        """Load a scene's room and mesh, light them, encode the room's maps and pack the mesh.

        Args:
            scene: The scene.
            manifest: The design's manifest.
            mesh: A mesh that replaces the scene's own, which is not read.
            size: Width and height of frames, pixels; a size that the room cannot have is refused before long work.
            relit: Frames show the room under the scene's lights, not its photo.
            encoder: Of the room's maps and of textures.
            room: In place of the room in the scene's folder.
            encode: In place of `encoder` for the room's maps.
            progress: Shows the fit of lights.

        Raises:
            UserError: Mesh or room cannot be read, or the design cannot render them.
        """
        if mesh is None:
            for name, triangles in stated_triangles(scene):
                check_triangles(name, triangles, manifest, about="at least ")
        if room is None:
            room = device_room(scene, manifest)
        if mesh is None:
            mesh = object_mesh(scene, room, manifest.corner_colours)
        if room is not None:
            check_layout(room, manifest)
            if size is not None:
                check_camera(scene, room, size)
        photo = view_photo(scene, room, size)
        lights, surfaces = int(manifest.config["frame"]["lights"]), rendered_materials(mesh.materials, scene)
        lit = lit_room(Placed(scene, mesh.extent, room), lights, relit, progress, surfaces)
        maps = None if lit.environment is None else EncodedEnvironment.of(lit.environment, manifest, encode or encoder)
        mesh = with_materials(lit.scene, mesh, SurfaceFeatures.of(manifest))
        materials = rendered_materials(mesh.materials, lit.scene)
        image = pack_objects(mesh, manifest, materials, lit.scene.headroom, encoder, scene.mesh.children)
        image = image.posed(scene.motion_progress)
        if maps is not None:
            image = with_environment(image, maps, manifest)
        if manifest.gathers:
            held = None if maps is None else maps.image
            image = with_cube(image, scene_cube(lit, held, relit, is_noted=True))
        mesh = replace(mesh, materials=materials).posed(scene.motion_progress)
        return cls(lit, manifest, image, maps, photo, mesh)

    def seen_in(self, room: Environment, encode: Encode, relit: bool = False) -> DeviceScene:
        """The scene in another view of its room: object and lights stay in the world, camera and maps are new.

        Args:
            room: The view.
            encode: Encodes its maps.
            relit: As in `of`.
        """
        lit = self.lit.seen_in(room, relit)
        assert lit.environment is not None
        maps = EncodedEnvironment.of(lit.environment, self.manifest, encode)
        image = with_environment(self.image, maps, self.manifest)
        if self.manifest.gathers:
            image = with_cube(image, scene_cube(lit, maps.image, relit))
        return replace(self, lit=lit, image=image, maps=maps, photo=room.photo)

    def lit_at(self, pose: Scene, relit: bool = False) -> DeviceScene:
        """The scene at a pose of its motion: its light cube, the records of its clip, the places of its instances.

        Args:
            pose: As `Scene.at` gives it.
            relit: As in `of`.
        """
        held = None if self.maps is None else self.maps.image
        cube = scene_cube(self.lit.with_scene(pose), held, relit)
        image = self.image.posed(pose.motion_progress)
        mesh = None if self.mesh is None else self.mesh.posed(pose.motion_progress)
        return replace(self, image=image if cube is None else with_cube(image, cube), mesh=mesh)

    def seen_by(self, camera: EnvironmentCamera, photo: NDArray[np.uint8] | None) -> DeviceScene:
        """The scene from another camera: object, lights and maps stay in the world, primary rays march.

        Args:
            camera: Its lens, for pictures of the maps' size, and its pose.
            photo: The picture that it took; None: the room is drawn from its maps.
        """
        fixed = fixed_in_world(self.lit.placed).scene
        lit = replace(self.lit.with_scene(replace(fixed, frame_camera=camera)), strength=None)
        return replace(self, lit=lit, photo=photo)

    @checked
    def with_camera(self, camera: Camera) -> DeviceScene:
        """The scene with another camera, as if its file had it; the image stays.

        Args:
            camera: In a room it has a position; frames then show the room as its maps have it.
        """
        moved = self.with_scene(replace(self.scene, camera=camera, frame_camera=None))
        return moved if self.environment is None else replace(moved, lit=replace(moved.lit, strength=None), photo=None)

    @checked
    def with_transform(self, number: int, transform: Transform, *, relit: bool = False) -> DeviceScene:
        """The scene with one of several objects elsewhere, as if its file had the transform; the records stay.

        Args:
            number: Of the object in the file, from 1.
            transform: Its pose in the world.
            relit: As in `of`.

        Raises:
            UserError: There is no such object, the objects are packed as one mesh or have motions of their own, or one
                is too small for the scene.
        """
        if self.scene.is_animated:
            raise UserError("an object has one place: leave out object.motion and mesh.animation of all objects")
        if not self.image.header.instances or self.mesh is None:
            raise UserError(
                "an object moves alone if it is an instance: raise frame.instances to the number of objects"
            )
        if not 1 <= number <= len(self.scene.objects):
            raise UserError(f"there is no object {number}: the scene has {len(self.scene.objects)}")
        objects = list(self.scene.objects)
        objects[number - 1] = replace(objects[number - 1], transform=transform)
        mesh = with_transform(self.mesh, number - 1, transform)
        scene = replace(self.scene, objects=tuple(objects))
        image = placed_image(self.image, mesh, self.manifest)
        lit = replace(self.lit, placed=Placed(scene, mesh.extent, self.environment), strength=None)
        return replace(self, lit=lit, mesh=mesh, image=image).lit_at(scene, relit)

    def passes(self, scene: Scene | None = None, exposure: float = 0.0, number: int = 0) -> list[Scene]:
        """The passes of a frame (`frame_passes`) at another moment of `scene`; None: of `scene` itself."""
        return frame_passes(scene or self.scene, self.image.header.materials, exposure, number)

    @property
    def scene(self) -> Scene:
        """The scene: with lights, a place for the object, and the headroom of the room's colours."""
        return self.lit.scene

    @property
    def environment(self) -> Environment | None:
        """The room with the colours that rays see; None without a room."""
        return self.lit.environment

    @property
    def strength(self) -> NDArray[np.uint8] | None:
        """Of the object's shadow on the photo, uint8 [rows, columns]; None: it is whole."""
        return self.lit.strength

    def with_scene(self, scene: Scene) -> DeviceScene:
        """With other settings of the scene that change neither image nor light."""
        return replace(self, lit=self.lit.with_scene(scene))

    def _placed(self, scene: Scene | None) -> Placed:
        """`scene`, another moment or sample of the scene, in the room; None: the scene itself."""
        return self.lit.placed if scene is None else self.lit.placed.with_scene(scene)

    @checked
    def registers(self, size: Size, scene: Scene | None = None, *, composited: bool = False) -> dict[str, int]:
        """The registers of a frame (`placed_registers`).

        Args:
            size: Width and height, pixels.
            scene: Another moment or sample of `scene`; None: `scene` itself.
            composited: The frame is composited with the photo of its view, if there is one: of the room, only pixels
                whose light the object may block are rendered.

        Raises:
            UserError: The frame or a distance is out of the hardware's range, or the design lacks a feature.
        """
        shows_room = not composited or self.environment is None or self.photo is None
        placed = self._placed(scene)
        return placed_registers(placed, self.image.header, self.manifest, *size, self.maps, shows_room)

    @checked
    def frame_photo(self, size: Size) -> NDArray[np.uint8] | None:
        """The photo in the size of a frame, for `Device.set_frame`, with `strength` if there is one; else None.

        Raises:
            UserError: The frame is empty or too large.
        """
        check_size(size, self.manifest)
        if self.photo is None:
            return None
        photo = resized_photo(self.photo, *size)
        return photo if self.strength is None else np.dstack([photo, resized_photo(self.strength, *size)])

    def device_image(self) -> bytes:
        """What the AXI4 shell loads (docs/bus-shell.md, "An image"): `image`, without records that lie in DRAM."""
        return device_image(self.image, self.manifest)

    def maps_image(self) -> bytes | None:
        """As `device_image`, with the maps of the room alone; None without a room."""
        return None if self.maps is None else maps_image(self.maps.image, self.manifest)

    @checked
    def clip_file(self) -> bytes:
        """What bends the mesh, or moves instances, on a target (docs/driver.md).

        Raises:
            UserError: The scene has neither an animation nor a motion of an object.
        """
        if self.image.moves is None:
            raise UserError("a clip file has what moves, and the scene has none: give mesh.animation or object.motion")
        if isinstance(self.image.moves, Bending):
            return self.image.moves.file
        assert isinstance(self.image.moves, MovingInstances)
        motion = self.image.moves.target.motion
        return motion.file(self.manifest, sets_offset=self.scene.light.shadow_offset is None)

    def dram_image(self) -> bytes:
        """The records as a design with a cache reads them from DRAM.

        Raises:
            UserError: The design holds the records on chip.
        """
        return dram_image(self.image, self.manifest)

    @checked
    def frame_file(self, size: Size, *, composited: bool = False) -> bytes:
        """The registers of a frame, for the driver (docs/driver.md, "In: two files"); arguments as in `registers`.

        Raises:
            UserError: See `registers`.
        """
        return frame_file(self.registers(size, composited=composited), self.manifest)

    @checked
    def photo_file(self, size: Size) -> bytes | None:
        """`frame_photo` as the AXI4 shell reads it (`photo_lines`); None without a photo."""
        photo = self.frame_photo(size)
        return None if photo is None else photo_lines(photo, int(self.manifest.config["frame"]["tileSize"])).tobytes()

    @checked
    def view_file(self, size: Size, *, composited: bool = False) -> bytes:
        """The file with which a processor computes frames of other poses (`view_file`); arguments as in `registers`.

        Raises:
            UserError: See `view_file`.
        """
        world = world_view(self.lit.placed, *size)
        registers = self.registers(size, composited=composited)
        occlusion = self.scene.background.occlusion
        return view_file(world, registers, size, self.image.header, self.manifest, self.maps, occlusion)

    @checked
    def view(self, size: Size, scene: Scene | None = None) -> View:
        """The view of a frame; arguments as in `registers`."""
        return make_view(self._placed(scene), *size, self.image.header.materials)
