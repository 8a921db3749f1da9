"""A C header with what a driver has to know of one design."""

from __future__ import annotations

import itertools

from colonnade.design.manifest import Manifest
from colonnade.integration.register_table import RegisterTable, identifier


def design_header(table: RegisterTable, manifest: Manifest) -> str:
    """Format hash, places of registers, and names of errors and counters. Needs ``colonnade.h`` of the driver."""
    words = [f"{word:#010x}u" for word in manifest.format_words]
    errors = _of(manifest, "errors.")
    counters = _of(manifest, "counters.")
    lines = [
        "/* Written by `colonnade registers`. Do not edit. */",
        "#ifndef COLONNADE_DESIGN_H",
        "#define COLONNADE_DESIGN_H",
        "",
        '#include "colonnade.h"',
        "",
        "enum {",
        *(f"    COLONNADE_{_constant(name)} = {index}," for index, name in enumerate(errors)),
        *(f"    COLONNADE_{_constant(name)} = {index}," for index, name in enumerate(counters)),
        "};",
        "",
        "static const struct colonnade_design colonnade_design = {",
        f"    .format_hash = {{{', '.join(words[:4])},",
        f"                    {', '.join(words[4:])}}},",
        f"    .device_end = {table.device.base + table.device.words[-1].address + 4:#x},",
        f"    .frame_registers = {_first_frame_register(table):#x},",
        f"    .errors = {_place(table, manifest, errors)},",
        f"    .error_count = {len(errors)},",
        f"    .counters = {_place(table, manifest, counters)},",
        f"    .counter_count = {len(counters)},",
        f"    .tile_size = {manifest.config['frame']['tileSize']},",
        f"    .posted_writes = {table.posted_writes},",
        *_scene_in_dram(table, manifest),
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _of(manifest: Manifest, prefix: str) -> list[str]:
    """Registers with a prefix; they follow each other without a gap."""
    registers = [register for register in manifest.registers.values() if register.name.startswith(prefix)]
    for last, following in itertools.pairwise(registers):
        if last.address + last.words != following.address or last.words != following.words:
            raise ValueError(f"{following.name} does not follow {last.name}")
    return [register.name for register in registers]


def _first_frame_register(table: RegisterTable) -> int:
    """The byte address from which on all words may be written at any time but while a frame is queued."""
    words = table.device.words
    first = next(index for index, word in enumerate(words) if word.access == "rw")
    if any(word.access != "rw" for word in words[first:]):
        raise ValueError("a register behind the first rw register has another access")
    return table.device.base + words[first].address


def _place(table: RegisterTable, manifest: Manifest, names: list[str]) -> str:
    return f"{table.device.base + 4 * manifest.registers[names[0]].address:#x}"


def _scene_in_dram(table: RegisterTable, manifest: Manifest) -> list[str]:
    """The registers that place the scene, in a design with a cache."""
    if not manifest.config["columnBvhMemory"]["cache"]:
        return []
    if manifest.registers["dram.page"].words != 1:
        raise ValueError("dram.page has more than one word")
    return [
        f"    .scene_page = {_place(table, manifest, ['dram.page'])},",
        f"    .invalidate = {_place(table, manifest, ['control.invalidate'])},",
    ]


def _constant(name: str) -> str:
    """``errors.stackOverflow`` becomes ``ERROR_STACK_OVERFLOW``."""
    kind, _, rest = name.partition(".")
    split = "".join(f"_{char}" if char.isupper() else char for char in identifier(rest))
    return f"{kind.removesuffix('s')}_{split}".upper()
