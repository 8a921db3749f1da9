"""A frame that the host adds up: its passes, and the picture that these give (docs/sampling.md)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.common.accumulation import LUMINANCE, WHITE, Accumulation, FramePasses
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.framebuffer import Frame
from colonnade.common.image_io import encode_srgb
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.render.camera_look import CameraLook
from colonnade.render.composite import composited
from colonnade.render.hit_faces import hit_faces
from colonnade.render.report import FrameReport
from colonnade.render.result import RenderResult
from colonnade.render.sky import sky_of
from colonnade.scene.model import Denoiser, Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.samples import CENTRE

if TYPE_CHECKING:
    from colonnade.render.denoise import Guide
    from colonnade.render.history import Camera, History
    from colonnade.render.hit_points import HitPoints

#: The least albedo by which the light of a single sample is known.
_DARK = 0.02
#: Fewer samples do not tell a point by their variance.
_ENOUGH = 4


@dataclass(frozen=True)
class HostFrame:
    """A frame of the model or the RTL.

    Attributes:
        prepared: The scene. With gathered light it is `exposed`.
        size: Width and height, pixels.
        passes: The scene at each pass; the first one shows surfaces.
        relit: The frame shows the room under the scene's lights, not its photo.
        denoise: The noise of gathered light is filtered, as `FrameSize.denoise`.
        look: What the object gets of the photo's camera.
        number: From 0; each frame has its own grain.
        history: The frames before, whose noise the filter averages; None: there are none. `pixels` or `result` are
            called once, frame by frame.
    """

    prepared: DeviceScene
    size: tuple[int, int]
    passes: tuple[Scene, ...]
    relit: bool = False
    denoise: bool | Denoiser = False
    look: CameraLook | None = None
    number: int = 0
    history: History | None = None

    def registers(self, one: Scene) -> dict[str, int]:
        """The registers of a pass.

        Raises:
            UserError: See `DeviceScene.registers`.
        """
        return self.prepared.registers(self.size, one, composited=not self.relit)

    def no_passes(self) -> FramePasses:
        """Where its passes are added."""
        is_filtered = bool(self.denoise)
        return FramePasses(
            has_squares=is_filtered,
            white=WHITE * self.prepared.scene.exposure,
            albedo_of=self._albedo if is_filtered and self.prepared.mesh is not None else None,
        )

    def image(self, sums: Accumulation) -> Floats:
        """The picture of sums, with all layers': linear, float64 [height, width, 3]."""
        if self.relit:
            return sums.image()
        return composited(sums, self.prepared.photo, self.prepared.strength, self.look, self.number, self.sky)

    @cached_property
    def sky(self) -> Floats | None:
        """What is behind the object in place of the device's background (`sky_of`)."""
        return sky_of(self.prepared.lit.placed, self.passes, self.size)

    def pixels(self, passes: FramePasses, is_whole: bool = True) -> npt.NDArray[np.uint8]:
        """The picture of passes, as `RenderResult.pixels` has it; with passes to come it is not filtered."""
        sums = self._sums(passes) if is_whole else passes.whole
        if self.relit or (self.prepared.photo is None and self.sky is None):
            return sums.pixels()
        return encode_srgb(self.image(sums))

    def result(self, passes: FramePasses, report: FrameReport) -> RenderResult:
        """The result of all passes."""
        frame, sums = passes.frame, self._sums(passes)
        return RenderResult(
            image=self.image(sums),
            object_mask=frame.is_object,
            hit_triangles=hit_faces(self.prepared.image, frame),
            t=self._hits(frame)[0],
            report=report,
            sums=sums,
            ratio=frame.ratio,
            parts=self.prepared.image.header.parts,
        )

    def _sums(self, passes: FramePasses) -> Accumulation:
        """Sums of all passes, with the colours of the object filtered if that is wanted."""
        if not self.denoise:
            return passes.whole
        from colonnade.render import oidn
        from colonnade.render.denoise import Guide
        from colonnade.render.history import Camera

        depth, position = self._hits(passes.frame)
        shows_object = ~np.isnan(depth)
        points = self._points(passes.frame, position)
        normals = None if points is None or self.prepared.scene.material.flat else points.normals()
        camera = Camera.of(self.prepared.view(self.size, self.passes[0]))

        def filtered(name: str, layer: FramePasses) -> Accumulation:
            sums, count = layer.sums, layer.sums.coverage[..., None]
            colours = sums.objects / np.maximum(count, 1) / sums.white
            guide = Guide.of(position, shows_object & (count[..., 0] > 0), normals)
            # Other layers are not textured
            is_textured = points is not None and layer is passes
            albedo = passes.albedo / np.maximum(count, 1) if is_textured else np.ones_like(position)
            if self.denoise == "oidn":
                # Beside a photo without noise it would leave the pattern of several samples
                around = self.image(sums) if passes.sums.samples == 1 else np.zeros_like(position)
                found = oidn.filtered(colours, around, guide, albedo)
            else:
                light, variance = albedo.clip(min=_DARK), layer.object_variance()
                variance = None if variance is None else variance / (light @ LUMINANCE) ** 2
                found = light * self._without_noise(
                    name, colours / light, variance, guide, camera, are_few=sums.samples < _ENOUGH
                )
            return replace(sums, objects=found * sums.white * count)

        sums = self._with_smooth_shadow(filtered("surface", passes), passes)
        return sums.with_layers(filtered(*layer) for layer in passes.layers.items())

    def _without_noise(
        self,
        name: str,
        colours: Floats,
        variance: Floats | None,
        guide: Guide,
        camera: Camera,
        is_still: bool = True,
        are_few: bool = False,
    ) -> Floats:
        """Colours without noise: blended with the frames before, and filtered; of what is still or moves."""
        from colonnade.render.denoise import Noisy, denoised
        from colonnade.render.history import FRAMES, MOVING_FRAMES

        noisy = Noisy.of(colours, variance, guide, are_few)
        if self.history is not None:
            noisy = self.history.blended(name, noisy, guide, camera, FRAMES if is_still else MOVING_FRAMES)
        return denoised(noisy, guide)

    def _with_smooth_shadow(self, sums: Accumulation, passes: FramePasses) -> Accumulation:
        """Sums with filtered shadow ratios, where the maps tell what the pixels of the room show."""
        prepared = self.prepared
        if self.relit or prepared.scene.places_camera or prepared.environment is None or prepared.photo is None:
            return sums
        from colonnade.render.denoise import Guide
        from colonnade.render.history import Camera

        assert sums.ratio is not None
        count = (sums.samples - sums.coverage)[..., None]
        ratio = sums.ratio / np.maximum(count, 1) / sums.unshadowed
        shows_room = count[..., 0] > 0
        rows, columns = (np.flatnonzero(((ratio != 1).any(axis=2) & shows_room).any(axis=axis)) for axis in (1, 0))
        if len(rows) == 0:
            return sums
        mask = np.zeros_like(shows_room)
        around = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        mask[around] = shows_room[around]
        room = prepared.environment
        points = room.points() @ room.camera_to_world[:, :3].T + room.camera_to_world[:, 3]
        y, x = (
            (2 * np.arange(size) + 1) * of // (2 * size) for size, of in zip(mask.shape, points.shape, strict=False)
        )
        view = prepared.view(self.size, replace(self.passes[0], sample=CENTRE))
        assert view.view_to_mesh is not None
        to_view = np.linalg.inv(np.vstack([view.view_to_mesh, (0.0, 0.0, 0.0, 1.0)]))
        camera = Camera.of(view).moved(room.camera_to_world @ to_view)
        guide = Guide.of(points[y[:, None], x], mask)
        found = self._without_noise("room", ratio, passes.ratio_variance(), guide, camera, prepared.scene.is_still)
        return replace(sums, ratio=np.rint(found * count * sums.unshadowed).astype(sums.ratio.dtype))

    def _albedo(self, frame: Frame, number: int) -> Floats:
        """The albedo of the object in a pass of surfaces, linear, float64 [height, width, 3]; 0 elsewhere."""
        points = self._points(frame, self._hits(frame, number)[1])
        assert points is not None
        return points.albedo()

    def _points(self, frame: Frame, position: Floats) -> HitPoints | None:
        """The points of the mesh that a pass shows; of an image without its mesh None."""
        from colonnade.render.hit_points import HitPoints

        mesh = self.prepared.mesh
        return None if mesh is None else HitPoints.of(mesh, hit_faces(self.prepared.image, frame), position)

    def _hits(self, frame: Frame, number: int = 0) -> tuple[Floats, Floats]:
        """Depth and position of a surface pass, NaN for a miss, mesh units, float64 [height, width] and with [3]."""
        surfaces = (one for one in self.passes if one.sample.layer == "surface")
        view = self.prepared.view(self.size, next(itertools.islice(surfaces, number, None)))
        x, y = np.arange(view.width)[None, :, None], np.arange(view.height)[:, None, None]
        rays = view.direction + x * view.step_x + y * view.step_y
        depth = frame.distance / (self.prepared.image.header.frame.scale * np.abs(rays).max(axis=2))
        depth = np.where(frame.is_object, depth, np.nan)
        return depth, view.origin + depth[..., None] * rays


def require_filter(scene: Scene, manifest: Manifest, denoise: bool | Denoiser) -> None:
    """Raise a `UserError` if there is no noise to filter, or no depth to guide the filter."""
    if scene.paths.gather == 0:
        raise UserError("denoise filters the noise of gathered light: the scene has none, set paths.gather = 1")
    if not manifest.config["frame"]["hits"]:
        raise UserError("denoise needs the depth of pixels, which this hardware lacks: set frame.hits=true")
    if denoise == "oidn":
        require_extra("denoise", "the filter oidn")
