"""Checks types and ranges in a scene image's header, which may come from an untrusted source."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from colonnade.mesh.materials.materials import KINDS

#: Integer keys of the header, and the limits of their values.
_COUNTS = (
    "source_triangles",
    "triangles",
    "record_count",
    "nodes",
    "leaves",
    "largest_triangle",
)
_MAX = 1 << 31
_MAX_RECORD_BITS = 1 << 16
_MAX_WORD_BYTES = 1 << 12


def check_header(header: Any) -> None:
    """Refuse a header whose values have the wrong type or range.

    Raises:
        ValueError, KeyError, TypeError: The header is invalid; the caller writes the message.
    """
    _require(isinstance(header, Mapping))
    for key in _COUNTS:
        _count(header[key])
    _require(header["record_count"] - header["nodes"] in (header["leaves"], 2 * header["leaves"]))
    bits = _count(header["record_bits"])
    _require(0 < bits <= _MAX_RECORD_BITS and bits % 32 == 0)
    for key in ("format_hash", "mesh"):
        _require(isinstance(header[key], str))
    _check_box(header)
    for key in ("low", "high"):
        _numbers(header["extent"][key], 3)
    outline = _list(header["extent"]["outline"])
    _require(len(outline) > 0)
    for point in outline:
        _numbers(point, 3)
    _require(len(_list(header["materials"])) > 0)
    for material in header["materials"]:
        _require(material["kind"] in KINDS)
        _numbers(material["albedo"], 3)
        _number(material["ior"])
        _require(isinstance(material["has_corner_colours"], bool))
        _numbers(material["emission"], 3)
        _number(material.get("roughness", 0.0))
        _number(material.get("coverage", 1.0))
        _numbers(material.get("clear_coat", [0.0, 0.0]), 2)
        if material["texture"] is not None:
            _count(material["texture"])
    for part in _list(header["parts"]):
        _require(isinstance(part["name"], str) and _number(part["edge"]) > 0)
        _count(part["first_face"])
    for instance in _list(header.get("instances", [])):
        _check_instance(instance)
    _check_tree(header["tree"])
    _check_environment(header["room"])
    _check_texture(header["texture"])
    _check_memories(header.get("light", []))
    _count(header.get("parallax", 0))


def _check_box(described: Any) -> None:
    for key in ("bounds_low", "bounds_high"):
        _require(len([_count(value) for value in _list(described[key])]) == 3)
    _numbers(described["frame"]["offset"], 3)
    _require(_number(described["frame"]["scale"]) > 0)


def _check_instance(instance: Any) -> None:
    _check_box(instance)
    for key in ("largest_triangle", "root", "material_base"):
        _count(instance[key])
    rows = _list(instance["transform"])
    _require(len(rows) == 4)
    for row in rows:
        _numbers(row, 4)


def _check_tree(tree: Any) -> None:
    if tree is None:
        return
    for key, value in tree.items():
        if key == "cost":
            _number(value)
        else:
            _count(value)


def _check_environment(environment: Any) -> None:
    if environment is None:
        return
    _require(isinstance(environment["name"], str) and _number(environment["depth_unit"]) > 0)
    _check_memories(environment["memories"])


def _check_texture(texture: Any) -> None:
    if texture is None:
        return
    _count(texture["textures"])
    _count(texture["source_bytes"])
    _number(texture["scale"])
    _check_memories(texture["memories"])


def _check_memories(memories: Any) -> None:
    for memory in _list(memories):
        _require(isinstance(memory["memory"], str))
        _count(memory["words"])
        _require(0 < _count(memory["word_bytes"]) <= _MAX_WORD_BYTES)


def _count(value: Any) -> int:
    _require(isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _MAX)
    return int(value)


def _number(value: Any) -> float:
    _require(isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value))
    return float(value)


def _numbers(values: Any, count: int) -> None:
    _require(len([_number(value) for value in _list(values)]) == count)


def _list(value: Any) -> list[Any]:
    _require(isinstance(value, list))
    return list(value)


def _require(is_right: bool) -> None:
    if not is_right:
        raise ValueError
