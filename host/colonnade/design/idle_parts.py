"""Parts that a configuration has and a frame can never use at one time: they cost area and gain nothing.

A path of the path unit is in one place at a time: it has one ray in a traversal unit, or one in a march.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def idle_contexts(config: Mapping[str, Any]) -> int:
    """Contexts of a column's traversal units that are idle at any time, at least.

    Args:
        config: `Manifest.config`.
    """
    array = config["array"]
    return max(0, int(array["rows"]) * int(array["contexts"]) - _rays(config)[0])


def idle_notes(config: Mapping[str, Any]) -> list[str]:
    """A line on each kind of idle parts, with the settings that avoid them.

    Args:
        config: `Manifest.config`.
    """
    rows, contexts = int(config["array"]["rows"]), int(config["array"]["contexts"])
    (paths, setting), marches = _rays(config), int(config["units"]["marches"])
    fewer = f"set array.contexts={paths // rows}" if paths >= rows else "lower array.rows"
    kinds = [(idle_contexts(config), f"{rows * contexts:,} contexts (array.rows × array.contexts)", fewer)]
    if config["physicalAttributeMemory"] is not None:
        kinds.append((marches - paths, f"{marches} marches (units.marches)", f"set units.marches={paths}"))
    return [
        f"{idle:,} of a column's {parts} are idle at any time, since it has {paths} rays at most: raise"
        f" {setting}, or {advice}"
        for idle, parts, advice in kinds
        if idle > 0
    ]


def _rays(config: Mapping[str, Any]) -> tuple[int, str]:
    """Rays in flight in a column, at most, and the setting of it."""
    queries = config.get("queries")
    if queries is not None:
        return int(queries["contexts"]), "queries.contexts"
    return int(config["units"]["pathContexts"]), "units.pathContexts"
