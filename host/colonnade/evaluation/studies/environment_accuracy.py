"""How right a rebuilt room is: rays of mirror, matt and glass spheres against the mesh of the full depth map.

The truth knows a ray if it meets the mesh from the front. A known ray is *ok* if the rebuild meets the room within
`NEAR_PIXELS` of the map or `NEAR_METRES` of the point, and *missed* if the rebuild says that it leaves the view or
gives up. Pictures are of the albedo in sRGB, over known rays; what was missed is black.

`colonnade study ROOM …` prints the figures of rooms, marched in 64 bits through the planes of the full maps, and
through those that the attribute memory holds.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.types import Floats
from colonnade.evaluation.studies.probe_spheres import (
    PICTURE,
    Rays,
    cosine_rays,
    glass_rays,
    mirror_rays,
    standing_spheres,
)
from colonnade.quality.image_metrics import flip_map, psnr
from colonnade.reference.environment.depth_mesh import DepthMesh
from colonnade.reference.environment.ray_march import HIDDEN, HIT, DepthMarch, MarchHits, RayMarch, positions

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.reference.environment.surface import SurfaceHits


NEAR_PIXELS = 5.0
NEAR_METRES = 0.05
#: Cosine-distributed rays from each sphere.
COSINE_RAYS = 12_000


@dataclass(frozen=True)
class KindReport:
    """Rays of one kind; shares are of the known rays unless they say otherwise.

    Attributes:
        rays: All of them.
        known: Share of all rays of which the truth knows what they meet.
        left: Share of all rays that meet nothing of the mesh; the rest meets it from behind.
        ok, missed: As defined above.
        invented: Share of the rays that meet nothing for which the rebuild finds a point in the maps.
        mean_steps, p95_steps: Of all rays.
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
class RebuildReport:
    """A room's figures.

    Attributes:
        spheres: That stood in it.
        mirror, cosine, glass: By kind.
        mean_steps, p95_steps: Of the rays of all kinds.
        mirror_psnr, mirror_flip: Of the mirror spheres' pictures, dB and mean error.
        receiver_mean, receiver_p95: Metres along the camera's ray between the surface that a pixel shows and its
            rebuilt one; None without a rebuilt depth.
    """

    spheres: int
    mirror: KindReport
    cosine: KindReport
    glass: KindReport
    mean_steps: float
    p95_steps: float
    mirror_psnr: float
    mirror_flip: float
    receiver_mean: float | None
    receiver_p95: float | None


@dataclass(frozen=True)
class _Answers:
    """Rays with the truth and what the rebuild says."""

    rays: Rays
    truth: SurfaceHits
    nothing: NDArray[np.bool_]
    rebuilt: MarchHits
    ok: NDArray[np.bool_]

    @property
    def found(self) -> NDArray[np.bool_]:
        return _found(self.rebuilt)


def study(environment: Environment, rebuild: RayMarch, depth: Floats | None = None, seed: int = 1) -> RebuildReport:
    """Measure a rebuild.

    Args:
        room: With its depth map.
        rebuild: Where it says that rays meet the room.
        depth: What the rebuild takes for the depth of each pixel, metres, float64 [height, width].
        seed: Of the cosine-distributed directions.
    """
    mesh, random = DepthMesh(environment), np.random.default_rng(seed)
    centres = standing_spheres(environment)
    if len(centres) == 0:
        raise UserError(f"room {environment.name} has no level surface on which a sphere could stand in full view")
    mirror = [_asked(environment, mesh, rebuild, mirror_rays(centre)) for centre in centres]
    cosine = [_asked(environment, mesh, rebuild, cosine_rays(centre, COSINE_RAYS, random)) for centre in centres]
    glass = [_asked(environment, mesh, rebuild, glass_rays(centre)) for centre in centres]
    steps = np.concatenate([answers.rebuilt.steps for answers in (*mirror, *cosine, *glass)])
    pictures = [_pictures(environment, answers) for answers in mirror]
    known = np.concatenate([mask for _, _, mask in pictures], axis=1)
    true, seen = (np.concatenate([pair[i] for pair in pictures], axis=1) for i in (0, 1))
    receivers = _receiver_errors(environment, depth) if depth is not None else None
    return RebuildReport(
        spheres=len(centres),
        mirror=_kind_report(mirror),
        cosine=_kind_report(cosine),
        glass=_kind_report(glass),
        mean_steps=float(steps.mean()),
        p95_steps=float(np.percentile(steps, 95)),
        mirror_psnr=psnr(true[known], seen[known]),
        mirror_flip=float(flip_map(true, seen)[known].mean(dtype=np.float64)),
        receiver_mean=None if receivers is None else float(receivers.mean()),
        receiver_p95=None if receivers is None else float(np.percentile(receivers, 95)),
    )


def _asked(environment: Environment, mesh: DepthMesh, rebuild: RayMarch, rays: Rays) -> _Answers:
    truth = mesh.intersect(rays.origins, rays.directions)
    rebuilt = rebuild(rays.origins, rays.directions)
    near = np.hypot(rebuilt.seen_u - truth.u, rebuilt.seen_v - truth.v) <= NEAR_PIXELS
    near |= np.linalg.norm(positions(environment, rebuilt) - truth.position, axis=1) <= NEAR_METRES
    return _Answers(rays, truth, np.isnan(truth.u), rebuilt, near & _found(rebuilt) & ~truth.outside)


def _found(rebuilt: MarchHits) -> NDArray[np.bool_]:
    return np.asarray((rebuilt.kind == HIT) | (rebuilt.kind == HIDDEN), dtype=np.bool_)


def _kind_report(parts: list[_Answers]) -> KindReport:
    def all_of(values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate(list(values))

    known, found = all_of(~part.truth.outside for part in parts), all_of(part.found for part in parts)
    nothing, steps = all_of(part.nothing for part in parts), all_of(part.rebuilt.steps for part in parts)
    return KindReport(
        rays=len(known),
        known=float(known.mean()),
        left=float(nothing.mean()),
        ok=float(all_of(part.ok for part in parts)[known].mean()),
        missed=float((~found)[known].mean()),
        invented=float(found[nothing].mean()) if nothing.any() else 0.0,
        mean_steps=float(steps.mean()),
        p95_steps=float(np.percentile(steps, 95)),
    )


def _pictures(
    environment: Environment, answers: _Answers
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.bool_]]:
    """A mirror sphere as it is and as rebuilt, uint8 [h, w, 3], and its pixels of known rays; grey elsewhere."""
    albedo = encode_srgb(environment.albedo)
    known = ~answers.truth.outside
    pictures = []
    for u, v, found in (
        (answers.truth.u, answers.truth.v, known),
        (answers.rebuilt.seen_u, answers.rebuilt.seen_v, answers.found),
    ):
        picture = np.full((PICTURE * PICTURE, 3), 128, dtype=np.uint8)
        column = np.clip(np.nan_to_num(u), 0, environment.width - 1).astype(np.intp)
        row = np.clip(np.nan_to_num(v), 0, environment.height - 1).astype(np.intp)
        colours = np.where(found[:, None], albedo[row, column], 0)
        picture[answers.rays.pixels[known]] = colours[known]
        pictures.append(picture.reshape(PICTURE, PICTURE, 3))
    mask = np.zeros(PICTURE * PICTURE, dtype=np.bool_)
    mask[answers.rays.pixels[known]] = True
    return pictures[0], pictures[1], mask.reshape(PICTURE, PICTURE)


def _receiver_errors(environment: Environment, depth: Floats) -> Floats:
    """Metres along the camera's rays between each pixel's surface and its rebuilt one, float64 [pixels]."""
    length = np.linalg.norm(environment.camera.directions(environment.width, environment.height), axis=2)
    return np.asarray((np.abs(depth - environment.depth) * length).ravel(), dtype=np.float64)


def table(reports: dict[str, RebuildReport]) -> str:
    """Reports by name as a table in Markdown; shares in per cent, receivers in centimetres."""
    names = ("mirror ok", "cosine ok", "glass ok", "mirror missed", "mirror dB", "FLIP", "receivers mean, p95")
    header = ("room", *names, "steps mean, p95", "left: mirror, cosine, glass", "known alike", "rays")
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
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (header, ["---"] * len(header), *rows))


def study_rooms(folders: Iterable[Path]) -> dict[str, RebuildReport]:
    """The figures of rooms, by name and march: through the full maps, through the attribute memory's planes in 64 bits,
    and the device's own march through them."""
    from colonnade.design.generator import manifest_for
    from colonnade.device.environment_march import DeviceMarch
    from colonnade.environment.encoding.cache import encoded_environment
    from colonnade.environment.encoding.layout import AttributeLayout
    from colonnade.environment.load import load_environment
    from colonnade.reference.environment.decoded import decoded_depth, float_plane_march

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
