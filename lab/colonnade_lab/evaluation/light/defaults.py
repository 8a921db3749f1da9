"""Measures what the default command gives in users' rooms, beside other settings with the same number of passes.

The objects' error is as in `columns`, against the path tracer. A setting of more rays has fewer samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from colonnade.common.image_io import read_picture
from colonnade.common.progress import QUIET, Progress
from colonnade.environment.model import Environment
from colonnade.environment.panorama_file import read_radiance
from colonnade.maps.encoders import Encoder
from colonnade.quality.image_metrics import psnr
from colonnade.render.frames import render
from colonnade.render.request import RenderRequest
from colonnade.scene.model import Denoiser, Scene
from colonnade.scene.parser import load_scene
from numpy.typing import NDArray

from colonnade_lab.evaluation.light import files
from colonnade_lab.evaluation.light.columns import CONFIG
from colonnade_lab.evaluation.light.probe import ProbeFrame
from colonnade_lab.evaluation.light.rooms import KnownRoom
from colonnade_lab.evaluation.light.surfaces import RoomSurface
from colonnade_lab.evaluation.light.user_rooms import REPORT, known_room

#: The name of the settings of the command.
DEFAULT = "default"


@dataclass(frozen=True)
class Setting:
    """Options in place of the default command's.

    Attributes:
        gather: Gathered rays of a path; None: as the command chooses.
        denoise: The filter; None: as the command chooses.
        encoder: Of the maps; None: as the command chooses.
    """

    gather: int | None = None
    denoise: bool | Denoiser | None = None
    encoder: Encoder | None = None

    def request(self, scene: Scene, samples: int | None) -> RenderRequest:
        """The request of a scene that leaves all open, with the samples of the default command, or None for that."""
        if self.gather is not None:
            scene = replace(scene, paths=replace(scene.paths, gather=self.gather), names_gather=True)
        denoise: bool | Denoiser | None = self.denoise
        if self.gather:
            denoise = True
        if samples is not None:
            samples = max(1, samples // (self.gather or 1))
        return RenderRequest(scene, CONFIG, backend="model", samples=samples, denoise=denoise, encoder=self.encoder)


#: What is measured beside the default, by name.
SETTINGS: Mapping[str, Setting] = {
    "no filter": Setting(denoise=False),
    "OIDN": Setting(denoise="oidn"),
    "2 rays, half the samples": Setting(gather=2),
    "no gathered light": Setting(gather=0),
    "offline encoder": Setting(encoder="offline"),
}


@dataclass(frozen=True)
class DefaultResult:
    """What was measured of a frame.

    Attributes:
        samples: Samples of a pixel that the default command takes.
        objects: PSNR of the objects' pixels, by `DEFAULT` and `SETTINGS`, decibels.
        things: The same of each object, by its kind.
    """

    samples: int
    objects: Mapping[str, float]
    things: Mapping[str, Mapping[str, float]]


def measure_defaults(
    folder: Path, names: tuple[str, ...] = tuple(REPORT), progress: Progress = QUIET
) -> Iterator[tuple[str, DefaultResult, dict[str, NDArray[np.uint8]]]]:
    """Measure the frames of users' rooms; scenes and rooms are written to a folder.

    Yields:
        What is known of the light, room and frame, as in ``panorama: kitchen-rough``; what was measured; and the
        pictures by setting, sRGB, uint8 [height, width, 3].

    Raises:
        UserError: There is no room of a name.
    """
    for name in names:
        room = known_room(name)
        environment = RoomSurface.of(room).maps(name, room.camera(), read_picture(files.stored(name) / "photo.webp"))
        for known, light in files.DEFAULT_LIGHTS.items():
            scenes = files.write_scenes(folder / light, name, room, light, environment, ())
            for frame, scene in scenes.items():
                with progress.step(f"measuring {name}, {frame}, {known}"):
                    result, pictures = _frame(name, room, frame, environment, load_scene(scene))
                yield f"{known}: {name}-{frame}", result, pictures


def _frame(
    name: str, room: KnownRoom, frame: str, environment: Environment, scene: Scene
) -> tuple[DefaultResult, dict[str, NDArray[np.uint8]]]:
    truth, things = files.truth(name, frame), room.frames[frame]
    around, panorama = (read_radiance(files.stored(name) / f"{which}.hdr") for which in ("around", "panorama"))
    owners = ProbeFrame((), things, environment, around, panorama, room.frame).owners()
    first = render(Setting().request(scene, None))
    samples = first.report.samples
    pictures = {DEFAULT: first.pixels}
    for title, setting in SETTINGS.items():
        pictures[title] = render(setting.request(scene, samples)).pixels
    masks: dict[str, NDArray[np.bool_]] = {thing.kind: owners == index for index, thing in enumerate(things)}
    of_things = {
        title: {kind: psnr(truth[mask], picture[mask]) for kind, mask in masks.items()}
        for title, picture in pictures.items()
    }
    objects = {title: psnr(truth[owners >= 0], picture[owners >= 0]) for title, picture in pictures.items()}
    return DefaultResult(samples, objects, of_things), pictures


def table(results: Mapping[str, DefaultResult]) -> str:
    """A line for each frame and setting: decibels of the objects, and of each."""
    lines = []
    for name, result in results.items():
        lines.append(f"{name}: {result.samples} samples")
        for title, own in result.things.items():
            things = ", ".join(f"{kind} {value:.1f}" for kind, value in own.items())
            lines.append(f"  {title:24} {result.objects[title]:5.1f} dB  {things}")
    return "\n".join(lines)
