"""A C header with what a driver has to know of one design."""

from __future__ import annotations

from colonnade.design.manifest import Manifest
from colonnade.integration.register_table import RegisterTable, identifier
from colonnade.scene_image.environment import map_memories


def design_header(table: RegisterTable, manifest: Manifest) -> str:
    """Format hash, places of registers, and names of errors and counters. Needs ``colonnade.h`` of the driver."""
    words = [f"{word:#010x}u" for word in manifest.format_words]
    errors = _indices(manifest, "errors.")
    counters = _indices(manifest, "counters.")
    lines = [
        "/* Written by `colonnade registers`. Do not edit. */",
        "#ifndef COLONNADE_DESIGN_H",
        "#define COLONNADE_DESIGN_H",
        "",
        '#include "colonnade.h"',
        "",
        "enum {",
        *(f"    COLONNADE_{_constant(name)} = {index}," for name, index in errors.items()),
        *(f"    COLONNADE_{_constant(name)} = {index}," for name, index in counters.items()),
        "};",
        "",
        "static const struct colonnade_design colonnade_design = {",
        f"    .format_hash = {{{', '.join(words[:4])},",
        f"                    {', '.join(words[4:])}}},",
        f"    .device_end = {table.device.base + table.device.words[-1].address + 4:#x},",
        f"    .frame_registers = {_first_frame_register(table):#x},",
        f"    .errors = {_place(table, manifest, next(iter(errors)))},",
        f"    .error_count = {max(errors.values()) + 1},",
        f"    .counters = {_place(table, manifest, next(iter(counters)))},",
        f"    .counter_count = {max(counters.values()) + 1},",
        f"    .tile_size = {manifest.config['frame']['tileSize']},",
        f"    .posted_writes = {table.posted_writes},",
        *_scene_in_dram(table, manifest),
        *_maps(manifest),
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _indices(manifest: Manifest, prefix: str) -> dict[str, int]:
    """Registers with a prefix, by their position from the first one; the design may lack some between them."""
    registers = [register for register in manifest.registers.values() if register.name.startswith(prefix)]
    words, first = registers[0].words, registers[0].address
    if any(register.words != words or (register.address - first) % words for register in registers):
        raise ValueError(f"the registers {prefix}* are no array")
    return {register.name: (register.address - first) // words for register in registers}


def _first_frame_register(table: RegisterTable) -> int:
    """The byte address from which on all words may be written at any time but while a frame is queued."""
    words = table.device.words
    first = next(index for index, word in enumerate(words) if word.access == "rw")
    if any(word.access != "rw" for word in words[first:]):
        raise ValueError("a register behind the first rw register has another access")
    return table.device.base + words[first].address


def _place(table: RegisterTable, manifest: Manifest, name: str) -> str:
    return f"{table.device.base + 4 * manifest.registers[name].address:#x}"


def _scene_in_dram(table: RegisterTable, manifest: Manifest) -> list[str]:
    """The registers that place the scene, in a design with a cache."""
    if not manifest.config["columnBvhMemory"]["cache"]:
        return []
    if manifest.registers["dram.page"].words != 1:
        raise ValueError("dram.page has more than one word")
    return [
        f"    .scene_page = {_place(table, manifest, 'dram.page')},",
        f"    .invalidate = {_place(table, manifest, 'control.invalidate')},",
    ]


def _maps(manifest: Manifest) -> list[str]:
    """The memories of a room's maps in the order of their load targets, which begin at 1."""
    shapes = [manifest.memories[name] for name in map_memories(manifest)]
    if [int(shape["target"]) for shape in shapes] != list(range(1, len(shapes) + 1)):
        raise ValueError("the load targets of the maps do not count from 1")
    if not shapes:
        return []
    entries = [f"{{{-(-int(shape['bits']) // 32)}, {shape['depth']}}}" for shape in shapes]
    return [f"    .map_count = {len(entries)},", f"    .maps = {{{', '.join(entries)}}},"]


def _constant(name: str) -> str:
    """``errors.stackOverflow`` becomes ``ERROR_STACK_OVERFLOW``."""
    kind, _, rest = name.partition(".")
    split = "".join(f"_{char}" if char.isupper() else char for char in identifier(rest))
    return f"{kind.removesuffix('s')}_{split}".upper()
