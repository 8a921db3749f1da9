"""Reads scene files. The schema is `colonnade.scene.model`; every error names the file and the key."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.input_files import check_values, read_input
from colonnade.common.limits import MAX_COORDINATE
from colonnade.common.toml_files import parse_toml
from colonnade.design.toolchain import project_root
from colonnade.mesh.files.formats import SUFFIXES
from colonnade.scene.model import MAX_EDGE, MAX_OBJECTS, MeshSource, Scene

#: Tables of the file in the order of messages. `Scene` names ``object`` placement, and splits several
#: ``light``; several ``object`` are its objects.
_TABLES = "mesh transform object camera light material paths ambient background motion frame".split()

#: The project's scene of a mesh that is given in place of a scene: its tables but ``mesh``.
MESH_SCENE = "as-authored"

_SCHEMA = TypeAdapter(Scene)
_JSON_SCHEMA: dict[str, Any] = _SCHEMA.json_schema()


@checked
def scene_file(name: str | Path) -> Path:
    """The file of a scene: a TOML file, or the name of one of the project's scenes, such as ``room``.

    Raises:
        UserError: No scene has this name. The code that reads a file checks that it exists.
    """
    path = Path(name)
    if re.fullmatch(r"[\w-]+", str(name)) is None or os.path.lexists(path):
        return path
    try:
        scenes = project_root() / "scenes"
    except UserError:
        return path
    named = scenes / f"{name}.toml"
    if not named.is_file():
        known = ", ".join(sorted(scene.stem for scene in scenes.glob("*.toml")))
        raise UserError(f"no scene {name}: name a TOML file, or a scene of {scenes} ({known})")
    return named


@checked
def room_folder(name: str | Path) -> Path:
    """The folder of a room: a folder, or the name of one of the project's rooms, such as ``living``."""
    path = Path(name)
    if re.fullmatch(r"[\w-]+", str(name)) is None or os.path.lexists(path):
        return path
    try:
        named = project_root() / "scenes" / "rooms" / path
    except UserError:
        return path
    return named if named.is_dir() else path


def load_scene(path: str | Path, room: Path | None = None, animation: str | None = None) -> Scene:
    """Read a scene file; its paths are relative to its folder. A mesh file gets a scene, of which a note tells.

    Args:
        path: The file.
        room: Folder of a room in place of the scene's background, if it has one.
        animation: Name or number of an animation in place of the scene's mesh's.

    Raises:
        UserError: The file is missing, is neither TOML nor a mesh, or has an invalid key or value.
    """
    file = Path(path)
    tables = read_tables(file, room is not None)
    if animation is not None:
        tables = _with_animation(tables, animation)
    scene = scene_of(tables, f"scene {file}", file.parent, room is not None)
    if is_mesh_file(file):
        scene = replace(scene, note=_note_of_mesh(file, room is not None))
    return scene if room is None else scene.with_environment(room)


def is_mesh_file(file: Path) -> bool:
    """Whether a file is a mesh, by its suffix."""
    return file.suffix.lower() in SUFFIXES


def read_tables(file: Path, in_room: bool = False) -> dict[str, Any]:
    """The tables of a scene file, as they stand in it; or of the scene that a mesh file gets.

    Args:
        file: The file.
        in_room: Whether the scene gets a room, also if its background names none: then a mesh has no other table.

    Raises:
        UserError: The file is missing, or is neither TOML nor a mesh.
    """
    if is_mesh_file(file):
        return ({} if in_room else read_tables(_mesh_scene())) | {"mesh": {"path": file.name}}
    content = read_input(file, "the scene", missing=f"scene file {file} does not exist")
    try:
        return parse_toml(content, f"scene {file}")
    except UserError:
        if file.suffix.lower() in ("", ".toml"):
            raise
        suffixes = ", ".join(SUFFIXES)
        raise UserError(f"{file} is neither a scene in TOML, nor a mesh, whose suffix is one of {suffixes}") from None


def _mesh_scene() -> Path:
    return project_root() / "scenes" / f"{MESH_SCENE}.toml"


def _note_of_mesh(file: Path, in_room: bool) -> str:
    """What a mesh file's scene assumes."""
    others = "place, size and light by the room" if in_room else f"camera, light and background of {_mesh_scene()}"
    return f"{file} has the materials of its file, and {others}: a scene file changes them"


def _with_animation(tables: dict[str, Any], animation: str) -> dict[str, Any]:
    if "object" in tables and isinstance(tables["object"], list):
        raise UserError("an animation is of a single object: give mesh.animation to an [[object]]")
    return tables | {"mesh": dict(_table(tables, "mesh")) | {"animation": animation}}


def scene_of(tables: Mapping[str, Any], where: str, folder: Path, in_room: bool = False) -> Scene:
    """The scene of a file's tables.

    Args:
        tables: By name, with the keys of the file.
        where: Names the tables in messages.
        folder: What the paths are relative to.
        in_room: Whether the scene gets a room, also if its background names none.

    Raises:
        UserError: A key or a value is invalid.
    """
    check_values(tables, where)
    try:
        _check_combinations(tables, in_room)
        scene = _SCHEMA.validate_python(_as_schema(tables))
    except ValidationError as error:
        raise UserError(f"{where}: {_message(error.errors(include_url=False)[0])}") from None
    except ValueError as error:
        raise UserError(f"{where}: {error}") from None
    background = scene.background
    objects = tuple(replace(one, mesh=_beside(one.mesh, folder)) for one in scene.objects)
    scene = replace(scene, mesh=objects[0].mesh if objects else _beside(scene.mesh, folder), objects=objects)
    if background.room is not None:
        scene = scene.with_environment(folder / background.room)
    if background.photo is not None:
        scene = replace(scene, background=replace(scene.background, photo=folder / background.photo))
    if background.second_view is not None:
        scene = replace(scene, background=replace(scene.background, second_view=folder / background.second_view))
    if background.panorama is not None:
        scene = replace(scene, background=replace(scene.background, panorama=folder / background.panorama))
    return scene


def _beside(mesh: MeshSource, folder: Path) -> MeshSource:
    """The mesh with paths relative to the working directory, not to the scene's folder."""
    paths = {name: folder / path for name in ("path", "animation_file") if (path := getattr(mesh, name)) is not None}
    return replace(mesh, **paths)


def _as_schema(data: Mapping[str, Any]) -> dict[str, Any]:
    """Rename the file's tables to the fields of `Scene`; several ``[[light]]`` become `light` and `more_lights`.

    Several objects, and one with an animation, do not turn unless the file says so.
    """
    named = {"names_light": "light" in data or "ambient" in data, "names_gather": "gather" in _table(data, "paths")}
    tables = dict(data) | named
    if isinstance(light := tables.get("light"), list) and light:
        tables |= {"light": light[0], "more_lights": light[1:]}
    if isinstance(tables.get("object"), list):
        tables["objects"] = tables.pop("object")
        tables["mesh"] = {"name": "unused"}
        if isinstance(motion := tables.get("motion", {}), dict):
            tables["motion"] = {"turn": 0.0} | motion
    elif "object" in tables:
        tables["placement"] = tables.pop("object")
    if "animation" in _table(data, "mesh") and isinstance(motion := tables.get("motion", {}), dict):
        tables["motion"] = {"turn": 0.0} | motion
    return {"mesh": {}} | tables


def _check_combinations(data: Mapping[str, Any], in_room: bool) -> None:
    """Refuse unknown tables and contradictory keys.

    Raises:
        ValueError: The message for the user.
    """
    for name, value in data.items():
        if name not in _TABLES:
            raise ValueError(f"unknown key {name}; known here: {', '.join(_TABLES)}")
        if not isinstance(value, dict) and not (name in ("light", "object") and isinstance(value, list) and value):
            raise ValueError(f"{name} must be a table: [{name}]")
    in_room = in_room or "room" in _table(data, "background")
    if isinstance(data.get("object"), list):
        _check_objects(data, in_room)
        data = {name: value for name, value in data.items() if name != "object"}
    lights = data.get("light", {})
    lights = lights if isinstance(lights, list) else [lights]
    camera, transform, background = (data.get(name, {}) for name in ("camera", "transform", "background"))
    is_placed = "camera" in data and set(camera) != {"grain"}
    if "room" in background and is_placed and "position" not in camera:
        raise ValueError("the camera is the room's: give camera.position, or leave out [camera]")
    if "photo" in background and not in_room:
        raise ValueError("background.photo is a view of a room: it needs background.room")
    if "photo" in background and not is_placed:
        raise ValueError("background.photo is for a camera that the scene places: give [camera]; a room has its photo")
    if "photo" in background and "camera" in _table(data, "motion"):
        raise ValueError("background.photo is the view of one camera: leave out motion.camera")
    if "grain" in camera and not in_room:
        raise ValueError("camera.grain is of the photo of a room: it needs background.room")
    if in_room and "backdrop" in background:
        raise ValueError("background.backdrop is of scenes without a room: leave it out")
    for key in ("panorama_yaw", "panorama_exposure", "backdrop"):
        if key in background and "panorama" not in background:
            raise ValueError(f"background.{key} is of a panorama: it needs background.panorama")
    if not in_room and "second_view" in background:
        raise ValueError("background.second_view is another view of a room: it needs background.room")
    if not in_room and "shadows" in background:
        raise ValueError("background.shadows is of shadows on a room's photo: it needs background.room")
    if not in_room and "colours" in background:
        raise ValueError("background.colours chooses the colours of a room: it needs background.room")
    if not in_room and "object" in data:
        raise ValueError("[object] places the object in a room: it needs background.room")
    if "object" in data and ("scale" in transform or "translate" in transform):
        raise ValueError("[object] places the object: leave out transform.scale and transform.translate")
    if "position" in camera and ("direction" in camera or "framing" in camera):
        raise ValueError("[camera] takes either position and target, or direction and framing")
    if any(isinstance(light, dict) and "position" in light and "offset" in light for light in lights):
        raise ValueError("[light] takes a position or an offset, not both")
    frame = data.get("frame", {})
    if "budget" in frame and "samples" in frame:
        raise ValueError("frame.budget chooses the samples: leave out frame.samples or frame.budget")
    if "budget" in frame and not _table(data, "paths").get("gather", in_room):
        raise ValueError("frame.budget is of frames that gather light: set paths.gather = 1, or give frame.samples")
    if "motion" in data and not data["motion"]:
        raise ValueError("[motion] moves nothing: give turn, stand_at, translate, light or camera")
    if "light" in data.get("motion", {}) and isinstance(lights[0], dict) and "position" not in lights[0]:
        raise ValueError("motion.light starts at the first light's position: give light.position")


def _check_objects(data: Mapping[str, Any], in_room: bool) -> None:
    """Refuse contradictory keys of a scene with ``[[object]]`` tables.

    Raises:
        ValueError: The message for the user.
    """
    objects = data["object"]
    if len(objects) > MAX_OBJECTS:
        raise ValueError(f"the scene has {len(objects)} [[object]], at most {MAX_OBJECTS} are possible: join meshes")
    for table in ("mesh", "transform", "material"):
        if table in data:
            raise ValueError(f"[[object]] has a {table} of its own: leave out [{table}], give object.{table}")
    if "stand_at" in data.get("motion", {}):
        raise ValueError("motion.stand_at moves a single object, the scene has [[object]]: give motion.translate")
    for number, one in enumerate(objects, 1):
        if not isinstance(one, dict):
            raise ValueError("object must be tables: [[object]]")
        if "mesh" not in one:
            raise ValueError(f"object {number} has no mesh: give object.mesh")
        placing = [key for key in ("stand_at", "size", "turn") if key in one]
        moving = [key for key in ("scale", "translate") if key in _table(one, "transform")]
        if placing and not in_room:
            raise ValueError(f"object {number}: object.{placing[0]} places it in a room: it needs background.room")
        if placing and moving:
            raise ValueError(f"object {number}: leave out object.{placing[0]}, or object.transform.{moving[0]}")


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = data.get(name, {})
    return value if isinstance(value, dict) else {}


def _message(error: ErrorDetails) -> str:
    """Format a validation error in one line: the key as in the file, and its valid values."""
    table, *rest = (str(part) for part in error["loc"] if isinstance(part, str))
    name = {"placement": "object", "more_lights": "light", "objects": "object"}.get(table, table)
    node = _node(table)
    if table == "objects" and rest and rest[0] in ("mesh", "transform", "material", "motion"):
        inner, *rest = rest
        name, node = f"object.{inner}", _plain(node["properties"][inner])
        node = _plain(node.get("items", node))
        if error["type"] in ("dataclass_type", "tuple_type"):
            return f"{name} must be a table"
    if table == "motion" and rest[:1] == ["camera"]:
        rest = rest[1:]
        name, node = "motion.camera", _plain(_plain(node["properties"]["camera"])["items"])
        if not rest or error["type"] == "dataclass_type":
            return "motion.camera must be tables: [[motion.camera]]"
        if error["type"] in ("missing", "missing_argument", "missing_keyword_only_argument"):
            return f"{name} needs {rest[0]}"
    if error["type"] == "dataclass_type":
        return f"{name} must be a table: [{name}]"
    if error["type"] == "unexpected_keyword_argument":
        return f"unknown key {name}.{rest[0]}; known here: {', '.join(node['properties'])}"
    if not rest:
        return str(error["ctx"]["error"])
    return f"{name}.{rest[0]} must be {_expectation(_plain(node['properties'][rest[0]]))}"


def _node(table: str) -> dict[str, Any]:
    """The JSON Schema of a table."""
    return _plain(_plain(_JSON_SCHEMA["properties"][table]).get("items", _JSON_SCHEMA["properties"][table]))


def _plain(node: dict[str, Any]) -> dict[str, Any]:
    """Resolve a schema's reference, and an only alternative to null."""
    if "anyOf" in node:
        node, *others = (option for option in node["anyOf"] if option.get("type") != "null")
        if others:
            return {"anyOf": [node, *others]}
    if "$ref" in node:
        found: dict[str, Any] = _JSON_SCHEMA["$defs"][node["$ref"].rpartition("/")[2]]
        return found
    return node


def _expectation(node: Mapping[str, Any]) -> str:
    """Describe the valid values of a key."""
    if "anyOf" in node:
        return " or ".join(map(_expectation, node["anyOf"]))
    kind = node["type"]
    if kind == "array":
        numbers = node["prefixItems"]
        count, highest = ("two", "three")[len(numbers) - 2], numbers[0]["maximum"]
        if highest == MAX_COORDINATE:
            return f"{count} finite numbers, none beyond {MAX_COORDINATE:g}"
        if highest == MAX_EDGE:
            return f"{count} numbers from 0 to {MAX_EDGE}: a pixel of the room's maps, across and down"
        return f"{count} numbers from {numbers[0]['minimum']:g} to {highest:g}"
    if "enum" in node:
        return f"one of {', '.join(node['enum'])}"
    if kind in ("number", "integer"):
        name = "a number" if kind == "number" else "a whole number"
        return f"{name} from {node['minimum']:g}" + (f" to {node['maximum']:g}" if "maximum" in node else "")
    return "true or false" if kind == "boolean" else "text"
