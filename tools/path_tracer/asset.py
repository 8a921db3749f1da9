"""Path-traces glTF files, as `colonnade_lab.evaluation.light.assets` describes them, with the principled material.

Usage: asset.py FOLDER SAMPLES    run by tools/light in .cache/light-environment. Each folder in it with a job.npz gets
truth.npz: `picture`, linear radiance, float32 [height, width, 3].
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from common import colour, mesh, picture


def texture(values: Any, is_colour: bool) -> dict[str, Any]:
    """A texture from a picture, uint8, or float32 if linear; one channel of it if it has no colour."""
    bitmap = mi.Bitmap(np.ascontiguousarray(values))
    return {"type": "bitmap", "bitmap": bitmap, "raw": not is_colour, "filter_type": "bilinear"}


def material(part: dict[str, Any], index: int, job: Any, is_mirrored: bool) -> dict[str, Any]:
    """The metallic-roughness material of a primitive, for its faces with a mirrored texture or the other ones.

    Mitsuba's bitangent does not follow a mirrored texture, so its normal map has the other sign of green.
    """
    own: dict[str, Any] = {"type": "principled", "specular": 0.5, "base_color": colour(part["base"])}
    own |= {"metallic": part["metallic"], "roughness": part["roughness"]}
    if f"{index}-baseColorTexture" in job:
        own["base_color"] = texture(job[f"{index}-baseColorTexture"], True)
    if f"{index}-metallicRoughnessTexture" in job:
        packed = job[f"{index}-metallicRoughnessTexture"]
        for key, channel in (("roughness", 1), ("metallic", 2)):
            scaled = np.rint(packed[..., channel : channel + 1] * float(part[key])).astype(np.uint8)
            own[key] = texture(scaled, False)
    if f"{index}-normalTexture" in job:
        tilts = job[f"{index}-normalTexture"]
        tilts = np.where([False, is_mirrored, False], 255 - tilts, tilts).astype(np.uint8)
        own = {"type": "normalmap", "normalmap": texture(tilts, False), "bsdf": own}
    return {"type": "twosided", "bsdf": own}


def emitter(part: dict[str, Any], index: int, job: Any) -> dict[str, Any]:
    """The area emitter of a primitive, as argument `emitter` of `mesh`; nothing for one that emits no light."""
    if "emission" not in part:
        return {}
    radiance = colour(part["emission"])
    if f"{index}-emissiveTexture" in job:
        bitmap = mi.Bitmap(np.ascontiguousarray(job[f"{index}-emissiveTexture"]))
        linear = np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))
        radiance = texture((linear * part["emission"]).astype(np.float32), False)
    return {"emitter": {"type": "area", "radiance": radiance}}


def sides(vertices: Any, faces: Any, normals: Any, uv: Any) -> list[tuple[bool, Any]]:
    """Faces whose texture is not mirrored, and those where it is; only parts that have faces."""
    edges, ways = vertices[faces[:, 1:]] - vertices[faces[:, :1]], uv[faces[:, 1:]] - uv[faces[:, :1]]
    out = (np.cross(edges[:, 0], edges[:, 1]) * normals[faces].sum(axis=1)).sum(axis=1) >= 0
    # The texture's v goes down, so its area is negative where it is not mirrored
    mirrored = (ways[:, 0, 0] * ways[:, 1, 1] - ways[:, 0, 1] * ways[:, 1, 0] > 0) == out
    return [(bool(side), faces[mirrored == side]) for side in (False, True) if (mirrored == side).any()]


def camera(plan: dict[str, Any]) -> mi.Sensor:
    """Colonnade's camera: the ray of pixel (x, y) is origin + t (direction + x step_x + y step_y)."""
    width, height = plan["size"]
    origin, direction, across, down = (np.array(plan[key]) for key in ("origin", "direction", "step_x", "step_y"))
    # Its rays go through the middles of the pixels
    forward = direction + (width - 1) / 2 * across + (height - 1) / 2 * down
    length = np.linalg.norm(forward)
    fov = 2 * np.degrees(np.arctan(np.linalg.norm(across) * width / 2 / length))
    pose = mi.ScalarTransform4f().look_at(
        origin=origin.tolist(), target=(origin + forward).tolist(), up=(-down / np.linalg.norm(down)).tolist()
    )
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "rgb", "component_format": "float32"}
    sensor = {"type": "perspective", "fov": float(fov), "fov_axis": "x", "to_world": pose, "film": film}
    near = 1e-3 * float(length) if length < 1 else 1e-3
    return mi.load_dict(sensor | {"near_clip": near, "far_clip": 1e6, "sampler": {"type": "independent"}})


def main() -> None:
    """Render every job."""
    for own in sorted(path.parent for path in Path(sys.argv[1]).glob("*/job.npz")):
        job = np.load(own / "job.npz")
        plan = json.loads(str(job["plan"]))
        parts: dict[str, Any] = {
            "type": "scene",
            "around": {"type": "constant", "radiance": colour(plan["around"])},
            "lamp": {
                "type": "point",
                "position": plan["light"],
                "intensity": colour(np.array(plan["lamp"]) * np.pi * plan["falloff"] ** 2),
            },
        }
        for index, part in enumerate(plan["parts"]):
            arrays = {
                key: job[f"{index}-{key}"] for key in ("vertices", "faces", "normals", "uv") if f"{index}-{key}" in job
            }
            vertices, faces = arrays.pop("vertices"), arrays.pop("faces")
            if "uv" in arrays:
                arrays["uv"] = arrays["uv"] * [1, -1] + [0, 1]
            halves = sides(vertices, faces, arrays["normals"], arrays["uv"]) if "uv" in arrays else [(False, faces)]
            for is_mirrored, own_faces in halves:
                name = f"part{index}{'mirrored' if is_mirrored else ''}"
                own_material = material(part, index, job, is_mirrored)
                parts[name] = mesh(vertices, own_faces, own_material, **arrays, **emitter(part, index, job))
        found = picture(mi.load_dict(parts), camera(plan), int(sys.argv[2]))
        np.savez_compressed(own / "truth.npz", picture=found)
        print(own.name, flush=True)


if __name__ == "__main__":
    main()
