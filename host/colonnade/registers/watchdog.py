"""The watchdog of a frame: more cycles than any legal one goes without a pixel; docs/errors.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from colonnade.design.manifest import Manifest
from colonnade.scene_image.file import ImageHeader

#: Start-up, and the longest row of tiles that no ray enters.
BASE_CYCLES = 100_000

#: Set-up, shading and colour of a ray, one context at a time.
RAY_CYCLES = 1_000

#: From a request to the box unit's answer, and to the triangle unit's for each triangle, one visit at a time; without
#: the memory's latency and the other rows' requests.
NODE_CYCLES = 12
TRIANGLE_CYCLES = 24

#: A step of the march through a room, without the other units' look-ups; steps in a tile, its cells included.
MARCH_CYCLES = 24
TILE_STEPS = 17


def watchdog_cycles(registers: Mapping[str, int], header: ImageHeader, manifest: Manifest) -> int:
    """The register ``frame.watchdogCycles`` of a frame with these registers.

    A pixel leaves at the latest when all contexts of its render unit have done all their rays, and a ray visits no
    record twice.
    """
    array: Mapping[str, Any] = manifest.config["array"]
    rows, contexts = int(array["rows"]), int(array["contexts"])
    nodes, leaves = header.triangle_base, header.triangle_records
    per_record = int(manifest.config["geometry"]["trianglesPerRecord"])
    fetch = rows + int(manifest.config["columnBvhMemory"]["readLatency"])
    walk = nodes * (fetch + NODE_CYCLES) + leaves * (fetch + NODE_CYCLES + TRIANGLE_CYCLES * per_record)
    lights = registers["shading.lights"] if registers["shading.shadows"] else 0
    is_shiny = any(value != 0 for name, value in registers.items() if name.endswith(".kind"))
    bounces = registers["shading.bounces"] if is_shiny else 0
    rays = 1 + bounces + lights
    # Glass looks for the room once more at each bounce
    cycles = contexts * (rays * (RAY_CYCLES + walk) + (rays + bounces) * _march(manifest))
    return min(BASE_CYCLES + cycles, (1 << 32) - 1)


def _march(manifest: Manifest) -> int:
    """Of one ray through the maps of a room, along both of their edges."""
    maps = manifest.config["physicalAttributeMemory"]
    if maps is None:
        return 0
    array = manifest.config["array"]
    units = int(array["rows"]) * (int(array["columns"]) if maps["shared"] else 1)
    tiles = (int(maps["width"]) + int(maps["height"])) // int(maps["tileSize"])
    return tiles * TILE_STEPS * (MARCH_CYCLES + units)
