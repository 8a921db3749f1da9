"""Path tracing of object and background in float64, by the rules of docs/shading.md, "Materials and paths"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.environment.lights import MAX_FALLOFF
from colonnade.reference.bounce import bounce, reflect
from colonnade.reference.environment.surface import Backdrop, BackdropPoints, SurfaceHits
from colonnade.reference.object import DIFFUSE, GLASS, MIRROR, ObjectPoints, PlacedObject
from colonnade.reference.scatter import Bytes, gathered_directions, lobe_shares, microfacet_normals, sphere_points

if TYPE_CHECKING:
    from colonnade.environment.light_cube import LightCube
    from colonnade.scene.view import View

Points = TypeVar("Points", ObjectPoints, BackdropPoints)

#: A surface of the room hides a hit if it is nearer by more than this fraction of the hit's distance to the camera.
OCCLUSION_TOLERANCE = 0.005
#: The largest shadow ratio.
MAX_RATIO = 2.0
#: In place of a face: a ray hits none, or a path ends without a ray.
_MISS, _END = -1, -2


@dataclass(frozen=True)
class TracedPaths:
    """The results of primary rays.

    Attributes:
        colours: Linear colours, 0 to 1, float64 [n, 3].
        faces: First face hit, -1 for a miss, int64 [n].
        t: Distance in lengths of the ray's direction, NaN for a miss, float64 [n].
        shadow_ratio: Light on a directly visible background surface over its light without the object, float64 [n, 3].
        outside: A part of the colour comes from a background that no map covers, bool [n].
    """

    colours: Floats
    faces: Indices
    t: Floats
    shadow_ratio: Floats
    outside: NDArray[np.bool_]


@dataclass(frozen=True)
class _PathState:
    """Of all paths: throughput and radiance, float64 [n, 3]; rays gathered so far, int64 [n]."""

    weight: Floats
    radiance: Floats
    gathered: Indices


class PathTracer:
    """Traces paths through the object and its background, and counts rays by kind in `rays`."""

    def __init__(self, target: PlacedObject, view: View, backdrop: Backdrop | None) -> None:
        self._object, self._view, self._backdrop = target, view, backdrop
        self.rays = {"primary": 0, "shadow": 0, "reflection": 0, "refraction": 0, "in_box": 0}
        if view.gather is not None:
            self.rays["gather"] = 0

    def trace(self, origins: Floats, directions: Floats, pixels: Floats, words: Bytes) -> TracedPaths:
        """Trace paths from primary rays.

        Args:
            origins: Mesh space, float64 [n, 3].
            directions: Mesh space, of any length, float64 [n, 3].
            pixels: Position (u, v) of each ray in the room's maps, float64 [n, 2]; unused without a room.
            words: Sample point of each ray's pixel (`colonnade.reference.scatter.pixel_words`), uint8 [n, 2].
        """
        count = len(directions)
        self.rays["primary"] += count
        faces = self._visible_hits(self._first_hits(origins, directions), origins, directions, pixels)
        is_object = faces >= 0
        colours, t, ratio = np.empty((count, 3)), np.full(count, np.nan), np.ones((count, 3))
        outside = np.zeros(count, dtype=np.bool_)
        state = _PathState(np.ones((count, 3)), np.zeros((count, 3)), np.zeros(count, dtype=np.int64))
        missed = np.flatnonzero(~is_object)
        colours[missed] = self._view.background
        if self._backdrop is not None:
            points = self._to_mesh_space(self._seen_points(origins[missed], directions[missed], pixels[missed]))
            outside[missed] = points.outside
            known = np.flatnonzero(~points.outside)
            seen = missed[known]
            colours[seen], ratio[seen] = self._light_room(seen, _select(points, known), words, state, outside)
        path = np.flatnonzero(is_object)
        t[path] = self._object.points(faces[path], origins[path], directions[path]).t
        self._follow(path, origins[path], directions[path], faces[path], words, state, outside)
        colours[path] = state.radiance[path].clip(max=1.0)
        return TracedPaths(colours, faces, t, ratio, outside)

    def _follow(
        self,
        path: Indices,
        ray_origins: Floats,
        ray_directions: Floats,
        hit_faces: Indices,
        words: Bytes,
        state: _PathState,
        outside: NDArray[np.bool_],
    ) -> None:
        """Follow paths to their end, from the rays that hit faces of the object; updates `state` and `outside`."""
        bounces = np.zeros(len(path), dtype=np.int64)
        while len(path):
            hits = self._object.points(hit_faces, ray_origins, ray_directions)
            is_diffuse = self._object.kinds[hit_faces] == DIFFUSE
            diffuse, specular = np.flatnonzero(is_diffuse), np.flatnonzero(~is_diffuse)
            gathered = self._gathered_rays(
                path[diffuse], hit_faces[diffuse], _select(hits, diffuse), ray_directions[diffuse], words, state
            )
            reflected = self._next_rays(
                path[specular],
                hit_faces[specular],
                _select(hits, specular),
                unit_vectors(ray_directions[specular]),
                words,
                state,
                outside,
                bounces[specular],
            )
            path, bounces = (
                np.concatenate([path[diffuse], path[specular]]),
                np.concatenate([bounces[diffuse], bounces[specular] + 1]),
            )
            ray_origins, ray_directions, hit_faces = (
                np.concatenate(both) for both in zip(gathered, reflected, strict=True)
            )
            left = np.flatnonzero(hit_faces == _MISS)
            has_gathered = state.gathered[path[left]] > 0
            scattered, leaving = left[has_gathered], left[~has_gathered]
            if len(scattered):
                cube = self._cube()
                assert cube is not None
                state.radiance[path[scattered]] += state.weight[path[scattered]] * cube.radiance(
                    ray_directions[scattered], ray_origins[scattered]
                )
            colour, is_outside = self._trace_background(ray_origins[leaving], ray_directions[leaving], shadows=True)
            state.radiance[path[leaving]] += state.weight[path[leaving]] * colour
            outside[path[leaving]] |= is_outside
            active = np.flatnonzero(hit_faces >= 0)
            path, hit_faces, bounces = path[active], hit_faces[active], bounces[active]
            ray_origins, ray_directions = ray_origins[active], ray_directions[active]

    def _light_room(
        self, path: Indices, points: BackdropPoints, words: Bytes, state: _PathState, outside: NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """Colours and shadow ratios of surfaces of the room in direct view, float64 [n, 3] each.

        Where the ray that gathers light there meets the object, what it brings replaces the ambient light.
        """
        origins, (visible, everything) = self._background_light(points, self._view.shadows)
        if self._view.gather is not None:
            directions, faces = self._scattered(
                path, origins, points.normals, points.normals, np.zeros(len(path)), words, state
            )
            hit = np.flatnonzero(faces >= 0)
            self._follow(path[hit], origins[hit], directions[hit], faces[hit], words, state, outside)
            visible[hit] += state.radiance[path[hit]].clip(max=1.0) - self._view.ambient
        ratio = np.divide(visible, everything, out=np.where(visible > 0, np.inf, 1.0), where=everything > 0)
        return np.asarray((points.albedo * visible).clip(max=1.0)), ratio.clip(max=MAX_RATIO)

    def _cube(self) -> LightCube | None:
        """The light where no surface is known, in a frame that gathers."""
        return None if self._view.gather is None else self._view.gather.cube

    def _gathered_rays(
        self, path: Indices, faces: Indices, points: ObjectPoints, rays: Floats, words: Bytes, state: _PathState
    ) -> tuple[Floats, Floats, Indices]:
        """Add the light of diffuse surfaces and rough metal; origins, directions and first faces of gathered rays.

        The face is `_END` where there is none.

        Args:
            path: Index of each path, int64 [n].
            faces: That the paths have hit, int64 [n].
            points: Of the hits.
            rays: Directions in which the paths came, of any length, float64 [n, 3].
            words: As in `trace`.
            state: Of all paths; changed.
        """
        gather = self._view.gather
        goes_on = np.zeros(len(path), dtype=np.bool_) if gather is None else state.gathered[path] < gather.bounces
        alpha = np.where(goes_on | (gather is None), self._object.alpha[faces], 0.0)
        axes = np.where((alpha > 0)[:, None], reflect(points.normals, unit_vectors(rays)), points.normals)
        # Shadow rays start slightly above the visible side of the surface.
        origins = points.position + self._object.tracer.offset * points.facing
        irradiance, _ = self._irradiance(origins, axes, self._view.shadows, alpha)
        irradiance -= goes_on[:, None] * self._view.ambient
        state.radiance[path] += state.weight[path] * (points.albedo * irradiance + points.emission).clip(max=1.0)
        directions, hit_faces = np.zeros_like(origins), np.full(len(path), _END, dtype=np.int64)
        rows = np.flatnonzero(goes_on)
        if len(rows):
            directions[rows], hit_faces[rows] = self._scattered(
                path[rows], origins[rows], axes[rows], points.facing[rows], alpha[rows], words, state
            )
            state.weight[path[rows]] *= points.albedo[rows]
        return origins, directions, hit_faces

    def _scattered(
        self,
        path: Indices,
        origins: Floats,
        axes: Floats,
        facing: Floats,
        alpha: Floats,
        words: Bytes,
        state: _PathState,
    ) -> tuple[Floats, Indices]:
        """Directions and first faces (`_MISS`: none) of the rays that gather light at surfaces; counts them.

        Axes, geometric normals and widths of lobes as for `gathered_directions`.
        """
        assert self._view.gather is not None
        drawn = np.array(self._view.gather.points, np.uint8)[state.gathered[path]]
        directions = gathered_directions(axes, facing, sphere_points(words[path] ^ drawn), alpha)
        state.gathered[path] += 1
        self.rays["gather"] += len(path)
        return directions, self._first_hits(origins, directions)

    def _next_rays(
        self,
        path: Indices,
        faces: Indices,
        points: ObjectPoints,
        directions: Floats,
        words: Bytes,
        state: _PathState,
        outside: NDArray[np.bool_],
        bounces_done: Indices,
    ) -> tuple[Floats, Floats, Indices]:
        """Origins, directions and first faces (`_MISS`: none) of the rays that leave mirrors and glass.

        Updates `state` and `outside` of the paths. Fresnel reflections at glass see only the background.
        """
        kinds, alpha = self._object.kinds[faces], self._object.alpha[faces]
        is_tinted, normals = (kinds == MIRROR) | points.front, points.normals.copy()
        rough = np.flatnonzero(alpha > 0)
        if self._view.gather is not None and len(rough):
            # Other sample points than the rays' that are gathered next
            number = state.gathered[path[rough]] & 3 ^ np.where(points.front[rough], 3, 2)
            drawn = sphere_points(words[path[rough]] ^ np.array(self._view.gather.points, np.uint8)[number])
            normals[rough] = microfacet_normals(normals[rough], directions[rough], drawn, alpha[rough])
        scattered = bounce(directions, normals, points.facing, points.front, kinds == GLASS, self._object.ior[faces])
        state.weight[path] *= np.where(is_tinted[:, None], points.albedo, 1.0)
        offset = self._object.tracer.offset * points.facing
        split = np.flatnonzero((scattered.fresnel_weights > 0) & (state.gathered[path] == 0))
        if len(split):
            origins = points.position[split] + offset[split]
            colour, is_outside = self._trace_background(origins, scattered.fresnel_directions[split], shadows=False)
            fresnel = state.weight[path[split]] * scattered.fresnel_weights[split, None]
            state.radiance[path[split]] += fresnel * colour
            state.weight[path[split]] -= fresnel
            outside[path[split]] |= is_outside
        origins = points.position + np.where(scattered.refracted[:, None], -offset, offset)
        hit_faces = np.full(len(path), _MISS, dtype=np.int64)
        going = np.flatnonzero(bounces_done < self._view.bounces)
        refracted = scattered.refracted[going]
        self.rays["refraction"] += int(np.count_nonzero(refracted))
        self.rays["reflection"] += int(np.count_nonzero(~refracted))
        faces = self._first_hits(origins[going], scattered.directions[going])
        may_be_hidden = np.flatnonzero((refracted != is_tinted[going]) & (state.gathered[path[going]] == 0))
        outer = going[may_be_hidden]
        faces[may_be_hidden] = self._visible_hits(faces[may_be_hidden], origins[outer], scattered.directions[outer])
        hit_faces[going] = faces
        return origins, scattered.directions, hit_faces

    def _visible_hits(
        self, faces: Indices, origins: Floats, directions: Floats, pixels: Floats | None = None
    ) -> Indices:
        """First faces that rays hit, -1 also for hits that the room hides; `pixels` as in `trace`, of primary rays."""
        hit = np.flatnonzero(faces >= 0)
        if self._backdrop is None or not self._view.occlusion or len(hit) == 0:
            return faces
        position = self._object.points(faces[hit], origins[hit], directions[hit]).position
        matrix, shift = self._mesh_to_view()
        starts = origins[hit] @ matrix.T + shift
        surface: SurfaceHits | BackdropPoints
        if pixels is None:
            surface = self._backdrop.geometry.intersect(starts, unit_vectors(directions[hit] @ matrix.T))
        else:
            surface = self._seen_points(origins[hit], directions[hit], pixels[hit])
        # In metres: along the ray to the object and to the room, and the tolerance at the object
        ends = position @ matrix.T + shift
        to_object, to_room = (np.linalg.norm(points - starts, axis=1) for points in (ends, surface.position))
        tolerance = OCCLUSION_TOLERANCE * np.linalg.norm(ends, axis=1)
        is_hidden = ~surface.outside & (to_room + tolerance < to_object)
        if pixels is None:
            is_hidden &= to_room > tolerance
        visible = faces.copy()
        visible[hit[is_hidden]] = -1
        return visible

    def _seen_points(self, origins: Floats, directions: Floats, pixels: Floats) -> BackdropPoints:
        """Points of the room that primary rays see, view space; arguments as in `trace`."""
        assert self._backdrop is not None
        if self._view.is_map_camera:
            return self._backdrop.visible_points(*pixels.T)
        matrix, shift = self._mesh_to_view()
        return self._backdrop.seen_points(origins @ matrix.T + shift, directions @ matrix.T)

    def _first_hits(self, origins: Floats, directions: Floats) -> Indices:
        self.rays["in_box"] += int(np.count_nonzero(self._object.tracer.enters_box(origins, directions)[0]))
        return self._object.tracer.first_hits(origins, directions)

    def _background_light(self, points: BackdropPoints, shadows: bool) -> tuple[Floats, tuple[Floats, Floats]]:
        """Origins of rays from background surfaces, and `_irradiance` there."""
        origins = points.position + self._object.tracer.offset * points.normals
        return origins, self._irradiance(origins, points.normals, shadows and self._view.shadows)

    def _trace_background(self, origins: Floats, directions: Floats, shadows: bool) -> tuple[Floats, NDArray[np.bool_]]:
        """Colours of rays of paths that have gathered nothing, and miss the object, float64 [n, 3].

        Also whether nothing tells what they hit, bool [n].
        """
        cube, nowhere = self._cube(), np.zeros(len(origins), dtype=np.bool_)
        colours = np.tile(self._view.background, (len(origins), 1))
        if cube is not None:
            colours = cube.radiance(directions, origins, ~nowhere)
        if self._backdrop is None or len(origins) == 0:
            return colours, nowhere
        matrix, shift = self._mesh_to_view()
        view_directions = unit_vectors(directions @ matrix.T)
        points = self._to_mesh_space(self._backdrop.intersect(origins @ matrix.T + shift, view_directions))
        known = np.flatnonzero(~points.outside)
        surfaces = _select(points, known)
        _, (light, _) = self._background_light(surfaces, shadows)
        colours[known] = (surfaces.albedo * light).clip(max=1.0)
        return colours, points.outside if cube is None else nowhere

    def _irradiance(
        self, origins: Floats, axes: Floats, shadows: bool, alpha: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Irradiance of surfaces with and without the object's shadow, float64 [n, 3] each.

        Args:
            origins: Of shadow rays, float64 [n, 3].
            axes: Unit normals; for rough metal the directions in which a smooth mirror reflects, float64 [n, 3].
            shadows: Trace shadow rays.
            alpha: Of rough metal the square of its roughness, else 0, float64 [n]; None: of none.
        """
        alpha = np.zeros(len(origins)) if alpha is None else alpha
        is_rough = alpha > 0
        shadowed = np.tile(self._view.ambient, (len(origins), 1))
        unshadowed = shadowed.copy()
        for light in self._view.lights:
            to_light = light.position - origins
            cosine = np.einsum("ni,ni->n", axes, unit_vectors(to_light)).clip(min=0.0)
            transmittance = np.ones(len(origins))
            if shadows:
                lit = np.flatnonzero(cosine > 0)
                self.rays["shadow"] += len(lit)
                enters, _ = self._object.tracer.enters_box(origins[lit], to_light[lit], t_max=1.0)
                self.rays["in_box"] += int(np.count_nonzero(enters))
                transmittance[lit] = self._object.light_transmittance(origins[lit], to_light[lit])
            if is_rough.any():
                cosine = np.where(is_rough, lobe_shares(cosine, alpha), cosine)
            if light.reach is not None:
                squared = np.einsum("ni,ni->n", to_light, to_light)
                falloff = np.divide(light.reach**2, squared, out=np.full(len(squared), MAX_FALLOFF), where=squared > 0)
                cosine = cosine * falloff.clip(max=MAX_FALLOFF)
            unshadowed += light.colour * cosine[:, None]
            shadowed += light.colour * (cosine * transmittance)[:, None]
        return np.asarray(shadowed), np.asarray(unshadowed)

    def _mesh_to_view(self) -> tuple[Floats, Floats]:
        """The transform from mesh space to the room's view space: matrix float64 [3, 3] and shift [3]."""
        assert self._view.view_to_mesh is not None
        matrix = np.linalg.inv(self._view.view_to_mesh[:, :3])
        shift = -matrix @ self._view.view_to_mesh[:, 3]
        return np.asarray(matrix, dtype=np.float64), np.asarray(shift, dtype=np.float64)

    def _to_mesh_space(self, points: BackdropPoints) -> BackdropPoints:
        """Transform background points from view space to mesh space."""
        assert self._view.view_to_mesh is not None
        matrix, shift = self._view.view_to_mesh[:, :3], self._view.view_to_mesh[:, 3]
        position, normals = points.position @ matrix.T + shift, unit_vectors(points.normals @ matrix.T)
        return type(points)(position, normals, points.albedo, points.outside)


def _select(points: Points, rows: NDArray[np.bool_] | Indices) -> Points:
    """Select some of the points, by mask or index."""
    return type(points)(**{name: value[rows] for name, value in vars(points).items()})
