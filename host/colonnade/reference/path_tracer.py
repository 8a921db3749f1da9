"""Paths of rays through object and room in 64 bits, by the rules of docs/shading.md, "Materials and paths"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.reference.bounce import bounce
from colonnade.reference.environment.surface import Backdrop, BackdropPoints
from colonnade.reference.object import DIFFUSE, GLASS, MIRROR, ObjectPoints, PlacedObject

if TYPE_CHECKING:
    from colonnade.scene.view import View

Points = TypeVar("Points", ObjectPoints, BackdropPoints)

#: Nearer to a light than half its reach it gets no brighter.
BRIGHTEST = 4.0


@dataclass(frozen=True)
class Traced:
    """What primary rays bring back.

    Attributes:
        colours: float64 [n, 3], linear, 0 to 1.
        faces: First face met, int64 [n], -1 for none.
        t: float64 [n], in lengths of the direction; not a number where the ray misses.
        shadow_ratio: float64 [n, 3]: of a background that is seen directly, its light over that without the object.
        outside: bool [n]: a part of the colour is of a background that nothing is known of.
    """

    colours: Floats
    faces: Indices
    t: Floats
    shadow_ratio: Floats
    outside: NDArray[np.bool_]


class PathTracer:
    """Traces paths; counts rays by kind."""

    def __init__(self, target: PlacedObject, view: View, backdrop: Backdrop | None) -> None:
        self._object, self._view, self._backdrop = target, view, backdrop
        self.rays = {"primary": 0, "shadow": 0, "reflection": 0, "refraction": 0, "in_box": 0}

    def trace(self, origins: Floats, directions: Floats, pixels: Floats) -> Traced:
        """Trace paths from primary rays, float64 [n, 3] each.

        Args:
            origins: Mesh space, as the directions.
            directions: Of any length.
            pixels: Where in the room's maps each looks, (u, v), float64 [n, 2]; not used without a room.
        """
        count = len(directions)
        self.rays["primary"] += count
        faces = self._first_hits(origins, directions)
        seen = faces >= 0
        colours, t, ratio = np.empty((count, 3)), np.full(count, np.nan), np.ones((count, 3))
        outside = np.zeros(count, dtype=np.bool_)
        missed = np.flatnonzero(~seen)
        if self._backdrop is None:
            colours[missed] = self._view.background
        else:
            points = self._in_mesh(self._backdrop.seen(*pixels[missed].T))
            colours[missed], ratio[missed] = self._lit_background(points)

        # The paths under way: where their rays meet the object, what weight is left, what they have gathered.
        path = np.flatnonzero(seen)
        ray_origins, ray_directions, met = origins[path], directions[path], faces[path]
        weight, gathered = np.ones((count, 3)), np.zeros((count, 3))
        for bounced in range(self._view.bounces + 1):
            points_met = self._object.points(met, ray_origins, ray_directions)
            if bounced == 0:
                t[path] = points_met.t
            ends = self._object.kinds[met] == DIFFUSE
            colours[path[ends]] = self._lit_object(_select(points_met, ends), met[ends])
            on = np.flatnonzero(~ends)
            path, met, points_met = path[on], met[on], _select(points_met, on)
            if len(path) == 0:
                break
            ray_origins, ray_directions, met = self._go_on(
                path, met, points_met, unit_vectors(ray_directions[on]), weight, gathered, outside, bounced
            )
            lost = np.flatnonzero(met < 0)
            colours[path[lost]], outside_now = self._background(ray_origins[lost], ray_directions[lost], shadows=True)
            outside[path[lost]] |= outside_now
            still = np.flatnonzero(met >= 0)
            path, met, ray_origins, ray_directions = path[still], met[still], ray_origins[still], ray_directions[still]
        return Traced((gathered + weight * colours).clip(max=1.0), faces, t, ratio, outside)

    def _go_on(
        self,
        path: Indices,
        met: Indices,
        points: ObjectPoints,
        directions: Floats,
        weight: Floats,
        gathered: Floats,
        outside: NDArray[np.bool_],
        bounced: int,
    ) -> tuple[Floats, Floats, Indices]:
        """Origins and directions of the rays after a mirror or glass, and what faces they meet: -1 for none."""
        kinds = self._object.kinds[met]
        next_ = bounce(directions, points.normals, points.facing, points.front, kinds == GLASS, self._object.ior[met])
        tinted = (kinds == MIRROR) | points.front
        weight[path] *= np.where(tinted[:, None], self._object.albedo[met], 1.0)
        off = self._view.shadow_offset * points.facing
        parted = np.flatnonzero(next_.shares > 0)
        if len(parted):
            origins = points.position[parted] + off[parted]
            colour, lost = self._background(origins, next_.reflections[parted], shadows=False)
            share = weight[path[parted]] * next_.shares[parted, None]
            gathered[path[parted]] += share * colour
            weight[path[parted]] -= share
            outside[path[parted]] |= lost
        origins = points.position + np.where(next_.refracted[:, None], -off, off)
        if bounced == self._view.bounces:
            return origins, next_.directions, np.full(len(path), -1, dtype=np.int64)
        self.rays["refraction"] += int(np.count_nonzero(next_.refracted))
        self.rays["reflection"] += int(np.count_nonzero(~next_.refracted))
        return origins, next_.directions, self._first_hits(origins, next_.directions)

    def _first_hits(self, origins: Floats, directions: Floats) -> Indices:
        self.rays["in_box"] += int(np.count_nonzero(self._object.tracer.enters_box(origins, directions)[0]))
        return self._object.tracer.first_hits(origins, directions)

    def _lit_object(self, points: ObjectPoints, faces: Indices) -> Floats:
        """Colours of diffuse surfaces, float64 [n, 3]."""
        # The shadow ray leaves from a little above the surface, on the side that is seen.
        origins = points.position + self._view.shadow_offset * points.facing
        incoming, _ = self._incoming(origins, points.normals, self._view.shadows)
        return np.asarray((self._object.albedo[faces] * incoming).clip(max=1.0), dtype=np.float64)

    def _lit_background(self, points: BackdropPoints, shadows: bool = True) -> tuple[Floats, Floats]:
        """Colours of background surfaces and their shadow ratios, float64 [n, 3] each."""
        origins = points.position + self._view.shadow_offset * points.normals
        visible, everything = self._incoming(origins, points.normals, shadows and self._view.shadows)
        ratio = np.divide(visible, everything, out=np.ones_like(visible), where=everything > 0)
        return np.asarray((points.albedo * visible).clip(max=1.0)), np.asarray(ratio, dtype=np.float64)

    def _background(self, origins: Floats, directions: Floats, shadows: bool) -> tuple[Floats, NDArray[np.bool_]]:
        """Colours of what rays meet that meet no object, float64 [n, 3], and where nothing is known of it."""
        colours = np.tile(self._view.background, (len(origins), 1))
        if self._backdrop is None or len(origins) == 0:
            return colours, np.zeros(len(origins), dtype=np.bool_)
        turn, shift = self._to_view()
        met = self._in_mesh(self._backdrop.meet(origins @ turn.T + shift, unit_vectors(directions @ turn.T)))
        known = np.flatnonzero(~met.outside)
        colours[known], _ = self._lit_background(_select(met, known), shadows)
        return colours, met.outside

    def _incoming(self, origins: Floats, normals: Floats, shadows: bool) -> tuple[Floats, Floats]:
        """Light that falls onto surfaces, and what would without the object; float64 [n, 3] each."""
        visible = np.tile(self._view.ambient, (len(origins), 1))
        everything = visible.copy()
        for light in self._view.lights:
            to_light = light.position - origins
            cosine = np.einsum("ni,ni->n", normals, unit_vectors(to_light)).clip(min=0.0)
            share = np.ones(len(origins))
            if shadows:
                asking = np.flatnonzero(cosine > 0)
                self.rays["shadow"] += len(asking)
                enters, _ = self._object.tracer.enters_box(origins[asking], to_light[asking], limit=1.0)
                self.rays["in_box"] += int(np.count_nonzero(enters))
                share[asking] = self._object.let_through(origins[asking], to_light[asking])
            if light.reach is not None:
                squared = np.einsum("ni,ni->n", to_light, to_light)
                falloff = np.divide(light.reach**2, squared, out=np.full(len(squared), BRIGHTEST), where=squared > 0)
                cosine = cosine * falloff.clip(max=BRIGHTEST)
            everything += light.colour * cosine[:, None]
            visible += light.colour * (cosine * share)[:, None]
        return np.asarray(visible), np.asarray(everything)

    def _to_view(self) -> tuple[Floats, Floats]:
        """Mesh space to the room's view space: matrix float64 [3, 3] and shift [3]."""
        assert self._view.view_to_mesh is not None
        turn = np.linalg.inv(self._view.view_to_mesh[:, :3])
        return np.asarray(turn, dtype=np.float64), np.asarray(-turn @ self._view.view_to_mesh[:, 3], dtype=np.float64)

    def _in_mesh(self, points: BackdropPoints) -> BackdropPoints:
        """Points of view space in mesh space."""
        assert self._view.view_to_mesh is not None
        turn, shift = self._view.view_to_mesh[:, :3], self._view.view_to_mesh[:, 3]
        position, normals = points.position @ turn.T + shift, unit_vectors(points.normals @ turn.T)
        return type(points)(position, normals, points.albedo, points.outside)


def _select(points: Points, rows: NDArray[np.bool_] | Indices) -> Points:
    """Some of the points."""
    return type(points)(**{name: value[rows] for name, value in vars(points).items()})
