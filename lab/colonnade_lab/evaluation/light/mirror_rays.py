"""Where mirror rays look, against the room's geometry."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.design.generator import manifest_for
from colonnade.environment.model import Environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.reference.embree import RayTracer, Triangles
from colonnade.reference.environment.ray_march import HIDDEN, HIT

from colonnade_lab.evaluation.environment_march import DeviceMarch
from colonnade_lab.evaluation.light.rooms import KnownRoom, Thing
from colonnade_lab.evaluation.light.surfaces import RoomSurface, ThingSurface

#: A point is seen by the camera if nothing lies before it by more than this part of its depth.
_TOLERANCE = 0.01


@dataclass(frozen=True)
class MirrorErrors:
    """The angle, seen from the mirror, between what a ray should show and the point whose colour it shows.

    Attributes:
        rays: Rays that leave the mirror after one reflection, and meet what the photo shows.
        median, high: The median and the 90th percentile, degrees.
    """

    rays: int
    median: float
    high: float


def mirror_errors(
    room: KnownRoom, things: tuple[Thing, ...], surface: RoomSurface, environment: Environment
) -> dict[str, MirrorErrors]:
    """The errors of a probe at the room's place, and of the device's march through the encoded maps.

    The rays are of every second pixel of the photo that shows a mirror, without other objects.

    Args:
        room: The room.
        things: The objects of a frame.
        surface: The room's geometry.
        environment: Its maps, as Colonnade reads them.
    """
    origins, ways = _reflected(things, environment)
    to_view = environment.camera.to_world[:, :3]
    eye = environment.camera.to_world[:, 3]
    truth = surface.hits(origins, ways)[0].position
    view = (truth - eye) @ to_view
    known = _is_seen(view, environment)
    origins, ways, truth = origins[known], ways[known], truth[known]
    probe = surface.hits(np.broadcast_to(np.array(room.place), ways.shape), ways)[0].position
    layout = AttributeLayout(width=environment.width, height=environment.height)
    hardware = f"physicalAttributeMemory={json.dumps(layout.to_config())}"
    image = encoded_environment(environment, layout)
    march = DeviceMarch(environment, image, manifest_for("small", (hardware,)).manifest)
    hits = march((origins - eye) @ to_view, ways @ to_view)
    on_map = (hits.kind == HIT) | (hits.kind == HIDDEN)
    u = hits.seen_u.clip(0, environment.width - 1).astype(int)
    v = hits.seen_v.clip(0, environment.height - 1).astype(int)
    rays = environment.camera.directions(environment.width, environment.height)[v, u]
    visible = (rays * environment.depth[v, u][:, None]) @ to_view.T + eye
    # What went to a bounding plane shows no point of the photo: the end of its way, off by what the plane is
    marched = np.where(on_map[:, None], visible, origins + 1e3 * ways)
    found = {"probe": _angles(origins, truth, probe), "colonnade": _angles(origins, truth, marched)}
    found["colonnade"] = np.where(on_map, found["colonnade"], 180.0)
    return {
        kind: MirrorErrors(len(angles), float(np.median(angles)), float(np.quantile(angles, 0.9)))
        for kind, angles in found.items()
    }


def _reflected(things: tuple[Thing, ...], environment: Environment) -> tuple[Floats, Floats]:
    """Rays that leave a mirror after one reflection, world space, float64 [n, 3] each."""
    surfaces = [ThingSurface.of(thing) for thing in things if thing.kind == "mirror"]
    vertices = np.concatenate([own.vertices for own in surfaces])
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    normals = np.concatenate([own.normals for own in surfaces])[faces]
    tracer = RayTracer(Triangles(vertices, faces))
    camera = environment.camera
    ways = camera.directions(environment.width, environment.height)[::2, ::2].reshape(-1, 3) @ camera.to_world[:, :3].T
    origins = np.broadcast_to(camera.to_world[:, 3], ways.shape)
    hit_faces = tracer.first_hits(origins, ways)
    hit = np.flatnonzero(hit_faces >= 0)
    points = tracer.surface_points(hit_faces[hit], origins[hit], ways[hit])
    normal = unit_vectors(np.einsum("nk,nki->ni", points.weights, normals[hit_faces[hit]]))
    way = unit_vectors(ways[hit])
    out = way - 2 * np.einsum("ni,ni->n", way, normal)[:, None] * normal
    starts = points.position + 1e-4 * normal
    leaves = tracer.first_hits(starts, out) < 0
    return starts[leaves], out[leaves]


def _is_seen(view: Floats, environment: Environment) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether the photo shows points of view space."""
    z = np.where(view[:, 2] > 0, view[:, 2], 1.0)
    u, v = view[:, 0] / z * environment.fx + environment.cx, view[:, 1] / z * environment.fy + environment.cy
    inside = (view[:, 2] > 0) & (u >= 0) & (u < environment.width) & (v >= 0) & (v < environment.height)
    rows, columns = v.clip(0, environment.height - 1).astype(int), u.clip(0, environment.width - 1).astype(int)
    return np.asarray(inside & (view[:, 2] <= environment.depth[rows, columns] * (1 + _TOLERANCE)))


def _angles(origins: Floats, first: Floats, second: Floats) -> Floats:
    """Degrees between the ways from origins to two points."""
    one, other = unit_vectors(first - origins), unit_vectors(second - origins)
    return np.asarray(np.degrees(np.arccos(np.einsum("ni,ni->n", one, other).clip(-1, 1))))
