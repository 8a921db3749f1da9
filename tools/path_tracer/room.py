"""Path-traces a room that `colonnade_lab.evaluation.light` describes, with Mitsuba and Open Image Denoise.

Usage: room.py JOB.npz RESULT.npz SAMPLES    run by tools/light in .cache/light-environment. The result has linear
radiance, float32 [height, width, 3]: one picture for each frame; and of the room without objects, unless the job is of
one frame alone, `photo`, `panorama`, and `around`, the panorama without its emitters.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import mitsuba as mi
import numpy as np
from common import CHUNK, DEPTH, ROULETTE, Mean, colour, mesh, picture

#: Rows of the panorama, half as many as columns.
ROWS = 64
#: Samples of a panorama's texel for each one of a frame's pixel.
PANORAMA = 2


def material(thing: dict[str, Any]) -> dict[str, Any]:
    """The material of an object."""
    kind, tint, lobe = thing["kind"], colour(thing["colour"]), {"distribution": "ggx", "alpha": thing["roughness"] ** 2}
    if kind == "glass":
        return {"type": "dielectric", "int_ior": 1.5}
    if kind == "rough glass":
        return {"type": "roughdielectric", "int_ior": 1.5, **lobe}
    own: dict[str, Any] = {
        "matt": {"type": "diffuse", "reflectance": tint},
        "mirror": {"type": "conductor", "material": "none", "specular_reflectance": tint},
        "rough mirror": {"type": "roughconductor", "material": "none", "specular_reflectance": tint, **lobe},
    }.get(kind) or {
        "type": "principled",
        "base_color": tint,
        "metallic": float(kind == "metal"),
        "roughness": float(thing["roughness"]),
        "specular": 0.5,
    }
    return {"type": "twosided", "bsdf": own}


def scene(job: Any, plan: dict[str, Any], frame: str | None) -> mi.Scene:
    """The room, with the objects of a frame."""
    reflectance = {"type": "mesh_attribute", "name": "vertex_color"}
    paint = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    parts: dict[str, Any] = {
        "type": "scene",
        "room": mesh(job["vertices"], job["faces"], paint, colours=job["colours"]),
    }
    for index, emitter in enumerate(plan["emitters"]):
        light = {"type": "area", "radiance": colour(emitter["radiance"])}
        if "radius" in emitter:
            ball = {"type": "sphere", "center": emitter["centre"], "radius": emitter["radius"], "emitter": light}
            parts[f"emitter{index}"] = ball
        else:
            black = {"type": "diffuse", "reflectance": colour((0, 0, 0))}
            corners = job[f"emitter{index}"]
            parts[f"emitter{index}"] = mesh(corners, [[0, 1, 2], [0, 2, 3]], black, emitter=light)
    for index, thing in enumerate(plan["frames"].get(frame, ())):
        vertices, normals = job[f"{frame}{index}-vertices"], job[f"{frame}{index}-normals"]
        faces = np.arange(len(vertices)).reshape(-1, 3)
        parts[f"object{index}"] = mesh(vertices, faces, material(thing), normals=normals)
    return mi.load_dict(parts)


def sensor(plan: dict[str, Any], size: list[int]) -> mi.Sensor:
    """The camera for a picture of a size."""
    pose = np.eye(4)
    pose[:3] = np.array(plan["pose"]) * [-1, -1, 1, 1]  # Mitsuba's x is left, its y up
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    film |= {"pixel_format": "rgb", "component_format": "float32"}
    width = 2 * np.degrees(np.arctan(0.5 / plan["focal"]))
    camera = {"type": "perspective", "fov": float(width), "fov_axis": "x", "to_world": mi.ScalarTransform4f(pose)}
    return mi.load_dict(camera | {"film": film, "sampler": {"type": "independent"}})


def panorama(what: mi.Scene, place: list[float], samples: int, hides: bool) -> Any:
    """Radiance around a point, float32 [rows, columns, 3]: from +y down; the middle column is -z, right of it is +x."""
    path = mi.load_dict({"type": "path", "max_depth": DEPTH, "rr_depth": ROULETTE, "hide_emitters": hides})
    columns, random = 2 * ROWS, np.random.default_rng(0)
    mean = Mean()
    for seed in range(max(1, samples // CHUNK)):
        shape = (ROWS, columns, CHUNK)
        rows = (np.arange(ROWS)[:, None, None] + random.random(shape)) / ROWS
        angle = ((np.arange(columns)[None, :, None] + random.random(shape)) / columns - 0.5) * 2 * np.pi
        height = np.cos(rows * np.pi)
        level = np.sqrt(1 - height**2)
        way = np.stack([level * np.sin(angle), height, -level * np.cos(angle)], axis=-1).reshape(-1, 3)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, len(way))
        ray = mi.RayDifferential3f(mi.Point3f(place), mi.Vector3f(way.T.astype(np.float32)))
        light, _, _ = path.sample(what, sampler, ray)
        for part in np.moveaxis(np.array(light).T.reshape(*shape, 3), 2, 0):
            mean.add(part)
    return mean.value()


def main() -> None:
    """Render all pictures of a job."""
    job, samples, begun = np.load(sys.argv[1]), int(sys.argv[3]), time.monotonic()
    plan = json.loads(str(job["plan"]))
    found = {}

    def add(name: str, values: Any) -> None:
        found[name] = values.astype(np.float32)
        print(f"{name}: {time.monotonic() - begun:.0f} s", flush=True)

    if plan["has_room"]:
        room = scene(job, plan, None)
        add("photo", picture(room, sensor(plan, plan["photo"]), max(1, samples // 4)))
        for name, hides in (("panorama", False), ("around", True)):
            add(name, panorama(room, plan["place"], PANORAMA * samples, hides))
    for frame in plan["frames"]:
        add(frame, picture(scene(job, plan, frame), sensor(plan, plan["frame"]), samples))
    np.savez_compressed(sys.argv[2], **found)


if __name__ == "__main__":
    main()
