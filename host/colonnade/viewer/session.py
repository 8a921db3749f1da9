"""A scene file that is shown while it is edited: the last scene that could be packed, and frames of it."""

from __future__ import annotations

import shlex
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common import ledger, notes
from colonnade.common.accumulation import FramePasses
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import manifest_for
from colonnade.device.device import ModelDevice
from colonnade.maps.encoders import Encoder
from colonnade.render.camera_look import CameraLook
from colonnade.render.history import History
from colonnade.render.host_frame import HostFrame, require_filter
from colonnade.render.room_defaults import with_room_defaults
from colonnade.render.samples import tell_defaults
from colonnade.scene.model import Camera, Scene
from colonnade.scene.model.values import WorldVector
from colonnade.scene.parser import is_mesh_file, load_scene
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.view import world_view
from colonnade.scene_image.file import SceneImage
from colonnade.viewer.camera_table import save_camera

#: Seconds between two looks at the files.
_INTERVAL = 0.02
#: Samples a pixel of a camera that rests, unless the scene names several.
STILL_SAMPLES = 16
#: Seconds of a motion without an animation.
MOTION_SECONDS = 6.0
#: Counters of rays.
_RAYS = ("raysPrimary", "raysShadow", "raysReflection", "raysRefraction", "raysGather")


@dataclass(frozen=True)
class ViewCamera:
    """A camera that a visitor has moved.

    Attributes:
        position: World position.
        target: World point at the picture's centre.
    """

    position: WorldVector
    target: WorldVector


@dataclass(frozen=True)
class ViewFrame:
    """A picture of the scene.

    Attributes:
        pixels: sRGB, uint8 [height, width, 3].
        version: The scene's.
        milliseconds: Time of registers, model and picture, of the last sample.
        rays: Rays of all kinds, of the last sample.
        samples: Samples a pixel in it.
        final: The samples of the picture of a camera that has rested.
    """

    pixels: NDArray[np.uint8]
    version: int
    milliseconds: float
    rays: int
    samples: int
    final: int


@dataclass
class _Picture:
    """A picture of a camera at a moment: the passes that come, the sums of the others, and what they show."""

    camera: ViewCamera | None
    at: float | None
    version: int
    frame: HostFrame
    coming: list[Scene]
    sums: FramePasses
    last: ViewFrame | None = None


class Session:
    """A scene file in view. Its methods may be called by any thread.

    Attributes:
        file: The scene file.
        size: Width and height, pixels.
        has_ended: After `end`.

    Args:
        file: The scene file.
        config: The design, as in `ModelDevice`.
        overrides: Fields that replace some of it.
        size: Width and height, pixels.
        encoder: Of a room's maps and of textures.
        progress: Shows the run of the generator.
        is_own: The file is the user's; False: it belongs to the project, and no camera is saved into it.
        room: As in `load_scene`.
        animation: As in `load_scene`.

    Raises:
        UserError: The scene cannot be read or packed.
    """

    def __init__(
        self,
        file: Path,
        config: str,
        overrides: Sequence[str] = (),
        size: tuple[int, int] = (320, 240),
        encoder: Encoder | None = None,
        progress: Progress = QUIET,
        is_own: bool = True,
        room: Path | None = None,
        animation: str | None = None,
    ) -> None:
        self.file, self.size = file, size
        self._room, self._animation = room, animation
        self._is_own = is_own
        self._encoder = encoder
        self._config = config
        self._manifest = manifest_for(self._config, overrides, progress).manifest
        check_size(size, self._manifest)
        self._device = ModelDevice(self._config, overrides)
        self._rendering = threading.Lock()
        self._loading = threading.RLock()
        self._changed = threading.Condition()
        self._state: dict[str, Any] = {"version": 0}
        self._error = ""
        self.has_ended = False
        self._rest: _Picture | None = None
        self._history: History | None = None
        self._number = 0
        self._image: SceneImage | None = None
        self._load()

    def state(self, version: int | None = None, timeout: float = 0.0) -> dict[str, Any]:
        """What the page shows beside the picture.

        Args:
            version: Wait for a later one than this.
            timeout: Seconds of waiting, at most.
        """
        with self._changed:
            if version is not None:
                self._changed.wait_for(lambda: self.has_ended or self._state["version"] != version, timeout)
            return self._state | {"error": self._error}

    def frame(self, camera: ViewCamera | None = None, at: float | None = None) -> ViewFrame:
        """Render a frame of one sample of the scene that was last right, as `colonnade render --samples 1`.

        If noise is filtered, it also has the light of the frames before, as in a motion.

        Args:
            camera: In place of the scene's own.
            at: Progress of the scene's motion, 0.0 to 1.0; None: its start.

        Raises:
            UserError: The camera is out of the hardware's range.
        """
        with self._rendering:
            self._number += 1
            return self._next(self._picture(camera, at, 1, self._history))

    def still(self, camera: ViewCamera | None = None, at: float | None = None) -> ViewFrame:
        """Render the next sample of a camera that rests: the picture has one more than the last call's.

        The last picture equals `colonnade render` with as many samples; further calls give it again. Another
        camera, moment or version of the scene begins anew.

        Args:
            camera: In place of the scene's own.
            at: Progress of the scene's motion, 0.0 to 1.0; None: its start.

        Raises:
            UserError: The camera is out of the hardware's range.
        """
        with self._rendering:
            rest = self._rest
            if rest is None or (rest.camera, rest.at, rest.version) != (camera, at, self._state["version"]):
                rest = self._rest = self._picture(camera, at, self._samples)
            if rest.last is None or rest.coming:
                rest.last = self._next(rest)
            return rest.last

    def _picture(
        self, camera: ViewCamera | None, at: float | None, samples: int, history: History | None = None
    ) -> _Picture:
        """A picture of so many samples, of which none is rendered."""
        scene = self._scene
        if at is not None:
            pose = scene.scene.at(at)
            scene = scene.lit_at(pose).with_scene(pose)
        if camera is not None:
            scene = scene.with_camera(_moved(scene.scene.camera, camera))
        scene = scene.with_scene(scene.scene.with_samples(samples))
        number = self._number if history is not None else 0
        passes = scene.passes(exposure=scene.scene.opening(1), number=number)
        denoise = (scene.scene.frame.denoise or False) if samples > 1 or history is not None else False
        look = self._look if scene.photo is not None else None
        frame = HostFrame(scene, self.size, tuple(passes), denoise=denoise, look=look, history=history)
        return _Picture(camera, at, self._state["version"], frame, passes, frame.no_passes())

    def _next(self, picture: _Picture) -> ViewFrame:
        """Render the next sample of a picture, with the passes of other layers after it."""
        begun, rays, frame, sums = time.perf_counter(), 0, picture.frame, picture.sums
        self._hold(frame.prepared)
        coming = [one.sample.layer != "surface" for one in picture.coming]
        for _ in range([*coming, False].index(False, 1)):
            one = picture.coming.pop(0)
            self._device.set_frame(frame.registers(one))
            self._device.start()
            self._device.wait()
            sums.add(self._device.frame, one.sample.layer)
            counters = self._device.counters()
            rays += sum(counters.get(kind, 0) for kind in _RAYS)
        pixels = frame.pixels(sums, is_whole=not picture.coming)
        seconds = time.perf_counter() - begun
        return ViewFrame(pixels, picture.version, 1e3 * seconds, rays, sums.sums.samples, self._samples)

    def _hold(self, scene: DeviceScene) -> None:
        """Load the image of a moment, unless the device has it."""
        if self._image is not scene.image:
            self._device.load(scene.image)
            self._image = scene.image

    def save(self, camera: ViewCamera) -> None:
        """Write a camera into the scene file.

        Raises:
            UserError: The file is not the user's, is a mesh, or has an error; no frame can show the scene with this
                camera; or see `save_camera`.
        """
        if is_mesh_file(self.file):
            raise UserError(f"{self.file} is a mesh: a camera is saved into a scene file with mesh.path")
        if not self._is_own:
            copy = f"cp -r {shlex.quote(str(self.file.parent))} my-scenes && colonnade view my-scenes/{self.file.name}"
            raise UserError(f"{self.file.stem} is a scene of the project: to save a camera, view a copy of it: {copy}")
        with self._loading:
            self.look()
            if self._error:
                raise UserError(f"no camera is saved while the scene has an error: {self._error}")
            save_camera(self.file, camera.position, camera.target, self._require_frame)

    def _require_frame(self, scene: Scene) -> None:
        """Refuse the camera of a scene if no frame can show it: the scene could not be loaded again."""
        self._scene.with_camera(scene.camera).registers(self.size, composited=True)

    def watch(self) -> None:
        """Load the scene again whenever a file that it reads changes, until `end`."""
        while not self.has_ended:
            time.sleep(_INTERVAL)
            self.look()

    def look(self) -> None:
        """Load the scene again if a file that it reads has changed, or one that was missing has come."""
        with self._loading:
            if all(ledger.stamp_of(path) == stamp for path, stamp in self._lookups.items()):
                return
            try:
                self._load()
            except UserError as wrong:
                self._tell(str(wrong))
            except Exception as bug:  # the view goes on
                self._tell(f"{type(bug).__name__}: {bug}")

    def end(self) -> None:
        """End `watch` and all waits."""
        with self._changed:
            self.has_ended = True
            self._changed.notify_all()

    def close(self) -> None:
        """Release the model; no frame can be rendered any more."""
        with self._rendering:
            self._device.close()

    def _tell(self, error: str) -> None:
        with self._changed:
            self._error = error
            self._state = self._state | {"version": self._state["version"] + 1}
            self._changed.notify_all()

    def _load(self) -> None:
        """Read and pack the scene; if it cannot be, the one before stays."""
        begun = time.perf_counter()
        lines: list[str] = []
        with ledger.opened() as files, notes.opened(lines.append):
            self._lookups = files.lookups  # up to an error, if there is one
            loaded = load_scene(self.file, self._room, self._animation)
            description, line = with_room_defaults(loaded, self._config, self._manifest)
            description = exposed(description)
            samples = description.frame.samples or 1
            description = description.with_samples(samples if samples > 1 else STILL_SAMPLES)
            scene = DeviceScene.of(description, self._manifest, size=self.size, encoder=self._encoder)
            look = CameraLook.of(scene.scene, scene.photo, self.size)
            if look is not None:
                look.tell(scene.environment)
            tell_defaults(line, scene.environment)
        if description.frame.denoise:
            require_filter(description, self._manifest, description.frame.denoise)
        # It is refused here if the hardware cannot show it, and not in every frame
        scene = self._still(scene)
        scene.registers(self.size, composited=True)
        packed = time.perf_counter()
        with self._rendering, self._changed:
            self._hold(scene)
            self._scene, self._look, self._samples = scene, look, description.frame.samples or 1
            self._history = History.of(description.frame.denoise or False, STILL_SAMPLES)
            self._state = self._described(scene) | {
                "version": self._state["version"] + 1,
                "notes": lines,
                "milliseconds": 1e3 * (packed - begun),
            }
            self._error = ""
            self._changed.notify_all()

    def _still(self, scene: DeviceScene) -> DeviceScene:
        """A camera that frames the object as one with a place: its search would cost most of a frame's time."""
        camera = scene.scene.camera
        if scene.environment is not None or camera.position is not None:
            return scene
        view = self._described(scene)["camera"]
        return scene.with_camera(_moved(camera, ViewCamera(view["position"], view["target"])))

    def _described(self, scene: DeviceScene) -> dict[str, Any]:
        placed, own = scene.lit.placed, scene.scene.camera
        camera = world_view(placed, *self.size).camera
        centre = placed.middle if own.target is None else np.array(own.target)
        depth = max(float((camera.position - centre) @ camera.axes[2]), 1e-3 * placed.extent.edge * placed.pose.scale)
        return {
            "scene": self.file.name,
            "size": list(self.size),
            "triangles": scene.image.header.triangles,
            "seconds": None if scene.scene.is_still else _seconds(scene),
            "plays": scene.scene.is_animated,
            "camera": {
                "position": tuple(camera.position.tolist()),
                "target": tuple((camera.position - depth * camera.axes[2]).tolist()),
                "up": list(own.up),
                "span": float(np.linalg.norm(camera.step_y)) * self.size[1],
            },
        }


def _seconds(scene: DeviceScene) -> float:
    """Duration of a scene's motion: its animation's, if it has one."""
    moves = scene.image.moves
    return moves.seconds if scene.scene.has_animation and moves is not None else MOTION_SECONDS


def _moved(camera: Camera, to: ViewCamera) -> Camera:
    """A scene's camera at another place, with its lens."""
    return replace(camera, position=to.position, target=to.target)
