"""Frames as phones make them: a rasterised object under a light probe, with shadow maps and blobs under it.

- Diffuse light of the probe is nine spherical harmonics (Ramamoorthi and Hanrahan 2001); reflections are the probe,
  filtered by the roughness, times the approximate split sum of mobile engines (Karis 2014).
- The lights are known. They have GGX highlights and shadow maps of 256x256 texels with percentage-closer filtering of
  7x7 taps, as far apart as the light is large.
- A contact blob is the ambient light that the object's sphere hides.
- Glass refracts once and shows the photo where the ray leaves a body as thick as the object is wide, as three.js does;
  rough glass blurs it as three.js does, and reflects the lamps in the probe.
- Depth hides the object. Four samples a pixel.

Embree finds what a rasteriser would: the first surface of each sample, and of each texel of a shadow map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from colonnade.common.image_io import decode_srgb
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.model import Environment
from colonnade.reference.embree import RayTracer, Triangles
from numpy.typing import NDArray
from scipy import ndimage

from colonnade_lab.evaluation.light.rooms import FRAME, GLASSES, METALS, PointLight, Thing
from colonnade_lab.evaluation.light.surfaces import ThingSurface

#: Samples of a pixel on each axis.
_SAMPLES = 2
#: Texels of a shadow map on each axis, and taps of its filter to each side.
_TEXELS, _FILTER = 256, 3
#: Depth that a surface may lie behind its own shadow map, of the distance.
_BIAS = 0.01
#: Reflectance of a dielectric that faces the eye.
_F0 = 0.04
_IOR = 1.5
#: Directions at a time, for the filter of the probe.
_BATCH = 512
#: A surface hides the object if it is nearer by this part of the distance.
_TOLERANCE = 0.01


@dataclass(frozen=True)
class Probe:
    """Radiance around a place by direction, equirectangular, float64 [height, width, 3] (see `files`)."""

    radiance: Floats

    def _directions(self) -> tuple[Floats, Floats]:
        """Directions of the texels, float64 [n, 3], and their solid angles, [n]."""
        rows, columns = self.radiance.shape[:2]
        polar = (np.arange(rows)[:, None] + 0.5) / rows * np.pi
        angle = ((np.arange(columns)[None] + 0.5) / columns - 0.5) * 2 * np.pi
        level = np.sin(polar)
        up = np.broadcast_to(np.cos(polar), (rows, columns))
        ways = np.stack([level * np.sin(angle), up, -level * np.cos(angle)], axis=2).reshape(-1, 3)
        return ways, np.broadcast_to(level * (2 * np.pi**2 / rows / columns), (rows, columns)).ravel()

    def harmonics(self) -> Floats:
        """Light on a surface over pi by nine harmonics of its normal, float64 [9, 3]."""
        ways, angles = self._directions()
        light = self.radiance.reshape(-1, 3) * angles[:, None]
        return np.asarray((_basis(ways).T @ light) * np.array([1.0, *[2 / 3] * 3, *[1 / 4] * 5])[:, None])

    def at(self, ways: Floats) -> Floats:
        """Radiance from directions, float64 [n, 3] each, between four texels."""
        rows, columns = self.radiance.shape[:2]
        unit = unit_vectors(ways)
        row = np.arccos(unit[:, 1].clip(-1, 1)) / np.pi * rows - 0.5
        column = (np.arctan2(unit[:, 0], -unit[:, 2]) / (2 * np.pi) + 0.5) * columns - 0.5
        low, left = np.floor(row).astype(int), np.floor(column).astype(int)
        total = np.zeros((len(ways), 3))
        for down in (0, 1):
            for across in (0, 1):
                weight = np.abs(1 - down - (row - low)) * np.abs(1 - across - (column - left))
                texel = self.radiance[(low + down).clip(0, rows - 1), (left + across) % columns]
                total += weight[:, None] * texel
        return total

    def filtered(self, ways: Floats, roughness: float) -> Floats:
        """Radiance from unit directions through the lobe of a roughness, seen along it, float64 [n, 3] each."""
        if roughness < 0.05:
            return self.at(ways)
        texels, angles = self._directions()
        light = self.radiance.reshape(-1, 3)
        squared = roughness**4
        found = []
        for start in range(0, len(ways), _BATCH):
            cosine = ways[start : start + _BATCH] @ texels.T
            half = (1 + cosine) / 2  # The squared cosine to the half vector
            weight = cosine.clip(min=0.0) * angles / (half * (squared - 1) + 1) ** 2
            found.append(weight @ light / weight.sum(axis=1, keepdims=True))
        return np.concatenate(found) if found else np.zeros((0, 3))


def _basis(n: Floats) -> Floats:
    x, y, z = n.T
    return np.stack(
        [
            np.full(len(n), 0.282095),
            *(0.488603 * axis for axis in (y, z, x)),
            *(1.092548 * pair for pair in (x * y, y * z, x * z)),
            0.315392 * (3 * z**2 - 1),
            0.546274 * (x**2 - y**2),
        ],
        axis=1,
    )


class ProbeFrame:
    """The frame of some objects in a room."""

    def __init__(
        self,
        lights: Sequence[PointLight],
        things: tuple[Thing, ...],
        environment: Environment,
        around: Floats,
        panorama: Floats,
        size: tuple[int, int] = FRAME,
    ) -> None:
        """Prepare a frame.

        Args:
            lights: What stands for the emitters of the room.
            things: The objects.
            environment: Its photo and maps.
            around: What the probe sees without the lights, equirectangular, float64 [height, width, 3].
            panorama: The same with them, for mirrors and glass.
            size: Width and height of the frame, pixels.
        """
        self._size = size
        self._things, self._environment = things, environment
        surfaces = [ThingSurface.of(thing) for thing in things]
        counts = [len(surface.faces) for surface in surfaces]
        self._owner = np.repeat(np.arange(len(things)), counts)
        vertices = np.concatenate([surface.vertices for surface in surfaces])
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        self._normals = np.concatenate([surface.normals for surface in surfaces])[faces]
        self._tracer = RayTracer(Triangles(vertices, faces))
        self._around, self._panorama = Probe(around), Probe(panorama)
        self._harmonics = self._around.harmonics()
        self._lights = list(lights)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self._middle, self._radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        self._shadow_maps = [self._shadow_map(position) for position, _, _ in self._lights]
        self._blobs = [
            ((own.min(axis=0) + own.max(axis=0)) / 2, float(np.ptp(own, axis=0).max()) / 2)
            for own in (surface.vertices for surface in surfaces)
        ]

    def render(self) -> tuple[Floats, NDArray[np.int64]]:
        """The frame, linear, float64 [height, width, 3], and each pixel's object in its middle, or -1."""
        width, height = self._size
        total = np.zeros((height, width, 3))
        steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
        for down in steps:
            for across in steps:
                total += self._sample(float(across), float(down))[0]
        return total / _SAMPLES**2, self.owners()

    def owners(self) -> NDArray[np.int64]:
        """Each pixel's object in its middle, or -1, int64 [height, width]."""
        return self._sample(0.0, 0.0, owners_only=True)[1]

    def _sample(self, across: float, down: float, owners_only: bool = False) -> tuple[Floats, NDArray[np.int64]]:
        width, height = self._size
        environment, camera = self._environment, self._environment.camera
        rotation, eye = camera.to_world[:, :3], camera.to_world[:, 3]
        u = (np.arange(width) + 0.5 + across) * environment.width / width
        v = (np.arange(height) + 0.5 + down) * environment.height / height
        way = np.ones((height, width, 3))
        way[..., 0], way[..., 1] = (u - camera.cx) / camera.fx, ((v - camera.cy) / camera.fy)[:, None]
        way = way.reshape(-1, 3) @ rotation.T
        columns, rows = np.meshgrid(u.astype(int), v.astype(int))
        depth, normals = environment.depth[rows, columns].ravel(), environment.normals[rows, columns].reshape(-1, 3)
        origins = np.broadcast_to(eye, way.shape)
        faces = self._tracer.first_hits(origins, way)
        hit = np.flatnonzero(faces >= 0)
        points = self._tracer.surface_points(faces[hit], origins[hit], way[hit])
        seen = points.t < depth[hit] * (1 + _TOLERANCE)
        hit = hit[seen]
        owners = np.full(len(way), -1)
        owners[hit] = self._owner[faces[hit]]
        if owners_only:
            return np.zeros(0), owners.reshape(height, width)
        photo = decode_srgb(environment.photo)[rows, columns].reshape(-1, 3) if environment.photo is not None else way
        colour = photo * self._shadow_ratio(eye + depth[:, None] * way, normals @ rotation.T)
        normal = unit_vectors(np.einsum("nk,nki->ni", points.weights[seen], self._normals[faces[hit]]))
        for index, thing in enumerate(self._things):
            mine = owners[hit] == index
            colour[hit[mine]] = self._shade(
                thing, points.position[seen][mine], normal[mine], unit_vectors(way[hit[mine]])
            )
        return colour.reshape(height, width, 3), owners.reshape(height, width)

    def _shade(self, thing: Thing, position: Floats, normal: Floats, way: Floats) -> Floats:
        """Light from an object's points towards the eye, all float64 [n, 3]."""
        facing = np.einsum("ni,ni->n", normal, -way).clip(1e-3, 1.0)
        reflected = way + 2 * facing[:, None] * normal
        metal = thing.kind in METALS
        base = np.array(thing.colour)
        f0 = base if metal else np.full(3, 0.0 if thing.kind == "matt" else _F0)
        smooth = thing.roughness < 0.05
        has_lamps = smooth or thing.kind in GLASSES  # Otherwise they have highlights
        specular = (self._panorama if has_lamps else self._around).filtered(reflected, thing.roughness)
        light = specular * _split_sum(f0, thing.roughness, facing)
        if thing.kind in GLASSES:
            fresnel = f0 + (1 - f0) * (1 - facing[:, None]) ** 5
            behind = self._behind(thing, position, normal, way)
            return np.asarray(specular * fresnel + base * (1 - fresnel) * behind)
        albedo = base * (not metal)
        light += albedo * (_basis(normal) @ self._harmonics).clip(min=0.0)
        if smooth:
            return light
        for (at, power, radius), shadows in zip(self._lights, self._shadow_maps, strict=True):
            towards = at - position
            squared = np.einsum("ni,ni->n", towards, towards)
            to_light = towards / np.sqrt(squared)[:, None]
            cosine = np.einsum("ni,ni->n", normal, to_light).clip(min=0.0)
            reaching = power * (cosine / squared * self._lit(shadows, at, radius, position))[:, None]
            light += reaching * (albedo + _highlight(f0, thing.roughness, normal, to_light, -way, facing))
        return light

    def _behind(self, thing: Thing, position: Floats, normal: Floats, way: Floats) -> Floats:
        """The photo where a ray that is refracted once leaves the object, blurred by the roughness."""
        cosine, ratio = np.einsum("ni,ni->n", normal, -way), 1 / _IOR
        inner = np.sqrt(1 - ratio**2 * (1 - cosine**2).clip(min=0.0))
        out = position + thing.size * (ratio * way + (ratio * cosine - inner)[:, None] * normal)
        environment, camera = self._environment, self._environment.camera
        view = (out - camera.to_world[:, 3]) @ camera.to_world[:, :3]
        u = (view[:, 0] / view[:, 2] * camera.fx + camera.cx).clip(0, environment.width - 1).astype(int)
        v = (view[:, 1] / view[:, 2] * camera.fy + camera.cy).clip(0, environment.height - 1).astype(int)
        assert environment.photo is not None
        width = round(2 ** (np.log2(environment.width) * thing.roughness))
        return np.asarray(ndimage.uniform_filter(decode_srgb(environment.photo), (width, width, 1))[v, u])

    def _shadow_ratio(self, position: Floats, normal: Floats) -> Floats:
        """Light on the room with the objects over light without them, float64 [n, 3]."""
        ambient = (_basis(normal) @ self._harmonics).clip(min=1e-3)
        left = np.ones(len(position))
        for centre, radius in self._blobs:
            towards = centre - position
            squared = np.einsum("ni,ni->n", towards, towards).clip(min=radius**2)
            cosine = np.einsum("ni,ni->n", towards, normal) / np.sqrt(squared)
            left *= 1 - (radius**2 / squared) * cosine.clip(0.0, 1.0)
        whole, shadowed = ambient.copy(), ambient * left[:, None]
        for (at, power, radius), shadows in zip(self._lights, self._shadow_maps, strict=True):
            towards = at - position
            squared = np.einsum("ni,ni->n", towards, towards)
            cosine = (np.einsum("ni,ni->n", towards, normal) / np.sqrt(squared)).clip(min=0.0)
            light = power * (cosine / squared)[:, None]
            whole += light
            shadowed += light * self._lit(shadows, at, radius, position)[:, None]
        return np.asarray(shadowed / whole)

    def _shadow_map(self, light: Floats) -> Floats:
        """Distances from a light to the objects, float64 [texels, texels]; infinite beside them."""
        grid = ((np.arange(_TEXELS) + 0.5) / _TEXELS * 2 - 1) * self._half_width(light)
        right, up, forward = self._axes(light)
        ways = (forward + grid[None, :, None] * right + grid[:, None, None] * up).reshape(-1, 3)
        origins = np.broadcast_to(light, ways.shape)
        faces = self._tracer.first_hits(origins, ways)
        hit = np.flatnonzero(faces >= 0)
        found = np.full(len(ways), np.inf)
        found[hit] = self._tracer.surface_points(faces[hit], origins[hit], ways[hit]).t
        return found.reshape(_TEXELS, _TEXELS)

    def _half_width(self, light: Floats) -> float:
        distance = float(np.linalg.norm(self._middle - light))
        return float(self._radius / np.sqrt(max(distance**2 - self._radius**2, 1e-6)) * 1.1)

    def _axes(self, light: Floats) -> tuple[Floats, Floats, Floats]:
        forward = unit_vectors((self._middle - light)[None])[0]
        right = unit_vectors(np.cross(forward, [0.0, 1.0, 1e-3])[None])[0]
        return right, np.cross(right, forward), forward

    def _lit(self, shadows: Floats, light: Floats, radius: float, position: Floats) -> Floats:
        """Share of a light that meets points, by percentage-closer filtering, float64 [n]."""
        right, up, forward = self._axes(light)
        way = position - light
        depth = (way @ forward).clip(min=1e-6)
        scale = _TEXELS / 2 / self._half_width(light)
        column, row = ((way @ axis / depth * scale + _TEXELS / 2).astype(int) for axis in (right, up))
        # Half a shadow's blur as far behind the object as it is large
        distance = float(np.linalg.norm(self._middle - light))
        blur = radius * self._radius / distance * scale / distance
        step = max(1, round(blur / _FILTER))
        lit = np.zeros(len(position))
        for down in range(-_FILTER, _FILTER + 1):
            for across in range(-_FILTER, _FILTER + 1):
                x, y = column + across * step, row + down * step
                inside = (x >= 0) & (x < _TEXELS) & (y >= 0) & (y < _TEXELS)
                nearest = np.where(inside, shadows[y.clip(0, _TEXELS - 1), x.clip(0, _TEXELS - 1)], np.inf)
                lit += depth <= nearest * (1 + _BIAS)
        return lit / (2 * _FILTER + 1) ** 2


def _split_sum(f0: Floats, roughness: float, facing: Floats) -> Floats:
    """Share of the probe that a surface reflects, float64 [n, 3]."""
    if not f0.any():
        return np.zeros((len(facing), 3))
    a, b, c, d = roughness * np.array([-1.0, -0.0275, -0.572, 0.022]) + np.array([1.0, 0.0425, 1.04, -0.04])
    x = np.minimum(a * a, 2.0 ** (-9.28 * facing)) * a + b
    return np.asarray(f0 * (-1.04 * x + c)[:, None] + (1.04 * x + d)[:, None])


def _highlight(
    f0: Floats, roughness: float, normal: Floats, to_light: Floats, to_eye: Floats, facing: Floats
) -> Floats:
    """The GGX lobe times pi, float64 [n, 3]: light is over pi here."""
    if not f0.any():
        return np.zeros((len(normal), 3))
    half = unit_vectors(to_light + to_eye)
    squared = roughness**4
    along, near = np.einsum("ni,ni->n", normal, half).clip(0, 1), np.einsum("ni,ni->n", to_eye, half).clip(0, 1)
    lobe = squared / (along**2 * (squared - 1) + 1) ** 2
    cosine = np.einsum("ni,ni->n", normal, to_light).clip(1e-3, 1.0)
    visible = 0.5 / (
        cosine * np.sqrt(facing**2 * (1 - squared) + squared) + facing * np.sqrt(cosine**2 * (1 - squared) + squared)
    )
    fresnel = f0 + (1 - f0) * (1 - near[:, None]) ** 5
    return np.asarray(fresnel * (lobe * visible)[:, None])
