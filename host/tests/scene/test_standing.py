"""The place that is chosen for an object in a room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.thin_furniture import behind_thin_things

from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment
from colonnade.mesh.load import load_mesh
from colonnade.reference.embree import RayTracer
from colonnade.reference.render import primary_directions
from colonnade.scene.model import Background, MeshSource, Placement, Scene
from colonnade.scene.object_pose import Placed, with_free_placement
from colonnade.scene.view import make_view

ROOMS = Path(__file__).parents[3] / "scenes" / "rooms"
#: Rooms of four kinds, with a stool, a plant and a lamp in three of them, and photographed ones.
ROOM_NAMES = ("20", "21", "22", "23", "24", "stool", "plant", "lamp", "living", "office")


def room_of(name: str) -> Environment:
    if name.isdigit():
        return generated_room(int(name), 160, 120).environment
    if name in ("stool", "plant", "lamp"):
        return behind_thin_things(30 + ("stool", "plant", "lamp").index(name)).room(name, 160, 120).environment
    return load_environment(ROOMS / name)


@pytest.mark.parametrize("name", ROOM_NAMES)
@pytest.mark.parametrize("size", [0.3, 0.58])
def test_the_chosen_place_shows_the_object_whole_and_not_tiny(name: str, size: float) -> None:
    """Nothing of the room stands before it; it has a share of the picture, and a margin to its edge."""
    room, mesh = room_of(name), load_mesh("teapot:3")
    scene = Scene(MeshSource("teapot:3"), placement=Placement(size=size), background=Background(room=ROOMS))
    scene = with_free_placement(Placed(scene, mesh.extent, room)).scene
    view = make_view(Placed(scene, mesh.extent, room), room.width, room.height, mesh.materials)
    directions = primary_directions(view, slice(0, view.height)).reshape(-1, 3)
    origins = np.broadcast_to(view.origin, directions.shape)
    tracer = RayTracer(mesh)
    faces = tracer.first_hits(origins, directions)
    hit = np.flatnonzero(faces >= 0)
    way = tracer.surface_points(faces[hit], origins[hit], directions[hit]).t
    assert view.view_to_mesh is not None
    to_depth_one = room.camera.directions(room.width, room.height).reshape(-1, 3)[hit] @ view.view_to_mesh[:, :3].T
    depth = way * np.linalg.norm(directions[hit], axis=1) / np.linalg.norm(to_depth_one, axis=1)
    assert len(hit) / len(faces) > 0.007 * size
    assert np.mean(depth < room.depth.ravel()[hit] + 0.01) >= 0.9
    y, x = np.unravel_index(hit, (room.height, room.width))
    assert min(x.min(), y.min()) > 0 and x.max() < room.width - 1 and y.max() < room.height - 1
