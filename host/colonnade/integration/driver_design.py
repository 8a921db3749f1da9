"""What the driver has to know of one design: ``struct colonnade_design`` of driver/include/colonnade.h."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from colonnade.design.manifest import Manifest
from colonnade.integration.register_table import RegisterTable
from colonnade.scene_image.environment import map_memories

#: Registers of a device for rays, the first ones of their groups, by their names in ``struct colonnade_design``.
_OF_RAYS = {
    "rays_tail": "rays.tail",
    "rays_head": "rays.head",
    "bounds": "bounds.low.x",
    "scene": "scene.recordCount",
    "placement": "placement.mantissa",
    "ring": "ring.base",
}


@dataclass(frozen=True)
class DriverDesign:
    """One design. Addresses are in bytes.

    Attributes:
        format_words: The format hash, 8 words.
        numbers: Numbers of ``struct colonnade_design`` by name. `scene_page` and `invalidate` are 0 if no scene lies in
            DRAM, and so are the ones of rays in a design of frames, but for `scene` with a scene in DRAM.
        maps: Words of a record and number of records of each memory of a room's maps, in the order of their load
            targets, which begin at 1.
        errors: Names of the device's error bits, by their number.
        counters: Names of its counters, by their number; the design may lack some between them.
    """

    format_words: tuple[int, ...]
    numbers: Mapping[str, int]
    maps: tuple[tuple[int, int], ...]
    errors: Mapping[int, str]
    counters: Mapping[int, str]

    @classmethod
    def of(cls, table: RegisterTable, manifest: Manifest) -> DriverDesign:
        """The content for a design with its shell.

        Raises:
            ValueError: Its registers are not in the order that the driver needs.
        """

        def place(name: str) -> int:
            return table.device.base + 4 * manifest.registers[name].address

        errors, counters = _numbers(manifest, "errors."), _numbers(manifest, "counters.")
        numbers = {
            "device_end": table.device.base + table.device.words[-1].address + 4,
            "frame_registers": _first_frame_register(table),
            "errors": place(errors[0]),
            "error_count": max(errors) + 1,
            "counters": place(counters[0]),
            "counter_count": max(counters) + 1,
            "tile_size": int(manifest.config["frame"]["tileSize"]),
            "posted_writes": table.posted_writes,
            **dict.fromkeys(("scene_page", "invalidate", *_OF_RAYS), 0),
        }
        if manifest.config["columnBvhMemory"]["cache"]:
            if manifest.registers["dram.page"].words != 1:
                raise ValueError("dram.page has more than one word")
            numbers |= {"scene_page": place("dram.page"), "invalidate": place("control.invalidate")}
            numbers["scene"] = place(_OF_RAYS["scene"])
        if "rays.tail" in manifest.registers:
            numbers |= {name: place(register) for name, register in _OF_RAYS.items()}
        return cls(tuple(manifest.format_words), numbers, _maps(manifest), errors, counters)


def _numbers(manifest: Manifest, prefix: str) -> dict[int, str]:
    """Registers with a prefix, by their position from the first one; the design may lack some between them."""
    registers = [register for register in manifest.registers.values() if register.name.startswith(prefix)]
    words, first = registers[0].words, registers[0].address
    if any(register.words != words or (register.address - first) % words for register in registers):
        raise ValueError(f"the registers {prefix}* are no array")
    return {(register.address - first) // words: register.name for register in registers}


def _first_frame_register(table: RegisterTable) -> int:
    """The byte address from which on all words may be written at any time but while a frame is queued."""
    words = table.device.words
    first = next(index for index, word in enumerate(words) if word.access == "rw")
    if any(word.access != "rw" for word in words[first:]):
        raise ValueError("a register behind the first rw register has another access")
    return table.device.base + words[first].address


def _maps(manifest: Manifest) -> tuple[tuple[int, int], ...]:
    shapes = [manifest.memories[name] for name in map_memories(manifest)]
    if [int(shape["target"]) for shape in shapes] != list(range(1, len(shapes) + 1)):
        raise ValueError("the load targets of the maps do not count from 1")
    return tuple((-(-int(shape["bits"]) // 32), int(shape["depth"])) for shape in shapes)
