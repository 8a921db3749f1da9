"""Study: encoded maps and the device's march in generated rooms, by seed.

Rays are as in `environment_accuracy`: reflections at mirror spheres, right within 5 pixels or 5 cm of the mesh of
the depth map. Their hits on the real surface are a second truth. Each ray that is wrong on the device has one cause,
the first that holds of `CAUSES`.

`colonnade study generated SEEDS` prints the table.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.common.types import Floats
from numpy.typing import NDArray

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.environment_accuracy import NEAR_METRES, Comparison, are_right, compare
from colonnade_lab.evaluation.studies.generated_rooms import KINDS, generated_room
from colonnade_lab.evaluation.studies.probe_spheres import mirror_rays, standing_spheres
from colonnade_lab.evaluation.studies.synthetic_attic import write_room
from colonnade_lab.evaluation.studies.visible_surface import VisibleSurface

#: Why a ray is wrong. *maps*: the march through the full maps is wrong too. *planes*: the plane of the true point's
#: pixel is off by 5 cm. *way*: planes on the way are, since the float march through them is wrong too. The others are
#: the device's own. *steps*: it took all its steps. *left*: it went to a bounding plane. *hidden*: it hit a surface
#: behind another one. *early*: it hit another visible surface.
CAUSES = ("maps", "planes", "way", "steps", "left", "hidden", "early")
#: Most steps of the device's march.
MAX_STEPS = 512
#: Largest seed, and most seeds of a table.
MAX_SEED, MAX_ROOMS = 999_999, 1000


@dataclass(frozen=True)
class RoomQuality:
    """Quality of a generated room.

    Attributes:
        kind: Of `KINDS`.
        spheres, rays: Number of mirror spheres, and of their known rays.
        full, planes, device: Shares of right rays: float march through full maps, through the planes, and device.
        true: Of the rays whose hit on the real surface the camera sees, the share that is right on the device.
        causes: Shares of all known rays that are wrong on the device, by `CAUSES`.
        dists: Of the encoded albedo; None without its weights.
        degrees: Mean error of the encoded normals.
        centimetres: Mean error of the planes along the view rays.
        bytes: Of the maps by name.
    """

    kind: str
    spheres: int
    rays: int
    full: float
    planes: float
    device: float
    true: float
    causes: dict[str, float]
    dists: float | None
    degrees: float
    centimetres: float
    bytes: dict[str, int]


def parse_seeds(text: str) -> list[int]:
    """Seeds of a text like ``0-9,100``.

    Raises:
        UserError: The text is something else.
    """
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        last = last if dash else first
        if not all(piece.isascii() and piece.isdigit() and len(piece) <= 6 for piece in (first, last)):
            raise UserError(f"seeds {text!r}: {part!r} is no seed: give seeds from 0 to {MAX_SEED}, such as 0-9,100")
        if int(last) < int(first):
            raise UserError(f"seeds {text!r}: the range {part!r} is empty: give the lower seed first")
        seeds += range(int(first), min(int(last), int(first) + MAX_ROOMS) + 1)
        if len(seeds) > MAX_ROOMS:
            raise UserError(f"seeds {text!r} has more than {MAX_ROOMS:,} seeds: give fewer")
    return list(dict.fromkeys(seeds))


def study_seeds(
    seeds: Iterable[int], with_dists: bool = True, progress: Progress = QUIET, size: tuple[int, int] = (640, 480)
) -> dict[int, RoomQuality]:
    """The quality of generated rooms by seed; ``size`` in pixels."""
    reports = {}
    for seed in seeds:
        with progress.step(f"measuring room {seed}"):
            reports[seed] = measure_seed(seed, with_dists, size)
    return reports


def measure_seed(seed: int, with_dists: bool = True, size: tuple[int, int] = (640, 480)) -> RoomQuality:
    """The quality of one room, which is written and loaded as a user's room.

    Raises:
        UserError: No sphere can stand in the room.
    """
    from colonnade.design.generator import manifest_for
    from colonnade.environment.load import load_environment
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.maps.planes import PlaneProjection
    from colonnade.maps.quality import angles, ray_errors
    from colonnade.quality.dists import dists_or_none
    from colonnade.reference.environment.decoded import float_plane_march
    from colonnade.reference.environment.depth_mesh import DepthMesh
    from colonnade.reference.environment.ray_march import DepthMarch

    from colonnade_lab.evaluation.environment_march import DeviceMarch

    with temporary_folder() as folder:
        made = generated_room(seed, *size)
        write_room(folder / f"seed-{seed}", made.environment)
        environment = load_environment(folder / f"seed-{seed}")
    layout = AttributeLayout(*size)
    image = encoded_environment(environment, layout)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    centres = standing_spheres(environment)
    if len(centres) == 0:
        raise UserError(f"room {seed} has no level surface on which a sphere is in full view: take another seed")
    mesh, rays = DepthMesh(environment), [mirror_rays(centre) for centre in centres]
    marches = (
        DepthMarch(environment),
        float_plane_march(environment, image),
        DeviceMarch(environment, image, manifest),
    )
    full, planes, device = ([compare(environment, mesh, march, part) for part in rays] for march in marches)
    known = np.concatenate([~part.truth.outside for part in device])
    surface = VisibleSurface(made)
    truths = [surface.intersect(part.origins, part.directions) for part in rays]
    right = [are_right(environment, truth, part.marched) for truth, part in zip(truths, device, strict=True)]
    errors = ray_errors(environment, image.decoded_depth(PlaneProjection.of(environment, image.depth_unit)))
    pictures = encode_srgb(environment.albedo), encode_srgb(image.decoded_albedo())
    return RoomQuality(
        kind=KINDS[seed % len(KINDS)],
        spheres=len(centres),
        rays=int(known.sum()),
        full=_right(full, known),
        planes=_right(planes, known),
        device=_right(device, known),
        true=float(np.concatenate(right)[np.concatenate([~truth.outside for truth in truths])].mean()),
        causes=_causes(errors > NEAR_METRES, full, planes, device),
        dists=dists_or_none(*pictures) if with_dists else None,
        degrees=float(angles(environment.normals, image.decoded_normals()).mean()),
        centimetres=100 * float(errors.mean()),
        bytes=image.byte_counts(),
    )


def _right(parts: list[Comparison], known: NDArray[np.bool_]) -> float:
    return float(np.concatenate([part.ok for part in parts])[known].mean())


def _causes(
    is_off: NDArray[np.bool_], full: list[Comparison], planes: list[Comparison], device: list[Comparison]
) -> dict[str, float]:
    """Shares of the known rays that are wrong for each cause; ``is_off``: pixels with wrong planes, [height, width]."""
    from colonnade.reference.environment.ray_march import HIDDEN

    counts, known = dict.fromkeys(CAUSES, 0), 0
    for by_maps, by_planes, part in zip(full, planes, device, strict=True):
        known += int((~part.truth.outside).sum())
        wrong = ~part.truth.outside & ~part.ok
        holds = {
            "maps": ~by_maps.ok,
            "planes": is_off[_texels(part.truth.v, is_off.shape[0]), _texels(part.truth.u, is_off.shape[1])],
            "way": ~by_planes.ok,
            "steps": ~part.found & (part.marched.steps >= MAX_STEPS),
            "left": ~part.found,
            "hidden": part.marched.kind == HIDDEN,
            "early": np.ones(len(wrong), dtype=np.bool_),
        }
        for cause, because in holds.items():
            counts[cause] += int((wrong & because).sum())
            wrong = wrong & ~because
    return {cause: count / known for cause, count in counts.items()}


def _texels(position: Floats, size: int) -> NDArray[np.intp]:
    """Pixels on one axis; any pixel for a ray without a position."""
    return np.clip(np.floor(np.nan_to_num(position)), 0, size - 1).astype(np.intp)


def table(reports: Mapping[int, RoomQuality]) -> str:
    """The reports as a Markdown table, with the worst of each column."""
    header = (
        *("seed", "kind", "rays", "right %: full maps, planes, **device**", "right %, real surface"),
        *(f"wrong %: {', '.join(CAUSES)}", "albedo DISTS", "normals °", "planes cm", "bytes"),
    )
    rows = [
        (
            str(seed),
            report.kind,
            f"{report.rays:,}",
            *_cells([report]),
            " + ".join(map("{:,}".format, report.bytes.values())),
        )
        for seed, report in reports.items()
    ]
    if reports:
        rows.append(("worst", "", "", *_cells(list(reports.values())), ""))
    return markdown(header, rows)


def _cells(reports: list[RoomQuality]) -> tuple[str, ...]:
    """Cells of the worst values of reports."""
    full, planes, device, true = (
        f"{100 * min(getattr(report, name) for report in reports):.1f}" for name in ("full", "planes", "device", "true")
    )
    causes = ", ".join(f"{100 * max(report.causes[cause] for report in reports):.2f}" for cause in CAUSES)
    known = [report.dists for report in reports if report.dists is not None]
    degrees, centimetres = (max(getattr(report, name) for report in reports) for name in ("degrees", "centimetres"))
    dists = f"{max(known):.3f}" if known else "-"
    return (f"{full}, {planes}, **{device}**", true, causes, dists, f"{degrees:.2f}", f"{centimetres:.2f}")
