"""What the path tracer gets: a room, its emitters, camera and objects, in one file of arrays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.atomic_files import replacing

from colonnade_lab.evaluation.light.rooms import PHOTO, KnownRoom, Lamp
from colonnade_lab.evaluation.light.surfaces import RoomSurface, ThingSurface


def write_job(path: Path, room: KnownRoom, frame: str | None = None) -> None:
    """Write the file that ``tools/path_tracer/room.py`` reads: all pictures of a room, or one frame alone."""
    surface = RoomSurface.of(room)
    arrays: dict[str, Any] = {"vertices": surface.vertices, "faces": surface.faces, "colours": surface.colours}
    emitters: list[dict[str, Any]] = []
    for index, emitter in enumerate(room.emitters):
        emitters.append({"radiance": emitter.radiance})
        if isinstance(emitter, Lamp):
            emitters[-1] |= {"centre": emitter.centre, "radius": emitter.radius}
        else:
            arrays[f"emitter{index}"] = emitter.corners()
    frames: dict[str, list[dict[str, Any]]] = {}
    for name in room.frames if frame is None else (frame,):
        frames[name] = []
        for index, thing in enumerate(room.frames[name]):
            own = ThingSurface.of(thing)
            arrays |= {f"{name}{index}-vertices": own.vertices, f"{name}{index}-normals": own.normals}
            frames[name].append({"kind": thing.kind, "colour": thing.colour, "roughness": thing.roughness})
    pose = room.camera().to_world
    plan = {
        "emitters": emitters,
        "frames": frames,
        "has_room": frame is None,
        "photo": PHOTO,
        "frame": room.frame,
        "place": room.place,
        "focal": room.focal,
        "pose": pose.tolist(),
    }
    with replacing(path) as stream:
        np.savez_compressed(stream, plan=np.array(json.dumps(plan)), **arrays)
