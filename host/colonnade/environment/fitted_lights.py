"""Caches fitted lights, because fitting takes seconds."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common import cache
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.environment.light_fit import DEFAULT_LIGHTS, LightFit, fit_lights
from colonnade.environment.lights import RoomLight, RoomLights
from colonnade.environment.model import Environment
from colonnade.environment.surround import Surround

#: Sources that determine a fit, beside this file.
_SOURCES = tuple(
    "light_fit.py light_samples.py seen_sources.py wall_fit.py lights.py surround.py ../common/fixed_order.py"
    " ../common/srgb.py".split()
)


def fitted_lights(
    environment: Environment, count: int = DEFAULT_LIGHTS, folder: Path | None = None, walls: bool = False
) -> LightFit:
    """Fit lights to a room's photo (`fit_lights`), or take them from the cache ``folder``, by default the project's.

    Raises:
        UserError: The room has no photo, or it does not tell the light.
    """
    key = {"inputs": _digest(environment), "count": count, "walls": walls, "sources": _sources()}
    name = hashlib.sha256(repr(sorted(key.items())).encode()).hexdigest()[:32]
    file = (folder or cache_directory(project_root()) / "lights") / f"{name}.json"
    if (stored := cache.stored(file, key)) is not None:
        return _from_json(stored)
    fit = fit_lights(environment, count, walls)
    cache.store(file, key, asdict(fit))
    return fit


def _digest(environment: Environment) -> str:
    """Hash of what the fit reads."""
    camera, digest = environment.camera, hashlib.sha256()
    digest.update(repr((camera.fx, camera.fy, camera.cx, camera.cy)).encode())
    photo = np.zeros(0) if environment.photo is None else environment.photo
    for array in (environment.albedo, environment.normals, environment.depth, camera.to_world, photo):
        digest.update(repr(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


@functools.cache
def _sources() -> str:
    here = Path(__file__).parent
    return hashlib.sha256(b"".join((here / name).read_bytes() for name in _SOURCES)).hexdigest()


def _from_json(stored: dict[str, Any]) -> LightFit:
    lights = tuple(
        RoomLight(np.array(light["position"]), np.array(light["colour"]), light["falloff"], light["radius"])
        for light in stored["lights"]["lights"]
    )
    walls = stored["surround"]
    surround = None if walls is None else Surround(**{name: np.array(value) for name, value in walls.items()})
    found = RoomLights(np.array(stored["lights"]["ambient"]), lights)
    return LightFit(found, stored["psnr"], stored["ambient_psnr"], surround)
