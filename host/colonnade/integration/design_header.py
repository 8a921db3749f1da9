"""A C header with what a driver has to know of one design."""

from __future__ import annotations

from colonnade.design.manifest import Manifest
from colonnade.integration.driver_design import DriverDesign
from colonnade.integration.register_table import RegisterTable, identifier

#: Numbers of ``struct colonnade_design`` that are no addresses.
_COUNTS = ("error_count", "counter_count", "tile_size", "posted_writes")


def design_header(table: RegisterTable, manifest: Manifest) -> str:
    """Format hash, addresses of registers, and names of errors and counters. Needs ``colonnade.h`` of the driver.

    Its members are in the order of ``struct colonnade_design``, without names, which C++ has since 2020.
    """
    design = DriverDesign.of(table, manifest)
    words = [f"{word:#010x}u" for word in design.format_words]
    names = [*design.errors.items(), *design.counters.items()]
    numbers = [
        f"    {value if name in _COUNTS else f'{value:#x}'}, /* {name} */" for name, value in design.numbers.items()
    ]
    maps = [f"{{{width}, {depth}}}" for width, depth in design.maps]
    lines = [
        "/* Written by `colonnade registers`. Do not edit. */",
        "#ifndef COLONNADE_DESIGN_H",
        "#define COLONNADE_DESIGN_H",
        "",
        '#include "colonnade.h"',
        "",
        "enum {",
        *(f"    COLONNADE_{_constant(name)} = {index}," for index, name in names),
        "};",
        "",
        "static const struct colonnade_design colonnade_design = {",
        f"    {{{', '.join(words[:4])},",
        f"     {', '.join(words[4:])}}}, /* format_hash */",
        *numbers,
        f"    {len(maps)}, /* map_count */",
        f"    {{{', '.join(maps or ['{0, 0}'])}}}, /* maps */",
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _constant(name: str) -> str:
    """``errors.stackOverflow`` becomes ``ERROR_STACK_OVERFLOW``."""
    kind, _, rest = name.partition(".")
    split = "".join(f"_{char}" if char.isupper() else char for char in identifier(rest))
    return f"{kind.removesuffix('s')}_{split}".upper()
