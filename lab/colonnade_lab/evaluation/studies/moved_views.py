"""Study: generated rooms seen by cameras other than the maps', on the device.

The cameras stand up to `METRES` beside the maps' camera along each axis, and turn up to `DEGREES` about each axis. The
rays of a frame's pixels march. A pixel is right as a ray of `environment_accuracy` is: within 5 pixels or 5 cm of the
real surface. Only pixels count whose surface the maps show.

`colonnade study views SEEDS` prints the table.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.common.types import Floats
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.encoders import Encoder
from colonnade.maps.layout import AttributeLayout
from colonnade.reference.environment.ray_march import HIDDEN, HIT

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.environment_march import DeviceMarch
from colonnade_lab.evaluation.studies.environment_accuracy import are_right
from colonnade_lab.evaluation.studies.generated_rooms import KINDS, generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room
from colonnade_lab.evaluation.studies.visible_surface import VisibleSurface

#: Cameras of a room; how far they are from the maps'.
VIEWS, METRES, DEGREES = 20, 0.3, 10.0
#: Size of a frame, pixels.
FRAME = (160, 120)


@dataclass(frozen=True)
class MovedViews:
    """A room from moved cameras.

    Attributes:
        kind: Of `KINDS`.
        seen: Share of the pixels whose surface the maps show.
        right: Of them, the share that is right: of all views, and of the worst.
        worst: As `right`, of the worst view.
        hit, hidden: Shares of all pixels that see a point of the maps, and one on the extension of an occluded surface.
        steps: March steps of a pixel.
    """

    kind: str
    seen: float
    right: float
    worst: float
    hit: float
    hidden: float
    steps: float


def study_seeds(
    seeds: Iterable[int], encoder: Encoder = "offline", progress: Progress = QUIET, views: int = VIEWS
) -> dict[int, MovedViews]:
    """Generated rooms by seed."""
    reports = {}
    for seed in seeds:
        with progress.step(f"measuring room {seed}"):
            reports[seed] = measure_seed(seed, encoder, views)
    return reports


def measure_seed(seed: int, encoder: Encoder = "offline", views: int = VIEWS) -> MovedViews:
    """One room, which is written and loaded as a user's room."""
    from colonnade.design.generator import manifest_for

    with temporary_folder() as folder:
        made = generated_room(seed)
        write_room(folder / f"seed-{seed}", made.environment)
        environment = load_environment(folder / f"seed-{seed}")
    layout = AttributeLayout(environment.width, environment.height)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    march = DeviceMarch(environment, encoded_environment(environment, layout, encoder=encoder), manifest, True)
    surface, random = VisibleSurface(made), np.random.default_rng(seed)
    right, seen, kinds, steps = [], [], [], []
    for _ in range(views):
        origins, directions = moved_rays(environment, random)
        truth, marched = surface.intersect(origins, directions), march(origins, directions)
        seen.append(~truth.outside)
        right.append(are_right(environment, truth, marched))
        kinds.append(marched.kind)
        steps.append(marched.steps)
    shares = [float(good[known].mean()) for good, known in zip(right, seen, strict=True) if known.any()]
    every, kind = np.concatenate(seen), np.concatenate(kinds)
    return MovedViews(
        KINDS[seed % len(KINDS)],
        float(every.mean()),
        float(np.concatenate(right)[every].mean()),
        min(shares),
        float((kind == HIT).mean()),
        float((kind == HIDDEN).mean()),
        float(np.concatenate(steps).mean()),
    )


def moved_rays(environment: Environment, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Rays of a camera near the maps', in view space, metres: float64 [n, 3] each."""
    position = random.uniform(-METRES, METRES, 3)
    x, y, z = np.radians(random.uniform(-DEGREES, DEGREES, 3))
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    step = environment.width / FRAME[0]
    u, v = (np.arange(FRAME[0]) + 0.5) * step, (np.arange(FRAME[1]) + 0.5) * step
    rays = np.ones((FRAME[1], FRAME[0], 3))
    rays[..., 0] = (u - environment.cx) / environment.fx
    rays[..., 1] = (v[:, None] - environment.cy) / environment.fy
    directions = rays.reshape(-1, 3) @ (about_z @ about_y @ about_x).T
    return np.tile(position, (len(directions), 1)), directions


def table(reports: Mapping[int, MovedViews]) -> str:
    """The reports as a Markdown table."""
    header = ("seed", "kind", "shown %", "right %: all, worst view", "hits %: visible, hidden", "steps a pixel")
    rows = [
        (
            str(seed),
            report.kind,
            f"{100 * report.seen:.1f}",
            f"{100 * report.right:.2f}, {100 * report.worst:.2f}",
            f"{100 * report.hit:.1f}, {100 * report.hidden:.1f}",
            f"{report.steps:.2f}",
        )
        for seed, report in reports.items()
    ]
    return markdown(header, rows)
