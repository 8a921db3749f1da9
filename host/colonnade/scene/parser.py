"""Reads scene files; every error names the file and the key. The schema is `colonnade.scene.model`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from colonnade.common.errors import UserError
from colonnade.common.input_files import check_values, read_input
from colonnade.common.limits import MAX_COORDINATE, MAX_DEPTH
from colonnade.scene.model import MAX_EDGE, Scene

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: Tables of the file, in the order of messages. Two have another name in `Scene`: ``light`` and ``object``.
_TABLES = "mesh transform object camera light material paths ambient background motion frame".split()

_SCHEMA = TypeAdapter(Scene)
_JSON_SCHEMA: dict[str, Any] = _SCHEMA.json_schema()


def load_scene(path: str | Path) -> Scene:
    """Reads a scene file; its paths are relative to its folder.

    Raises:
        UserError: It is missing, not TOML, or says something that has no meaning.
    """
    file = Path(path)
    content = read_input(file, "the scene", missing=f"scene file {file} does not exist")
    try:
        data = tomllib.loads(content.decode("utf-8"))
    except RecursionError:
        raise UserError(f"scene {file} is nested too deeply: {MAX_DEPTH} levels at most") from None
    except ValueError as error:  # of TOML, UTF-8, and whole numbers with too many digits
        raise UserError(f"scene {file} is not TOML: {error}") from None
    check_values(data, f"scene {file}")
    try:
        _check_combinations(data)
        scene = _SCHEMA.validate_python(_as_schema(data))
    except ValidationError as error:
        raise UserError(f"scene {file}: {_message(error.errors(include_url=False)[0])}") from None
    except ValueError as error:
        raise UserError(f"scene {file}: {error}") from None
    mesh, background = scene.mesh, scene.background
    if mesh.path is not None:
        scene = replace(scene, mesh=replace(mesh, path=file.parent / mesh.path))
    if background.room is not None:
        scene = scene.with_environment(file.parent / background.room)
    return scene


def _as_schema(data: Mapping[str, Any]) -> dict[str, Any]:
    """The file's tables under the names of `Scene`: several ``[[light]]`` are the first one and `more_lights`."""
    tables = dict(data)
    if isinstance(light := tables.get("light"), list) and light:
        tables |= {"light": light[0], "more_lights": light[1:]}
    if "object" in tables:
        tables["placement"] = tables.pop("object")
    return {"mesh": {}} | tables


def _check_combinations(data: Mapping[str, Any]) -> None:
    """Refuses unknown tables, and keys that contradict each other.

    Raises:
        ValueError: With the message.
    """
    for name, value in data.items():
        if name not in _TABLES:
            raise ValueError(f"unknown key {name}; known here: {', '.join(_TABLES)}")
        if not isinstance(value, dict) and not (name == "light" and isinstance(value, list) and value):
            raise ValueError(f"{name} must be a table: [{name}]")
    lights = data.get("light", {})
    lights = lights if isinstance(lights, list) else [lights]
    camera, transform, background = (data.get(name, {}) for name in ("camera", "transform", "background"))
    if "room" in background and "camera" in data:
        raise ValueError("the camera is the room's: leave out [camera], or background.room")
    if "room" not in background and "object" in data:
        raise ValueError("[object] says where the object stands in a room: it needs background.room")
    if "object" in data and ("scale" in transform or "translate" in transform):
        raise ValueError("[object] places the object: leave out transform.scale and transform.translate")
    if "position" in camera and ("direction" in camera or "framing" in camera):
        raise ValueError("[camera] is either placed (position, target) or framed (direction, framing)")
    if any(isinstance(light, dict) and "position" in light and "offset" in light for light in lights):
        raise ValueError("[light] has a position or an offset, not both")
    if "motion" in data and not data["motion"]:
        raise ValueError("[motion] moves nothing: give turn, stand_at, translate or light")
    if "light" in data.get("motion", {}) and isinstance(lights[0], dict) and "position" not in lights[0]:
        raise ValueError("motion.light moves the first light from its place: give light.position")


def _message(error: ErrorDetails) -> str:
    """One line about what the schema refuses: the key as the file has it, and what it must be."""
    table, *rest = (str(part) for part in error["loc"] if isinstance(part, str))
    name = {"placement": "object", "more_lights": "light"}.get(table, table)
    node = _node(table)
    if error["type"] == "dataclass_type":
        return f"{name} must be a table: [{name}]"
    if error["type"] == "unexpected_keyword_argument":
        return f"unknown key {name}.{rest[0]}; known here: {', '.join(node['properties'])}"
    if not rest:
        return str(error["ctx"]["error"])
    return f"{name}.{rest[0]} must be {_expectation(_plain(node['properties'][rest[0]]))}"


def _node(table: str) -> dict[str, Any]:
    """The schema of a table, as JSON Schema."""
    return _plain(_plain(_JSON_SCHEMA["properties"][table]).get("items", _JSON_SCHEMA["properties"][table]))


def _plain(node: dict[str, Any]) -> dict[str, Any]:
    """A schema without references and without the alternative that the key is absent."""
    if "anyOf" in node:
        (node,) = (option for option in node["anyOf"] if option.get("type") != "null")
    if "$ref" in node:
        found: dict[str, Any] = _JSON_SCHEMA["$defs"][node["$ref"].rpartition("/")[2]]
        return found
    return node


def _expectation(node: Mapping[str, Any]) -> str:
    """What a value must be, in words."""
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
