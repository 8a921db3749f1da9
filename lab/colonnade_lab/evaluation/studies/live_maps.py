"""Study: maps of the live encoder against the offline encoder's, and along a camera's path.

Rays are reflections at mirror spheres, marched on the device, as in `environment_accuracy`. The live encoder gets each
room as a still. Times are CPU milliseconds of one core, the least of several frames.

`colonnade study live ROOMS` and `colonnade study live --rooms SEEDS` print the table; `colonnade study live-paths`
walks through the rooms of the seeds instead.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.live import STILL_ROUNDS, LiveEncoder, LiveFrame
from colonnade.maps.planes import PlaneProjection
from colonnade.maps.quality import angles, ray_errors
from colonnade.quality.image_metrics import psnr

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room

#: Frames of a still whose time is measured, and views of a path.
FRAMES, VIEWS = 10, 20
#: Metres between two views: 1.6 m/s at 30 frames a second.
STEP = 0.05
#: An error of a plane that counts, metres.
FAR_OFF = 0.05


@dataclass(frozen=True)
class MapQuality:
    """Quality of encoded maps.

    Attributes:
        dists: Of the albedo; None without its weights.
        psnr: Of the albedo, dB.
        degrees: Mean error of the normals.
        off: Share of the pixels whose plane is off by `FAR_OFF`.
        mirror: Share of mirror rays that are right on the device; None if it was not measured.
    """

    dists: float | None
    psnr: float
    degrees: float
    off: float
    mirror: float | None = None


@dataclass(frozen=True)
class LiveQuality:
    """A room in both encoders.

    Attributes:
        offline, live: Quality of the maps.
        first: CPU milliseconds of the first frame.
        milliseconds: Of a later one.
    """

    offline: MapQuality
    live: MapQuality
    first: float
    milliseconds: float


@dataclass(frozen=True)
class PathQuality:
    """The live encoder along a path.

    Attributes:
        psnr, degrees, off: Mean and worst of the views, as in `MapQuality`.
        lost: What the worst view has lost against the same view encoded as a still: dB, degrees.
        milliseconds: CPU time: mean and worst of the views after the first.
        first: CPU milliseconds of the first view.
    """

    psnr: tuple[float, float]
    degrees: tuple[float, float]
    off: tuple[float, float]
    lost: tuple[float, float]
    milliseconds: tuple[float, float]
    first: float


def study_rooms(folders: Iterable[Path], with_dists: bool = True, progress: Progress = QUIET) -> dict[str, LiveQuality]:
    """Rooms in folders, by name."""
    reports = {}
    for folder in folders:
        with progress.step(f"measuring {folder.name}"):
            reports[folder.name] = measure(load_environment(folder), with_dists)
    return reports


def study_seeds(seeds: Iterable[int], with_dists: bool = True, progress: Progress = QUIET) -> dict[str, LiveQuality]:
    """Generated rooms, by name."""
    reports = {}
    for seed in seeds:
        with progress.step(f"measuring room {seed}"):
            reports[f"seed {seed}"] = measure(_loaded(seed), with_dists)
    return reports


def study_paths(seeds: Iterable[int], progress: Progress = QUIET) -> dict[str, PathQuality]:
    """A path of `VIEWS` views in generated rooms, by name."""
    reports = {}
    for seed in seeds:
        with progress.step(f"walking through room {seed}"):
            reports[f"seed {seed}"] = walk(_loaded(seed, STEP * view) for view in range(VIEWS))
    return reports


def measure(environment: Environment, with_dists: bool = True) -> LiveQuality:
    """A room in both encoders."""
    layout = AttributeLayout(environment.width, environment.height)
    encoder, frame = LiveEncoder(layout), LiveFrame.of(environment)
    images, times = [], []
    for _ in range(1 + FRAMES):
        begun = time.thread_time()
        images.append(encoder.encode(frame).image)
        times.append(1e3 * (time.thread_time() - begun))
    offline = encoded_environment(environment, layout)
    best, live = (quality(environment, image, with_dists, True) for image in (offline, images[STILL_ROUNDS - 1]))
    return LiveQuality(best, live, times[0], min(times[1:]))


def walk(views: Iterable[Environment]) -> PathQuality:
    """The live encoder along views of one room."""
    encoder: LiveEncoder | None = None
    found, stills, times = [], [], []
    for environment in views:
        layout = AttributeLayout(environment.width, environment.height)
        encoder = encoder or LiveEncoder(layout)
        frame = LiveFrame.of(environment)
        begun = time.thread_time()
        image = encoder.encode(frame).image
        times.append(1e3 * (time.thread_time() - begun))
        found.append(quality(environment, image, with_dists=False))
        alone = LiveEncoder(layout)
        still = [alone.encode(frame).image for _ in range(STILL_ROUNDS)][-1]
        stills.append(quality(environment, still, with_dists=False))
    columns = [[getattr(one, name) for one in found] for name in ("psnr", "degrees", "off")]
    later = times[1:] or times
    return PathQuality(
        (float(np.mean(columns[0])), min(columns[0])),
        (float(np.mean(columns[1])), max(columns[1])),
        (float(np.mean(columns[2])), max(columns[2])),
        (
            max(still.psnr - one.psnr for still, one in zip(stills, found, strict=True)),
            max(one.degrees - still.degrees for still, one in zip(stills, found, strict=True)),
        ),
        (float(np.mean(later)), max(later)),
        times[0],
    )


def quality(
    environment: Environment, image: AttributeImage, with_dists: bool = True, with_rays: bool = False
) -> MapQuality:
    """The quality of a room's encoded maps."""
    from colonnade.quality.dists import dists_or_none

    pictures = encode_srgb(environment.albedo), encode_srgb(image.decoded_albedo())
    errors = ray_errors(environment, image.decoded_depth(PlaneProjection.of(environment, image.depth_unit)))
    return MapQuality(
        dists_or_none(*pictures) if with_dists else None,
        psnr(*pictures),
        float(angles(environment.normals, image.decoded_normals()).mean()),
        float(np.mean(errors > FAR_OFF)),
        mirror_rays_right(environment, image) if with_rays else None,
    )


def mirror_rays_right(environment: Environment, image: AttributeImage) -> float | None:
    """The share of known mirror rays that are right on the device; None if no sphere can stand in the room."""
    from colonnade.design.generator import manifest_for
    from colonnade.reference.environment.depth_mesh import DepthMesh

    from colonnade_lab.evaluation.environment_march import DeviceMarch
    from colonnade_lab.evaluation.studies.environment_accuracy import compare
    from colonnade_lab.evaluation.studies.probe_spheres import mirror_rays, standing_spheres

    settings = (f"physicalAttributeMemory={json.dumps(image.layout.to_config())}",)
    march = DeviceMarch(environment, image, manifest_for("small", settings).manifest)
    mesh, centres = DepthMesh(environment), standing_spheres(environment)
    if len(centres) == 0:
        return None
    parts = [compare(environment, mesh, march, mirror_rays(centre)) for centre in centres]
    known = np.concatenate([~part.truth.outside for part in parts])
    return float(np.concatenate([part.ok for part in parts])[known].mean())


def _loaded(seed: int, walked: float = 0.0) -> Environment:
    """A generated room as a user's room."""
    with temporary_folder() as folder:
        write_room(folder / f"seed-{seed}", generated_room(seed, walked=walked).environment)
        return load_environment(folder / f"seed-{seed}")


def table(reports: Mapping[str, LiveQuality]) -> str:
    """The reports as a Markdown table: offline and live."""
    header = (
        *("room", "ms a frame (first)", "albedo DISTS (×)", "albedo dB", "normals °", "planes off by 5 cm, %"),
        "mirror rays right, %",
    )
    rows = []
    for name, report in reports.items():
        offline, live = report.offline, report.live
        dists = mirror = "-"
        if offline.dists is not None and live.dists is not None:
            dists = f"{offline.dists:.3f}, {live.dists:.3f} ({live.dists / offline.dists:.2f})"
        if offline.mirror is not None and live.mirror is not None:
            mirror = f"{100 * offline.mirror:.1f}, {100 * live.mirror:.1f}"
        rows.append(
            (
                name,
                f"{report.milliseconds:.1f} ({report.first:.0f})",
                dists,
                f"{offline.psnr:.2f}, {live.psnr:.2f}",
                f"{offline.degrees:.2f}, {live.degrees:.2f}",
                f"{100 * offline.off:.2f}, {100 * live.off:.2f}",
                mirror,
            )
        )
    return markdown(header, rows)


def path_table(reports: Mapping[str, PathQuality]) -> str:
    """The paths as a Markdown table: mean and worst view."""
    header = ("path", "ms a frame, mean, worst (first)", "albedo dB", "normals °", "planes off by 5 cm, %", "lost")
    rows = [
        (
            name,
            f"{report.milliseconds[0]:.1f}, {report.milliseconds[1]:.1f} ({report.first:.0f})",
            f"{report.psnr[0]:.2f}, {report.psnr[1]:.2f}",
            f"{report.degrees[0]:.2f}, {report.degrees[1]:.2f}",
            f"{100 * report.off[0]:.2f}, {100 * report.off[1]:.2f}",
            f"{report.lost[0]:.2f} dB, {report.lost[1]:.2f}°",
        )
        for name, report in reports.items()
    ]
    return markdown(header, rows)
