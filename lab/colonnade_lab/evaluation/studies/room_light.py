"""Light of photographed rooms: relit rooms against their photos, and mirrors against the photo that they reflect.

A *single-bounce* pixel shows a mirror whose reflected ray misses the object and hits the depth map from the front, so
that the photo has the colour of the reflected point. Lights cast no shadows here, since the photo lacks the object's.

`colonnade study light ROOM …` prints the figures.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from colonnade.common.image_io import decode_srgb, encode_srgb, write_png
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.fitted_lights import fitted_lights
from colonnade.environment.light_fit import DEFAULT_LIGHTS, relit_psnr
from colonnade.environment.lights import irradiance, world_surface
from colonnade.environment.load import load_environment
from colonnade.environment.surround import wall_exposures
from colonnade.quality.image_metrics import psnr
from colonnade.reference.bounce import bounce
from colonnade.reference.environment.depth_mesh import DepthMesh
from colonnade.reference.environment.ray_march import HIDDEN, HIT, RayMarch, positions
from colonnade.reference.environment.surface import SurfaceHits
from colonnade.reference.object import PlacedObject
from colonnade.reference.render import primary_directions
from colonnade.scene.lit_room import LitRoom, lit_room, scene_room
from colonnade.scene.model import Background, Light, Material, MeshSource, Placement, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.room_lights import lights_of
from numpy.typing import NDArray

from colonnade_lab.common.markdown import markdown
from colonnade_lab.evaluation.studies.environment_accuracy import NEAR_METRES, NEAR_PIXELS

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.maps.image import AttributeImage
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.scene.view import View

MESH = "teapot"
MIRROR = Material("mirror", (0.95, 0.95, 0.95))
#: Placement of the teapot: on the table of the default scene, on the bed, on the table.
PLACEMENTS = {
    "living": Placement((322.0, 306.0), 0.58, 25.0),
    "office": Placement((170.0, 392.0), 0.40, 25.0),
    "attic": Placement((318.0, 284.0), 0.40, 25.0),
}


@dataclass(frozen=True)
class LightQuality:
    """Quality of a room's light under one choice of lights and colours; all in decibels of 8-bit sRGB.

    Attributes:
        relit: The room relit from its full maps, unshadowed, against its photo.
        relit_encoded: The same from the encoded maps.
        mirror_full: Single-bounce pixels of the float reference with full maps.
        mirror_encoded: The same with encoded albedo and normals, and the depth map as geometry.
        mirror_marched: The same with the device's planes as geometry, marched in float64.
        mirror_device: The same of the device's frame.
        right: Share of these pixels whose ray hits the right point in the device's march, within 5 pixels or 5 cm.
        mirror_right: As `mirror_device`, of those pixels alone.
        pixels: Number of these pixels.
        clamped: Share of the room's pixels that cannot get as bright as the photo; None for the albedo.
        headroom: Factor of the lights.
    """

    relit: float
    relit_encoded: float
    mirror_full: float
    mirror_encoded: float
    mirror_marched: float
    mirror_device: float
    right: float
    mirror_right: float
    pixels: int
    clamped: float | None
    headroom: float


@dataclass(frozen=True)
class FitQuality:
    """How well fitted light explains a room's photo: PSNR of the relit room without shadows, decibels.

    Attributes:
        ambient: Ambient light alone.
        lights: With lamps.
        walls: Lamps beside the light of walls; None if the fit drops the walls.
        lamps: The lamps of that fit with the best ambient light, which scenes that gather light have.
    """

    ambient: float
    lights: float
    walls: float | None
    lamps: float


def study_fits(folders: Iterable[Path]) -> dict[str, FitQuality]:
    """The quality of the lights that are fitted to rooms, by room."""
    found = {}
    for folder in folders:
        environment = load_environment(folder)
        alone, beside = (fitted_lights(environment, walls=walls) for walls in (False, True))
        assert environment.photo is not None
        walls = None
        if (surround := beside.surround) is not None:
            points, normals = (values.reshape(-1, 3) for values in world_surface(environment))
            lamps = replace(beside.lights, ambient=np.zeros(3))
            light = wall_exposures(points, normals, surround.low, surround.high) @ surround.radiance
            light += irradiance(points, normals, lamps)
            relit = environment.albedo * light.reshape(environment.albedo.shape)
            walls = psnr(environment.photo, encode_srgb(relit.clip(max=1.0)))
        found[environment.name] = FitQuality(alone.ambient_psnr, alone.psnr, walls, beside.psnr)
    return found


def study_light(
    folders: Iterable[Path], progress: Progress = QUIET, output: Path | None = None
) -> dict[str, LightQuality]:
    """The quality of rooms, by room and choice: scene defaults, fitted lights, fitted lights and the photo's colours.

    ``output`` is a folder for the device's frames.
    """
    from colonnade.mesh.load import load_mesh

    mesh, reports = load_mesh(MESH), {}
    for folder in folders:
        choices: dict[str, tuple[bool, Literal["photo", "albedo"]]] = {
            "default lights, albedo": (True, "albedo"),
            "fitted lights, albedo": (False, "albedo"),
            "fitted lights, photo": (False, "photo"),
        }
        for choice, (names_light, colours) in choices.items():
            scene = _scene(folder, names_light, colours)
            room = lit_room(Placed(scene, mesh.extent, scene_room(scene)), DEFAULT_LIGHTS, False, progress)
            assert room.environment is not None
            quality, frame = _measure(mesh, room, progress)
            reports[f"{room.environment.name}: {choice}"] = quality
            if output is not None:
                write_png(output / f"{room.environment.name}-{choice.replace(', ', '-').replace(' ', '-')}.png", frame)
    return reports


def study_both(folders: Sequence[Path], progress: Progress, output: Path | None) -> dict[str, Any]:
    """The quality of fits and of rooms, for `tables`."""
    return {"fits": study_fits(folders), "choices": study_light(folders, progress, output)}


def tables(reports: dict[str, Any]) -> str:
    """The reports of `study_both` as Markdown tables."""
    return f"{fits_table(reports['fits'])}\n\n{table(reports['choices'])}"


def fits_table(reports: dict[str, FitQuality]) -> str:
    """The reports as a Markdown table."""
    titles = ["room against its photo, dB", "ambient light", "with lamps", "beside walls", "the lamps of these alone"]
    rows = [
        [name, *("–" if value is None else f"{value:.1f}" for value in asdict(report).values())]
        for name, report in reports.items()
    ]
    return markdown(titles, rows)


def table(reports: dict[str, LightQuality]) -> str:
    """The reports as a Markdown table."""
    header = (
        "room: lights, colours",
        "relit: full, encoded, dB",
        "mirror: full maps, encoded maps, float64 march, device, dB",
        "pixels: all, right",
        "device, right pixels, dB",
        "clamped",
        "headroom",
    )
    rows = [
        (
            name,
            f"{report.relit:.1f}, {report.relit_encoded:.1f}",
            f"{report.mirror_full:.1f}, {report.mirror_encoded:.1f}, {report.mirror_marched:.1f}, "
            f"{report.mirror_device:.1f}",
            f"{report.pixels:,}, {report.right:.1%}",
            f"{report.mirror_right:.1f}",
            "-" if report.clamped is None else f"{report.clamped:.1%}",
            f"{report.headroom:.2f}",
        )
        for name, report in reports.items()
    ]
    return markdown(header, rows)


def _scene(folder: Path, names_light: bool, colours: Literal["photo", "albedo"]) -> Scene:
    return Scene(
        MeshSource(MESH),
        placement=PLACEMENTS.get(folder.resolve().name, Placement()),
        material=MIRROR,
        light=Light(shadows=False),
        background=Background(room=folder, colours=colours),
        names_light=names_light,
    )


def _measure(mesh: Mesh, room: LitRoom, progress: Progress) -> tuple[LightQuality, Floats]:
    """The quality of a lit room, and the device's frame."""
    from colonnade.design.generator import manifest_for
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.reference.environment.decoded import backdrops, float_plane_march
    from colonnade.reference.render import render_reference
    from colonnade.scene.view import make_view

    from colonnade_lab.evaluation.environment_march import DeviceMarch
    from colonnade_lab.evaluation.studies.ar_losses import device_frame

    environment = room.environment
    assert environment is not None
    layout = AttributeLayout(width=environment.width, height=environment.height)
    image = encoded_environment(environment, layout)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",), progress).manifest
    view = make_view(room.placed, environment.width, environment.height, mesh.materials)
    sources = backdrops(environment, image, float_plane_march(environment, image))
    references = [
        render_reference(mesh, view, progress, sources[name]).image for name in ("full", "clustering", "both")
    ]
    device = device_frame(mesh, view, EncodedEnvironment(environment, image), manifest)
    bounced = single_bounce(mesh, view, environment)
    mask, expected = bounced.mask, encode_srgb(bounced.colours)[None]
    mirrors = (psnr(expected, encode_srgb(frame[mask])[None]) for frame in (*references, device))
    mirror_full, mirror_encoded, mirror_marched, mirror_device = mirrors
    right = bounced.is_right(environment, DeviceMarch(environment, image, manifest))
    relit, relit_encoded = _relit(room, mesh, image)
    clamped = None if room.colours is None else room.colours.clamped
    quality = LightQuality(
        relit,
        relit_encoded,
        mirror_full,
        mirror_encoded,
        mirror_marched,
        mirror_device,
        float(right.mean()),
        psnr(expected[:, right], encode_srgb(device[mask][right])[None]),
        int(mask.sum()),
        clamped,
        room.scene.headroom,
    )
    return quality, device


@dataclass(frozen=True)
class SingleBounce:
    """The single-bounce pixels of a mirror.

    Attributes:
        mask: bool [height, width], with n pixels.
        colours: Colours of the photo at the reflected points, tinted by the mirror, linear, float64 [n, 3].
        origins, directions: The reflected rays, view space, metres, float64 [n, 3].
        hits: Their hits on the depth map, n.
    """

    mask: NDArray[np.bool_]
    colours: Floats
    origins: Floats
    directions: Floats
    hits: SurfaceHits

    def is_right(self, environment: Environment, march: RayMarch) -> NDArray[np.bool_]:
        """Whether a march hits the same points, bool [n]."""
        marched = march(self.origins, self.directions)
        near = np.hypot(marched.seen_u - self.hits.u, marched.seen_v - self.hits.v) <= NEAR_PIXELS
        near |= np.linalg.norm(positions(environment, marched) - self.hits.position, axis=1) <= NEAR_METRES
        return np.asarray(near & ((marched.kind == HIT) | (marched.kind == HIDDEN)), dtype=np.bool_)


def single_bounce(mesh: Mesh, view: View, environment: Environment) -> SingleBounce:
    """The single-bounce pixels of a mirror in a room with a photo."""
    assert environment.photo is not None and view.view_to_mesh is not None
    target, directions = PlacedObject(mesh, view), primary_directions(view, slice(0, view.height))
    origins = np.broadcast_to(view.origin, directions.shape)
    faces = target.tracer.first_hits(origins, directions)
    hit = np.flatnonzero(faces >= 0)
    points = target.points(faces[hit], origins[hit], directions[hit])
    reflected = bounce(
        unit_vectors(directions[hit]),
        points.normals,
        points.facing,
        points.front,
        np.zeros(len(hit), dtype=np.bool_),
        target.ior[faces[hit]],
    ).directions
    starts = points.position + target.tracer.offset * points.facing
    leaves = target.tracer.first_hits(starts, reflected) < 0
    to_view = np.linalg.inv(view.view_to_mesh[:, :3])
    view_origins, view_directions = (starts - view.view_to_mesh[:, 3]) @ to_view.T, unit_vectors(reflected @ to_view.T)
    seen = DepthMesh(environment).intersect(view_origins, view_directions)
    is_known = leaves & ~seen.outside
    mask = np.zeros(view.height * view.width, dtype=np.bool_)
    mask[hit[is_known]] = True
    column = np.clip(seen.u[is_known], 0, environment.width - 1).astype(np.intp)
    row = np.clip(seen.v[is_known], 0, environment.height - 1).astype(np.intp)
    tint = points.albedo[is_known]
    return SingleBounce(
        mask.reshape(view.height, view.width),
        tint * decode_srgb(environment.photo[row, column]),
        view_origins[is_known],
        view_directions[is_known],
        SurfaceHits(seen.position[is_known], seen.u[is_known], seen.v[is_known], seen.outside[is_known]),
    )


def _relit(room: LitRoom, mesh: Mesh, image: AttributeImage) -> tuple[float, float]:
    """PSNR of the room relit from full and from encoded maps, against its photo."""
    from colonnade.maps.planes import PlaneProjection

    environment = room.environment
    assert environment is not None and environment.photo is not None
    lights = lights_of(room.placed)
    scaled = replace(
        lights,
        ambient=lights.ambient * room.scene.headroom,
        lights=tuple(replace(light, colour=light.colour * room.scene.headroom) for light in lights.lights),
    )
    decoded = replace(
        environment,
        albedo=image.decoded_albedo(),
        normals=unit_vectors(image.decoded_normals()),
        depth=image.decoded_depth(PlaneProjection.of(environment, image.depth_unit)),
    )
    return relit_psnr(environment, scaled), relit_psnr(decoded, scaled)
