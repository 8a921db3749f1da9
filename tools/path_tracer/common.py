"""What the programs of this folder share: meshes from arrays, and pictures without noise."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import pyoidn  # noqa: E402

#: Vertices of a path, and from which on it may end by chance.
DEPTH, ROULETTE = 12, 5
#: Samples of a pixel at a time: memory.
CHUNK = 16


def colour(values: Any) -> dict[str, Any]:
    """A constant spectrum."""
    return {"type": "rgb", "value": [float(value) for value in values]}


def mesh(vertices: Any, faces: Any, material: dict[str, Any], **more: Any) -> mi.Mesh:
    """A mesh from arrays; `colours`, `normals` and `uv` of the vertices, `emitter`."""
    normals, colours, uv = more.get("normals"), more.get("colours"), more.get("uv")
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(material)
    if "emitter" in more:
        properties["emitter"] = mi.load_dict(more["emitter"])
    has = {"has_vertex_normals": normals is not None, "has_vertex_texcoords": uv is not None}
    made = mi.Mesh("mesh", len(vertices), len(faces), props=properties, **has)
    if colours is not None:
        made.add_attribute("vertex_color", 3, np.asarray(colours, np.float32).ravel())
    values = mi.traverse(made)
    values["vertex_positions"] = np.asarray(vertices, np.float32).ravel()
    values["faces"] = np.asarray(faces, np.uint32).ravel()
    if normals is not None:
        values["vertex_normals"] = np.asarray(normals, np.float32).ravel()
    if uv is not None:
        values["vertex_texcoords"] = np.asarray(uv, np.float32).ravel()
    values.update()
    return made


class Mean:
    """The mean of pictures of one size, for each channel of those in which it is a number: some samples are not."""

    def __init__(self) -> None:
        """Begin without a picture."""
        self._sum: Any = 0.0
        self._count: Any = 0

    def add(self, picture: Any) -> None:
        """Add a picture."""
        known = np.isfinite(picture)
        self._sum = self._sum + np.where(known, picture, 0.0).astype(np.float64)
        self._count = self._count + known

    def value(self) -> Any:
        """The mean, float32."""
        return (self._sum / np.maximum(self._count, 1)).astype(np.float32)


def rendered(what: mi.Scene, camera: mi.Sensor, integrator: mi.Integrator, samples: int) -> Any:
    """The mean of samples, float32 [height, width, channels]."""
    mean = Mean()
    for seed in range(max(1, samples // CHUNK)):
        mean.add(np.array(mi.render(what, sensor=camera, integrator=integrator, spp=min(samples, CHUNK), seed=seed)))
    return mean.value()


def picture(what: mi.Scene, camera: mi.Sensor, samples: int) -> Any:
    """A picture without noise, float32 [height, width, 3]."""
    path = mi.load_dict({"type": "path", "max_depth": DEPTH, "rr_depth": ROULETTE})
    guides = mi.load_dict({"type": "aov", "aovs": "colour:albedo,normal:sh_normal"})
    light = rendered(what, camera, path, samples)
    guide = rendered(what, camera, guides, CHUNK)
    albedo, normal = (np.ascontiguousarray(guide[..., start : start + 3]) for start in (0, 3))
    return np.asarray(pyoidn.denoise(light, albedo=albedo.clip(0, 1), normal=normal, hdr=True))
