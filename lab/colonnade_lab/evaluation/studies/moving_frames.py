"""Study: a mirror teapot in generated rooms, seen by a camera that has moved since the keyframe, in three ways.

``fresh``: maps of the frame. ``marched``: maps of the keyframe, seen from where the camera is. ``stale``: maps of the
keyframe as if they were the frame's, with its photo. The truth is the float reference with the full maps of the
frame. Maps are the live encoder's.

`colonnade study moved-frames SEEDS` prints the table.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from colonnade.common.accumulation import Accumulation
from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import encode_still
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.reference.environment.decoded import BoundingPlanes
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.render import render_reference
from colonnade.render.composite import composited
from colonnade.scene.model import Background, Colour, Light, Material, MeshSource, Placement, Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from numpy.typing import NDArray

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.region_metrics import compare_regions, frame_regions
from colonnade_lab.evaluation.studies.generated_rooms import Furnished, plan_of
from colonnade_lab.evaluation.studies.moved_views import DEGREES, METRES
from colonnade_lab.evaluation.studies.synthetic_attic import AMBIENT, LAMP_COLOUR, RoomModel, camera_at

#: Shares of `METRES` and `DEGREES` by which the camera moves to the right and turns to the right, or both to the left.
SHARES = (1 / 3, 2 / 3, 1.0)
WAYS = ("fresh", "marched", "stale")
#: Size of a frame, and of the maps, pixels.
FRAME, MAPS = (320, 240), (640, 480)


@dataclass(frozen=True)
class FrameError:
    """The mean error of frames against the float reference; None where no frame has a shadow.

    Attributes:
        frame, object: PSNR of the frame and of the object's pixels, dB.
        shadow: PSNR of the pixels in the shadow of either picture, dB.
        displacement: Of the shadow's centre of gravity, pixels of `FRAME`.
        dists: Of the frame; None without its weights.
    """

    frame: float
    object: float
    shadow: float | None
    displacement: float | None
    dists: float | None


def study_seeds(
    seeds: Iterable[int], with_dists: bool = True, progress: Progress = QUIET
) -> dict[str, dict[str, FrameError]]:
    """The errors by distance and way; means over rooms and sides."""
    found: dict[str, dict[str, list[FrameError]]] = {}
    for seed in seeds:
        with progress.step(f"measuring room {seed}"):
            for share, way, error in _errors(seed, with_dists):
                name = f"{share * METRES:.1f} m, {share * DEGREES:.1f}°"
                found.setdefault(name, {}).setdefault(way, []).append(error)
    return {name: {way: _mean(errors) for way, errors in ways.items()} for name, ways in found.items()}


def _mean(errors: list[FrameError]) -> FrameError:
    def mean(name: str) -> float | None:
        known = [value for error in errors if (value := getattr(error, name)) is not None]
        return float(np.mean(known)) if known else None

    frame, of_object = mean("frame"), mean("object")
    assert frame is not None and of_object is not None
    return FrameError(frame, of_object, mean("shadow"), mean("displacement"), mean("dists"))


def moved_camera(made: Furnished, share: float) -> EnvironmentCamera:
    """The camera of a generated room after a share of the way, to the right or, below 0, to the left."""
    angle, ahead = -np.radians(share * DEGREES), made.target - made.eye
    turned = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]) @ ahead
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    eye = made.eye + share * METRES * right / np.linalg.norm(right)
    return camera_at(eye, eye + turned, *MAPS, made.focal)


def _errors(seed: int, with_dists: bool) -> Iterator[tuple[float, str, FrameError]]:
    """Share, way and error of each frame of a room."""
    from colonnade.design.generator import manifest_for

    layout, made, mesh = AttributeLayout(*MAPS), plan_of(seed), load_mesh("teapot")
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    model = RoomModel(f"seed-{seed}", made.parts)

    def room(share: float) -> Environment:
        return model.seen_by(moved_camera(made, share), *MAPS, made.lamp)

    key = room(0.0)
    image = encode_still(key, layout)
    first = DeviceScene.of(_scene(made), manifest, mesh, room=key, encode=lambda _: image)
    for share in SHARES:
        for signed in (share, -share):
            moved = room(signed)
            fresh = first.seen_in(moved, lambda environment: encode_still(environment, layout))
            stale = replace(key, camera=moved.camera, photo=moved.photo)
            scenes = (fresh, first.seen_by(moved.camera, moved.photo), first.seen_in(stale, lambda _: image))
            truth = _truth(fresh, mesh)
            for way, prepared in zip(WAYS, scenes, strict=True):
                yield share, way, _error(truth, _device(prepared, manifest), fresh.photo, with_dists)


def _scene(made: Furnished) -> Scene:
    x, y, z = (float(value) for value in made.lamp)
    red, green, blue = (float(value) for value in LAMP_COLOUR)
    return Scene(
        MeshSource("teapot"),
        placement=Placement(size=0.5),
        material=Material("mirror", (0.95, 0.95, 0.95)),
        light=Light((x, y, z), colour=(red, green, blue), falloff=1.0),
        ambient=Colour((float(AMBIENT[0]), float(AMBIENT[1]), float(AMBIENT[2]))),
        background=Background(room=Path("generated")),
    )


@dataclass(frozen=True)
class _Traced:
    """Sums of a frame, and its shadow ratio, float64 [height, width, 3]."""

    sums: Accumulation
    object_mask: NDArray[np.bool_]
    ratio: Floats


def _truth(fresh: DeviceScene, mesh: Mesh) -> _Traced:
    """The float reference of a frame with the full maps of its view."""
    assert fresh.maps is not None and fresh.environment is not None
    backdrop = full_backdrop(fresh.environment, BoundingPlanes(fresh.environment, fresh.maps.image))
    traced = render_reference(mesh, fresh.view(FRAME), QUIET, backdrop)
    sums = Accumulation.of_pixels(traced.image, traced.object_mask, traced.shadow_ratio)
    return _Traced(sums, traced.object_mask, traced.shadow_ratio)


def _device(prepared: DeviceScene, manifest: Manifest) -> _Traced:
    frame = render_model(manifest, prepared.image, prepared.registers(FRAME, composited=True))
    assert frame.ratio is not None and not frame.errors
    return _Traced(Accumulation.of_frame(frame), frame.is_object, frame.ratio / 4096.0)


def _error(truth: _Traced, device: _Traced, photo: NDArray[np.uint8] | None, with_dists: bool) -> FrameError:
    pictures = [encode_srgb(composited(one.sums, photo)) for one in (truth, device)]
    regions = frame_regions(truth.object_mask, truth.ratio)
    regions["shadow"] |= frame_regions(device.object_mask, device.ratio)["shadow"] & ~truth.object_mask
    found = compare_regions(pictures[0], pictures[1], regions, with_dists)
    centres = [_centre(one) for one in (truth, device)]
    displacement = None
    if centres[0] is not None and centres[1] is not None:
        displacement = float(np.linalg.norm(centres[0] - centres[1]))
    frame, of_object = found["frame"].psnr, found["object"].psnr
    assert frame is not None and of_object is not None
    return FrameError(frame, of_object, found["shadow"].psnr, displacement, found["frame"].dists)


def _centre(frame: _Traced) -> Floats | None:
    """The centre of gravity of a shadow, pixels; None without one."""
    dark = np.where(frame.object_mask, 0.0, 1.0 - frame.ratio.mean(axis=2)).clip(min=0.0)
    if dark.sum() < 1.0:
        return None
    rows, columns = np.mgrid[0 : dark.shape[0], 0 : dark.shape[1]]
    return np.asarray(np.array([(dark * columns).sum(), (dark * rows).sum()]) / dark.sum())


def table(errors: Mapping[str, Mapping[str, FrameError]]) -> str:
    """The errors as a Markdown table."""
    header = ("camera moved", "maps", "frame dB", "object dB", "shadow dB", "shadow off by, pixels", "frame DISTS")

    def text(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    rows = [
        (
            *(name, way, f"{one.frame:.1f}", f"{one.object:.1f}", text(one.shadow, ".1f")),
            *(text(one.displacement, ".1f"), text(one.dists, ".4f")),
        )
        for name, ways in errors.items()
        for way, one in ways.items()
    ]
    return markdown(header, rows)
