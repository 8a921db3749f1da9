"""The watchdog register of a frame: more cycles than any frame needs for a pixel; docs/errors.md."""

from __future__ import annotations

from collections.abc import Mapping

from colonnade.design.manifest import Manifest
from colonnade.scene_image.header import ImageHeader

#: Start-up, and the longest row of tiles that no ray enters.
BASE_CYCLES = 100_000

#: Set-up, shading and colour of a ray, one context at a time.
RAY_CYCLES = 1_000

#: From a request to the response of the box unit, and of the triangle unit for each triangle, if visits do not
#: overlap; without the latency of the memory and the requests of the other rows.
NODE_CYCLES = 12
TRIANGLE_CYCLES = 24

#: Triangles of a leaf.
TRIANGLES = 2

#: Nodes, and triangle records, that each ray of a column visits, one ray after the other. No ray visits as many on
#: the eight meshes of the benchmark (`make verify`), and contexts overlap: a single ray may visit many times as many.
#: A design without a tree visits all records.
TREE_VISITS = 128

#: From a ray in the world to one in an instance and back, if all other contexts go first.
INSTANCE_CYCLES = 100

#: A read from DRAM, behind all other requesters' reads.
DRAM_CYCLES = 2000

#: A step of the march through an environment, without the lookups of the other units; steps in a tile, cells included.
MARCH_CYCLES = 24
TILE_STEPS = 17


def watchdog_cycles(registers: Mapping[str, int], header: ImageHeader, manifest: Manifest) -> int:
    """The register ``frame.watchdogCycles`` of a frame with these registers.

    A pixel leaves at the latest when all contexts of its column's path unit have traced all their rays. The path unit
    hands out rays in any order, so one may wait for all others.
    """
    rows, contexts = int(manifest.config["array"]["rows"]), int(manifest.config["units"]["pathContexts"])
    geometry = manifest.config["geometry"]
    nodes, leaves = header.nodes, header.leaves
    if geometry["bvh"]:
        nodes, leaves = min(nodes, TREE_VISITS), min(leaves, TREE_VISITS)
    memory = manifest.config["columnBvhMemory"]
    fetch = rows + (DRAM_CYCLES if memory["cache"] else int(memory["readLatency"])) + NODE_CYCLES
    walk = nodes * fetch + leaves * (fetch + TRIANGLE_CYCLES * TRIANGLES)
    if header.instances:
        walk = len(header.instances) * (walk + INSTANCE_CYCLES)
    lights = registers["shading.lights"] if registers["shading.shadows"] else 0
    is_shiny = any(value != 0 for name, value in registers.items() if name.endswith(".kind"))
    bounces = registers["shading.bounces"] if is_shiny else 0
    rays = 1 + bounces + lights
    # Glass looks up the environment once more at each bounce
    march = _march(manifest) if registers.get("environment.enabled", 0) else 0
    cycles = contexts * (rays * (RAY_CYCLES + walk) + (rays + bounces) * march)
    return min(BASE_CYCLES + cycles, (1 << 32) - 1)


def _march(manifest: Manifest) -> int:
    """Cycles of one ray along the longest way through the maps."""
    maps = manifest.config["physicalAttributeMemory"]
    if maps is None:
        return 0
    ports = int(manifest.config["units"]["marches"]) + 1
    requesters = ports * min(int(maps["columnsPerCopy"]), int(manifest.config["array"]["columns"]))
    tiles = (int(maps["width"]) + int(maps["height"])) // int(maps["tileSize"])
    return tiles * TILE_STEPS * (MARCH_CYCLES + requesters)
