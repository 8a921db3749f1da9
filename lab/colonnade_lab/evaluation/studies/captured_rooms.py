"""Rooms as a phone captures them: depth of 256x192 with correlated noise, without normals and albedo.

Rays are compared with the mesh of the room's own depth map, which the capture does not see. The albedo does not decide
them, so all of it is grey.

`colonnade study captures ROOM …` prints the figures.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from colonnade.capture.picture import fitted
from colonnade.capture.source import Frame, Lens
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.repair import filled, holes_of
from colonnade.maps.quality import angles
from scipy import ndimage

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.environment_accuracy import compare
from colonnade_lab.evaluation.studies.probe_spheres import mirror_rays, standing_spheres

if TYPE_CHECKING:
    from colonnade.environment.model import Environment

#: Width and height of a phone's depth, and the radius of its noise's correlation, pixels.
SENSOR = (256, 192)
CORRELATION = 1.0
#: Noise as a share of the depth; None: the room's own maps.
NOISE = (None, 0.0, 0.005, 0.01)


@dataclass(frozen=True)
class CaptureQuality:
    """Quality of a captured room.

    Attributes:
        noise: Of the sensor, as a share of the depth; None: the room's own maps.
        estimated: The noise that the capture shows.
        degrees: Mean error of the normals.
        rays: Mirror rays with a known hit.
        depth, planes, device: Shares of them that are right: by the captured depth map, by the planes that encode it,
            and by the device.
    """

    noise: float | None
    estimated: float
    degrees: float
    rays: int
    depth: float
    planes: float
    device: float


def captured(room: Environment, noise: float, seed: int = 1) -> tuple[Environment, float]:
    """A room as a phone captures it, and the noise that its depth shows."""
    columns, rows = SENSOR
    down = ((np.arange(rows) + 0.5) * room.height / rows).astype(int)
    across = ((np.arange(columns) + 0.5) * room.width / columns).astype(int)
    error = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal((rows, columns)), CORRELATION)
    depth = room.depth[np.ix_(down, across)] * (1.0 + noise * error / error.std())
    photo = np.zeros((room.height, room.width, 3), np.uint8)
    lens = Lens(room.fx, room.fy, room.cx, room.cy)
    frame = fitted(Frame(0, 0.0, photo, depth, lens, room.camera_to_world), room.width, room.height)
    holes = holes_of(frame.depth)
    seen = filled(frame.depth, holes)
    found = normals_of_depth(seen, holes, room.camera)
    return replace(room, depth=seen, normals=found.normals), found.noise


def study_captures(folders: Iterable[Path], progress: Progress = QUIET) -> dict[str, CaptureQuality]:
    """The quality of rooms as a phone captures them, by room and noise."""
    from colonnade.environment.load import load_environment

    reports = {}
    for folder in folders:
        room = load_environment(folder)
        for noise in NOISE:
            name = f"{room.name}, {'own maps' if noise is None else f'phone, {noise:.1%} noise'}"
            with progress.step(f"measuring {name}"):
                reports[name] = measure(room, noise)
    return reports


def measure(room: Environment, noise: float | None) -> CaptureQuality:
    """Capture a room and measure its mirror rays.

    Raises:
        UserError: No sphere can stand in the room.
    """
    from colonnade.design.generator import manifest_for
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.reference.environment.decoded import float_plane_march
    from colonnade.reference.environment.depth_mesh import DepthMesh
    from colonnade.reference.environment.ray_march import DepthMarch

    from colonnade_lab.evaluation.environment_march import DeviceMarch

    seen, estimated = (room, 0.0) if noise is None else captured(room, noise)
    seen = replace(seen, albedo=np.full_like(seen.albedo, 0.5))
    centres = standing_spheres(room)
    if len(centres) == 0:
        raise UserError(f"room {room.name} has no level surface on which a sphere is in full view")
    layout = AttributeLayout(width=room.width, height=room.height)
    image = encoded_environment(seen, layout)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    marches = DepthMarch(seen), float_plane_march(seen, image), DeviceMarch(seen, image, manifest)
    mesh, rays = DepthMesh(room), [mirror_rays(centre) for centre in centres]
    right: list[float] = []
    known = 0
    for march in marches:
        parts = [compare(room, mesh, march, part) for part in rays]
        is_known = np.concatenate([~part.truth.outside for part in parts])
        right.append(float(np.concatenate([part.ok for part in parts])[is_known].mean()))
        known = int(is_known.sum())
    degrees = float(angles(room.normals, seen.normals).mean())
    return CaptureQuality(noise, estimated, degrees, known, *right)


def table(reports: dict[str, CaptureQuality]) -> str:
    """The reports as a Markdown table."""
    header = ("room", "noise found", "normals off", "mirror rays right: depth map", "planes", "device", "rays")
    rows = [
        (
            name,
            "" if report.noise is None else f"{report.estimated:.2%}",
            f"{report.degrees:.1f}°",
            *(f"{100 * share:.1f} %" for share in (report.depth, report.planes, report.device)),
            f"{report.rays:,}",
        )
        for name, report in reports.items()
    ]
    return markdown(header, rows)
