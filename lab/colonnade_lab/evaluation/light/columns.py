"""Measures frames with objects in known rooms against the path tracer: what phones do, and Colonnade.

Regions are the truth's: the object's pixels, and the *room that changes*, its pixels that differ from the photo
by more than `CHANGED` codes. They are the same for all columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from colonnade.common.accumulation import LUMINANCE, FramePasses
from colonnade.common.image_io import decode_srgb, encode_srgb, read_picture, resized_photo
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import manifest_for
from colonnade.device.device import require_no_errors
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.environment.panorama_file import read_radiance
from colonnade.maps.encoders import Encoder
from colonnade.render.device_frames import host_frames
from colonnade.render.host_frame import HostFrame
from colonnade.render.passes import model_passes
from colonnade.render.request import RenderRequest
from colonnade.scene.model import Denoiser
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from numpy.typing import NDArray

from colonnade_lab.evaluation.light import files
from colonnade_lab.evaluation.light.mirror_rays import MirrorErrors, mirror_errors
from colonnade_lab.evaluation.light.probe import ProbeFrame
from colonnade_lab.evaluation.light.rooms import ROOMS, KnownRoom, PointLight
from colonnade_lab.evaluation.light.surfaces import RoomSurface
from colonnade_lab.evaluation.light.user_rooms import known_room
from colonnade_lab.evaluation.region_metrics import compare_regions

#: The preset that renders.
CONFIG = "small"
#: What it needs for all lights of a user's room.
_MORE_LIGHTS = ("frame.lights=8",)
#: A pixel of the room has changed if a channel differs by more, of 255: the two pictures of the room without objects,
#: the photo's and the truth's, differ by less.
CHANGED = 8
#: Passes of the columns.
PASSES = (1, 4, 16)
#: Open Image Denoise, in the names of columns.
OIDN = "OIDN"


@dataclass(frozen=True)
class Column:
    """A way to render Colonnade's frame.

    Attributes:
        passes: Samples of a pixel.
        gather: Gathered rays of a path.
        denoise: The host's filter of the picture, as of a scene.
        light: What is known: ``panorama``, the lights, and the panorama of all other light; ``lights``, these alone;
            ``exposed``, the whole panorama with its exposure; ``around``, the panorama alone; ``photo``, nothing.
        has_maps: Albedo and normals of a user's room are also known.
    """

    passes: int
    gather: int = 1
    denoise: bool | Denoiser = False
    light: str = "panorama"
    has_maps: bool = False

    @property
    def knows_lights(self) -> bool:
        """Whether the scene has the room's own lights."""
        return self.light in ("panorama", "lights")

    @property
    def scene(self) -> str:
        """The scene that has what is known, of `files.LIGHTS` or `files.USERS_LIGHTS`."""
        return f"{self.light}-{self.gather}{'-maps' if self.has_maps else ''}"


def columns(is_users: bool = False) -> dict[str, Column]:
    """Colonnade's columns by name, or a user's room's."""
    if is_users:
        known, photo = (Column(1, denoise=True, light=light) for light in ("around", "photo"))
        filtered = {
            f"{count} pass{'es' if count > 1 else ''}, filtered": replace(known, passes=count) for count in PASSES
        }
        best, alone = replace(known, passes=PASSES[-1]), replace(photo, passes=PASSES[-1])
        return filtered | {
            "true exposure": replace(best, light="exposed"),
            "true lights": replace(best, light="panorama"),
            "true maps": replace(best, has_maps=True),
            "true lights, maps": replace(best, light="panorama", has_maps=True),
            "photo alone": alone,
            "photo alone, true maps": replace(alone, has_maps=True),
            "photo alone, true lights": replace(alone, light="lights"),
        }
    found = {"ambient light": Column(4, gather=0, light="lights")}
    for passes in PASSES:
        count = f"{passes} pass{'es' if passes > 1 else ''}"
        found |= {count: Column(passes), f"{count}, filtered": Column(passes, denoise=True)}
        found[f"{count}, {OIDN}"] = Column(passes, denoise="oidn")
    best = Column(PASSES[-1], denoise=True)
    return found | {
        "16 passes of 2 rays, filtered": replace(best, gather=2),
        "panorama alone": replace(best, light="around"),
        "photo alone, no gathered light": Column(4, gather=0, light="photo"),
        "photo alone": replace(best, light="photo"),
    }


@dataclass(frozen=True)
class Quality:
    """The error of a frame in decibels, FLIP and DISTS.

    Attributes:
        frame, object, room: PSNR of the whole frame, of the objects, of the room that changes.
        frame_flip, object_flip, room_flip: Mean FLIP there.
        frame_dists, object_dists: DISTS of the frame, and of the objects with the truth around them; None without its
            weights.
        things: PSNR of each object, by its kind.
        brightness: Light of the pixels of the mirror, or of the matt object, over the truth's; None without them.
    """

    frame: float
    object: float
    room: float
    frame_flip: float
    object_flip: float
    room_flip: float
    frame_dists: float | None
    object_dists: float | None
    things: Mapping[str, float]
    brightness: float | None = None


@dataclass(frozen=True)
class FrameResult:
    """What was measured of a frame.

    Attributes:
        pixels: Pixels of the objects, and of the room that changes.
        qualities: By column.
        mirrors: Errors of mirror rays, of the probe and of Colonnade; None without a mirror.
    """

    pixels: tuple[int, int]
    qualities: Mapping[str, Quality]
    mirrors: Mapping[str, MirrorErrors] | None = None


def measure(
    folder: Path, names: tuple[str, ...] = tuple(ROOMS), progress: Progress = QUIET
) -> Iterator[tuple[str, FrameResult, dict[str, NDArray[np.uint8]]]]:
    """Measure all frames of rooms; scenes and rooms are written to a folder.

    Yields:
        Room and frame, what was measured, and the pictures by column, sRGB.
    """
    for name in names:
        room = known_room(name)
        surface = RoomSurface.of(room)
        environment = surface.maps(name, room.camera(), read_picture(files.stored(name) / "photo.webp"))
        lights = surface.lights(room)
        wanted = files.USERS_LIGHTS if room.is_users else files.LIGHTS
        scenes = {light: files.write_scenes(folder / light, name, room, light, environment, lights) for light in wanted}
        loaded = load_environment(folder / wanted[0] / name)
        for frame, things in room.frames.items():
            of_frame = {light: own[frame] for light, own in scenes.items()}
            with progress.step(f"measuring {name}, {frame}"):
                mirrors = None
                if any(thing.kind == "mirror" for thing in things):
                    mirrors = mirror_errors(room, things, surface, loaded)
                result, pictures = _frame(name, room, frame, environment, lights, of_frame, mirrors)
            yield f"{name}-{frame}", result, pictures


def _frame(
    name: str,
    room: KnownRoom,
    frame: str,
    environment: Environment,
    lights: Sequence[PointLight],
    scenes: Mapping[str, Path],
    mirrors: Mapping[str, MirrorErrors] | None,
) -> tuple[FrameResult, dict[str, NDArray[np.uint8]]]:
    truth = files.truth(name, frame)
    assert environment.photo is not None
    things = room.frames[frame]
    pictures = {"truth": truth, "no object": resized_photo(environment.photo, *room.frame)}
    around, panorama = (read_radiance(files.stored(name) / f"{which}.hdr") for which in ("around", "panorama"))
    image, owners = ProbeFrame(lights, things, environment, around, panorama, room.frame).render()
    pictures["probe, rasteriser"] = encode_srgb(image)
    pictures |= _colonnade(scenes, room)
    is_object = owners >= 0
    difference = np.abs(truth.astype(int) - pictures["no object"]).max(axis=2)
    regions = {"frame": np.ones_like(is_object), "object": is_object, "room": ~is_object & (difference > CHANGED)}
    of_things: dict[str, NDArray[np.bool_]] = {thing.kind: owners == index for index, thing in enumerate(things)}
    bright = of_things.get("mirror", of_things.get("matt"))
    qualities = {
        title: _quality(truth, picture, regions, of_things, bright)
        for title, picture in pictures.items()
        if title != "truth"
    }
    pixels = (int(is_object.sum()), int(regions["room"].sum()))
    return FrameResult(pixels, qualities, mirrors), pictures


def _colonnade(scenes: Mapping[str, Path], room: KnownRoom) -> dict[str, NDArray[np.uint8]]:
    """The pictures of all columns; columns that differ only in their filter have the same passes, rendered once."""
    pictures: dict[str, NDArray[np.uint8]] = {}
    passes: dict[Column, tuple[HostFrame, FramePasses]] = {}
    for title, column in columns(room.is_users).items():
        unfiltered = replace(column, denoise=False)
        if unfiltered not in passes:
            scene = load_scene(scenes[column.scene]).with_samples(column.passes)
            encoder: Encoder = "live" if room.is_users else "offline"
            manifest = manifest_for(CONFIG, _MORE_LIGHTS if room.is_users and column.knows_lights else ()).manifest
            prepared = DeviceScene.of(exposed(scene), manifest, size=room.frame, encoder=encoder)
            request = RenderRequest(scene, CONFIG, backend="model", denoise=column.gather > 0)
            (frame,) = host_frames(request, prepared, room.frame, [prepared.scene], 0.0, QUIET)
            ((sums, _, _),) = model_passes([frame], [[frame.registers(one) for one in frame.passes]])
            require_no_errors(sums.errors)
            passes[unfiltered] = frame, sums
        frame, sums = passes[unfiltered]
        pictures[title] = replace(frame, denoise=column.denoise).pixels(sums)
    return pictures


def _quality(
    truth: NDArray[np.uint8],
    picture: NDArray[np.uint8],
    regions: Mapping[str, NDArray[np.bool_]],
    of_things: Mapping[str, NDArray[np.bool_]],
    bright: NDArray[np.bool_] | None,
) -> Quality:
    own = compare_regions(truth, picture, {**regions, **of_things}, with_dists=("frame", "object"))
    values = {part: own[part].psnr or 0.0 for part in own}
    flips = {part: own[part].flip or 0.0 for part in regions}
    quality = Quality(
        values["frame"],
        values["object"],
        values["room"],
        flips["frame"],
        flips["object"],
        flips["room"],
        own["frame"].dists,
        own["object"].dists,
        {kind: values[kind] for kind in of_things},
    )
    if bright is None:
        return quality
    light = [float((decode_srgb(image[bright]) @ LUMINANCE).mean()) for image in (picture, truth)]
    return replace(quality, brightness=light[0] / light[1])
