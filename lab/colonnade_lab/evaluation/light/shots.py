"""Writes scenes of varied objects in rooms, which leave all options to the default command (``tools/light shots``).

Of the rooms only photo, depth, pose, and where a shot says so a panorama of unknown exposure are known.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.image_io import read_picture
from colonnade.design.toolchain import project_root
from colonnade.scene.model import Vector

from colonnade_lab.evaluation.light import files
from colonnade_lab.evaluation.light.rooms import GLASSES, METALS, Kind, Thing
from colonnade_lab.evaluation.light.surfaces import RoomSurface, pose_of
from colonnade_lab.evaluation.light.user_rooms import known_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room

#: Roughness of materials; others are sharp.
_ROUGHNESS: Mapping[Kind, float] = {"metal": 0.45, "plastic": 0.3}


@dataclass(frozen=True)
class Item:
    """An object of a shot.

    Attributes:
        mesh: Its name.
        kind: Its material; None: its file's.
        colour: Linear base colour.
        size: Longest edge of its bounding box, as a share of the matt object's there; metres in ``scenes/rooms``.
        turn: About the vertical, degrees.
        place: Where it stands: 0 and 1 are the places of the room's first two objects; a pixel of its photo in
            ``scenes/rooms``.
    """

    mesh: str
    kind: Kind | None
    colour: Vector = (0.7, 0.7, 0.7)
    size: float = 1.0
    turn: float = 0.0
    place: int | tuple[int, int] = 0

    @property
    def material(self) -> str:
        """Its table of a scene."""
        if self.kind is None:
            return ""
        kind = "mirror" if self.kind in METALS else "glass" if self.kind in GLASSES else "diffuse"
        rough = f", roughness = {_ROUGHNESS[self.kind]}" if self.kind in _ROUGHNESS else ""
        return f'material = {{kind = "{kind}", albedo = {list(self.colour)}{rough}}}'


@dataclass(frozen=True)
class Shot:
    """A frame.

    Attributes:
        room: Name of a known room, or a folder, ``scenes/rooms/NAME``.
        items: What stands there.
        has_panorama: A panorama is known.
    """

    room: str
    items: tuple[Item, ...]
    has_panorama: bool = False


_GOLD, _COPPER, _SILVER, _WHITE = (1.0, 0.77, 0.34), (0.95, 0.64, 0.54), (0.95, 0.94, 0.92), (1.0, 1.0, 1.0)
#: All shots by name, beside the scenes of the repository.
SHOTS: Mapping[str, Shot] = {
    "kitchen-bunny": Shot(
        "kitchen", (Item("bunny", "matt"), Item("sphere:5120", "plastic", (0.6, 0.1, 0.08), 0.5, place=1)), True
    ),
    "kitchen-truck": Shot("kitchen", (Item("CesiumMilkTruck", None, size=1.2, turn=30.0),)),
    "passage-glass": Shot(
        "passage", (Item("bunny", "matt"), Item("sphere:20480", "glass", _WHITE, 0.6, place=1)), True
    ),
    "passage-armadillo": Shot("passage", (Item("armadillo", "plastic", (0.5, 0.12, 0.08), 1.2, 180.0),)),
    "courtyard-dragon": Shot("courtyard", (Item("dragon", "metal", _GOLD, 1.4, 20.0),), True),
    "courtyard-duck": Shot(
        "courtyard", (Item("Duck", None, turn=-40.0), Item("cube", "matt", (0.2, 0.4, 0.6), 0.5, 25.0, 1))
    ),
    "study-mirror": Shot(
        "study", (Item("sphere:20480", "glass", _WHITE, 0.7), Item("teapot:40", "mirror", _SILVER, 1.1, 20.0, 1)), True
    ),
    "study-cheburashka": Shot("study", (Item("cheburashka", "plastic", (0.35, 0.2, 0.1), 1.1),)),
    "attic-rocker-arm": Shot(
        "attic",
        (Item("torus:96", "matt", (0.75, 0.75, 0.7), 0.7), Item("rocker-arm", "metal", _SILVER, 1.1, place=1)),
        True,
    ),
    "lean-to-glass": Shot("lean-to", (Item("bunny", "glass", (0.9, 0.97, 0.95), 1.0, 20.0),)),
    "chamber-armadillo": Shot("chamber", (Item("armadillo", "matt", (0.3, 0.42, 0.25), 1.1, 180.0),), True),
    "parlour-objects": Shot(
        "parlour", (Item("torus:96", "mirror", _GOLD, 0.9), Item("cube", "matt", (0.65, 0.1, 0.1), 0.5, 30.0, 1)), True
    ),
    "office-bunny": Shot("scenes/rooms/office", (Item("bunny", "matt", (0.75, 0.72, 0.66), 0.3),)),
    "living-duck": Shot("scenes/rooms/living", (Item("Duck", None, size=0.4, turn=30.0, place=(322, 306)),)),
    "attic-fandisk": Shot("scenes/rooms/attic", (Item("fandisk", "metal", _COPPER, 0.35, 30.0, (323, 282)),)),
}


def write_shots(folder: Path, names: tuple[str, ...] = tuple(SHOTS)) -> list[Path]:
    """Write scenes, and the rooms that they need, to a folder; returns the scenes.

    Raises:
        UserError: A mesh is not found.
    """
    written: set[str] = set()
    scenes = []
    for name in names:
        shot = SHOTS[name]
        is_known = "/" not in shot.room
        if is_known and shot.room not in written:
            _write_known(folder / shot.room, shot.room)
            written.add(shot.room)
        room = shot.room if is_known else str(project_root() / shot.room)
        objects = [_placed(shot.room, item) if is_known else _standing(item) for item in shot.items]
        lines = [line for own in objects for line in ("[[object]]", *own, "")]
        lines += ["[background]", f"room = {json.dumps(room)}"]
        if shot.has_panorama:
            lines.append(f"panorama = {json.dumps(str(files.stored(shot.room) / 'panorama.hdr'))}")
        scenes.append(folder / f"{name}.toml")
        scenes[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    return scenes


def _write_known(folder: Path, name: str) -> None:
    room = known_room(name)
    photo = read_picture(files.stored(name) / "photo.webp")
    write_room(folder, RoomSurface.of(room).maps(name, room.camera(), photo))
    for derived in ("albedo.png", "normal.png"):
        (folder / derived).unlink()


def _placed(room: str, item: Item) -> list[str]:
    things = known_room(room).frames["rough"]
    assert isinstance(item.place, int)
    thing = Thing(item.mesh, "matt", item.colour, things[item.place].foot, item.size * things[0].size, item.turn)
    return [f'mesh = {{name = "{item.mesh}"}}', item.material, f"transform = {files.transform_table(pose_of(thing))}"]


def _standing(item: Item) -> list[str]:
    where = [] if isinstance(item.place, int) else [f"stand_at = {list(item.place)}"]
    return [f'mesh = {{name = "{item.mesh}"}}', item.material, *where, f"size = {item.size}", f"turn = {item.turn}"]
