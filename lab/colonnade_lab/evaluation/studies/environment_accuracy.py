"""Accuracy of a reconstructed room: rays from mirror, matt and glass spheres against the mesh of the full depth map.

A ray is *known* if it hits the mesh from the front. A known ray is *ok* if the march hits within `NEAR_PIXELS` of the
same map position or within `NEAR_METRES` of the same point. It is *missed* if the march has no hit. Pictures show the
albedo in sRGB over known rays; missed rays are black.

`colonnade study rays ROOM …` prints the figures of three marches: float through the planes of the full maps, float
through the planes of the attribute memory, and the device's march.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.types import Floats
from colonnade.quality.image_metrics import flip_map, psnr
from colonnade.reference.environment.depth_mesh import DepthMesh
from colonnade.reference.environment.ray_march import HIDDEN, HIT, DepthMarch, MarchHits, RayMarch, positions
from numpy.typing import NDArray

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.probe_spheres import (
    PICTURE,
    Rays,
    cosine_rays,
    glass_rays,
    mirror_rays,
    standing_spheres,
)

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.reference.environment.surface import SurfaceHits


#: Tolerances of a correct hit.
NEAR_PIXELS = 5.0
NEAR_METRES = 0.05
#: Cosine-distributed rays per sphere.
COSINE_RAYS = 12_000


@dataclass(frozen=True)
class RayAccuracy:
    """Accuracy of one kind of rays.

    Attributes:
        rays: Number of rays.
        known: Known rays, as a share of all rays.
        left: Rays that miss the mesh, as a share of all rays. The others hit it from behind.
        ok, missed: Shares of the known rays.
        invented: Rays with a hit in the march, as a share of the rays that miss the mesh.
        mean_steps, p95_steps: March steps, mean and 95th percentile over all rays.
    """

    rays: int
    known: float
    left: float
    ok: float
    missed: float
    invented: float
    mean_steps: float
    p95_steps: float


@dataclass(frozen=True)
class EnvironmentAccuracy:
    """Accuracy of a reconstructed room.

    Attributes:
        spheres: Number of probe spheres.
        mirror, cosine, glass: Accuracy by kind of rays.
        mean_steps, p95_steps: March steps, mean and 95th percentile over the rays of all kinds.
        mirror_psnr, mirror_flip: PSNR (dB) and mean FLIP of the mirror spheres' pictures.
        receiver_mean, receiver_p95: Depth error of directly visible surfaces along the camera's rays, metres; None
            without a reconstructed depth.
    """

    spheres: int
    mirror: RayAccuracy
    cosine: RayAccuracy
    glass: RayAccuracy
    mean_steps: float
    p95_steps: float
    mirror_psnr: float
    mirror_flip: float
    receiver_mean: float | None
    receiver_p95: float | None


@dataclass(frozen=True)
class Comparison:
    """Hits of the same rays on the depth mesh (`truth`) and in the march (`marched`).

    Attributes:
        rays: The rays.
        truth: Hits on the mesh; a hit from behind is outside.
        misses_mesh: Rays without any hit on the mesh, bool [n].
        marched: Hits in the march.
        ok: Known rays that are right, bool [n].
    """

    rays: Rays
    truth: SurfaceHits
    misses_mesh: NDArray[np.bool_]
    marched: MarchHits
    ok: NDArray[np.bool_]

    @property
    def found(self) -> NDArray[np.bool_]:
        """Rays with a hit on the map, bool [n]."""
        return _found(self.marched)


def study(environment: Environment, march: RayMarch, depth: Floats | None = None, seed: int = 1) -> EnvironmentAccuracy:
    """Measure the accuracy of a ray march.

    Args:
        environment: The room with its depth map.
        march: The march to measure.
        depth: Reconstructed depth of each pixel, metres, float64 [height, width].
        seed: Random seed of the cosine-distributed directions.

    Raises:
        UserError: No sphere can stand in the room.
    """
    mesh, random = DepthMesh(environment), np.random.default_rng(seed)
    centres = standing_spheres(environment)
    if len(centres) == 0:
        raise UserError(f"room {environment.name} has no level surface on which a sphere is in full view")
    mirror = [compare(environment, mesh, march, mirror_rays(centre)) for centre in centres]
    cosine = [compare(environment, mesh, march, cosine_rays(centre, COSINE_RAYS, random)) for centre in centres]
    glass = [compare(environment, mesh, march, glass_rays(centre)) for centre in centres]
    steps = np.concatenate([comparison.marched.steps for comparison in (*mirror, *cosine, *glass)])
    pictures = [_pictures(environment, comparison) for comparison in mirror]
    known = np.concatenate([mask for _, _, mask in pictures], axis=1)
    true, marched = (np.concatenate([pair[i] for pair in pictures], axis=1) for i in (0, 1))
    receivers = _receiver_errors(environment, depth) if depth is not None else None
    return EnvironmentAccuracy(
        spheres=len(centres),
        mirror=_ray_accuracy(mirror),
        cosine=_ray_accuracy(cosine),
        glass=_ray_accuracy(glass),
        mean_steps=float(steps.mean()),
        p95_steps=float(np.percentile(steps, 95)),
        mirror_psnr=psnr(true[known], marched[known]),
        mirror_flip=float(flip_map(true, marched)[known].mean(dtype=np.float64)),
        receiver_mean=None if receivers is None else float(receivers.mean()),
        receiver_p95=None if receivers is None else float(np.percentile(receivers, 95)),
    )


def compare(environment: Environment, mesh: DepthMesh, march: RayMarch, rays: Rays) -> Comparison:
    """Trace rays through the room's mesh and through a march of it."""
    truth = mesh.intersect(rays.origins, rays.directions)
    marched = march(rays.origins, rays.directions)
    return Comparison(rays, truth, np.isnan(truth.u), marched, are_right(environment, truth, marched))


def are_right(environment: Environment, truth: SurfaceHits, marched: MarchHits) -> NDArray[np.bool_]:
    """Rays whose true hit is in the maps and near the march's, bool [n]."""
    near = np.hypot(marched.seen_u - truth.u, marched.seen_v - truth.v) <= NEAR_PIXELS
    near |= np.linalg.norm(positions(environment, marched) - truth.position, axis=1) <= NEAR_METRES
    return np.asarray(near & _found(marched) & ~truth.outside, dtype=np.bool_)


def _found(marched: MarchHits) -> NDArray[np.bool_]:
    return np.asarray((marched.kind == HIT) | (marched.kind == HIDDEN), dtype=np.bool_)


def _ray_accuracy(parts: list[Comparison]) -> RayAccuracy:
    def all_of(values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate(list(values))

    known, found = all_of(~part.truth.outside for part in parts), all_of(part.found for part in parts)
    misses, steps = all_of(part.misses_mesh for part in parts), all_of(part.marched.steps for part in parts)
    return RayAccuracy(
        rays=len(known),
        known=float(known.mean()),
        left=float(misses.mean()),
        ok=float(all_of(part.ok for part in parts)[known].mean()),
        missed=float((~found)[known].mean()),
        invented=float(found[misses].mean()) if misses.any() else 0.0,
        mean_steps=float(steps.mean()),
        p95_steps=float(np.percentile(steps, 95)),
    )


def _pictures(
    environment: Environment, comparison: Comparison
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.bool_]]:
    """Pictures of a mirror sphere by depth mesh and by march, uint8 [h, w, 3], and the mask of known rays.

    Pixels outside the mask are grey.
    """
    albedo = encode_srgb(environment.albedo)
    known = ~comparison.truth.outside
    pictures = []
    for u, v, found in (
        (comparison.truth.u, comparison.truth.v, known),
        (comparison.marched.seen_u, comparison.marched.seen_v, comparison.found),
    ):
        picture = np.full((PICTURE * PICTURE, 3), 128, dtype=np.uint8)
        column = np.clip(np.nan_to_num(u), 0, environment.width - 1).astype(np.intp)
        row = np.clip(np.nan_to_num(v), 0, environment.height - 1).astype(np.intp)
        colours = np.where(found[:, None], albedo[row, column], 0)
        picture[comparison.rays.pixels[known]] = colours[known]
        pictures.append(picture.reshape(PICTURE, PICTURE, 3))
    mask = np.zeros(PICTURE * PICTURE, dtype=np.bool_)
    mask[comparison.rays.pixels[known]] = True
    return pictures[0], pictures[1], mask.reshape(PICTURE, PICTURE)


def _receiver_errors(environment: Environment, depth: Floats) -> Floats:
    """Distance between each pixel's surface and its reconstruction along the camera's ray, metres, float64 [pixels]."""
    length = np.linalg.norm(environment.camera.directions(environment.width, environment.height), axis=2)
    return np.asarray((np.abs(depth - environment.depth) * length).ravel(), dtype=np.float64)


def table(reports: dict[str, EnvironmentAccuracy]) -> str:
    """The reports as a Markdown table, by name."""
    names = ("mirror ok %", "cosine ok %", "glass ok %", "mirror missed %", "mirror PSNR dB", "mirror FLIP")
    kinds_of = ("off mesh %: mirror, cosine, glass", "known %: mirror, cosine, glass")
    header = ("room", *names, "depth error cm: mean, p95", "steps: mean, p95", *kinds_of, "rays")
    rows = []
    for name, report in reports.items():
        kinds = (report.mirror, report.cosine, report.glass)
        receivers = "none"
        if report.receiver_mean is not None and report.receiver_p95 is not None:
            receivers = f"{100 * report.receiver_mean:.2f}, {100 * report.receiver_p95:.2f}"
        rows.append(
            (
                name,
                *(f"{100 * kind.ok:.1f}" for kind in kinds),
                f"{100 * report.mirror.missed:.2f}",
                f"{report.mirror_psnr:.1f}",
                f"{report.mirror_flip:.3f}",
                receivers,
                f"{report.mean_steps:.1f}, {report.p95_steps:.0f}",
                ", ".join(f"{100 * kind.left:.0f}" for kind in kinds),
                ", ".join(f"{100 * kind.known:.0f}" for kind in kinds),
                f"{sum(kind.rays for kind in kinds):,}",
            )
        )
    return markdown(header, rows)


def study_rooms(folders: Iterable[Path]) -> dict[str, EnvironmentAccuracy]:
    """The accuracy of rooms, by room and march.

    The marches are: float through the full maps, float through the attribute memory's planes, and the device's.
    """
    from colonnade.design.generator import manifest_for
    from colonnade.environment.load import load_environment
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.reference.environment.decoded import decoded_depth, float_plane_march

    from colonnade_lab.evaluation.environment_march import DeviceMarch

    reports = {}
    for folder in folders:
        environment = load_environment(folder)
        layout = AttributeLayout(width=environment.width, height=environment.height)
        image = encoded_environment(environment, layout)
        manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
        reports[f"{environment.name}, full maps"] = study(environment, DepthMarch(environment), environment.depth)
        reports[f"{environment.name}, planes"] = study(
            environment, float_plane_march(environment, image), decoded_depth(environment, image)
        )
        reports[f"{environment.name}, device"] = study(
            environment, DeviceMarch(environment, image, manifest), decoded_depth(environment, image)
        )
    return reports
