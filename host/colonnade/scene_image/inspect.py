"""Describes a scene image, for `colonnade inspect` and the report of `colonnade pack`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from colonnade.common.terminal_text import one_line
from colonnade.design.manifest import Manifest
from colonnade.scene_image.dram_image import dram_lines
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.header import ImageHeader

#: Triangles of the largest mesh that caches mostly hold: fewer would not be faster.
_LARGE = 100_000
#: Steps of the grid along an object's longest edge from which its rounding is fine.
FINE_UNITS = 1024


def describe(image: SceneImage) -> dict[str, Any]:
    """Describe mesh, memory map and tree as a JSON object."""
    header = image.header
    return {
        "mesh": {
            "name": header.mesh,
            "triangles": header.triangles,
            "source_triangles": header.source_triangles,
            "low": header.extent.low.tolist(),
            "high": header.extent.high.tolist(),
        },
        "object": {
            "units_per_mesh_unit": header.frame.scale,
            "offset": list(header.frame.offset),
            "bounds_low": list(header.bounds_low),
            "bounds_high": list(header.bounds_high),
        },
        "memory": {
            "record_bits": header.record_bits,
            "records": header.record_count,
            "bytes": image.records.nbytes,
            "sections": {name: count for name, count in sections(header)},
        },
        "objects": [asdict(part) | {"units": part.edge * header.frame.scale} for part in header.parts],
        "tree": asdict(header.tree) if header.tree is not None else None,
        "room": _environment(image),
        "texture": None if header.texture is None else asdict(header.texture),
        "light": [asdict(memory) for memory in header.light],
        "format_hash": header.format_hash,
    }


def _environment(image: SceneImage) -> dict[str, Any] | None:
    if image.header.room is None:
        return None
    from colonnade.scene_image.environment import tiles_beyond_heap

    return {**asdict(image.header.room), "tiles_beyond_heap": tiles_beyond_heap(image)}


def illegal_lines(image: SceneImage) -> list[str]:
    """A warning line if the room's maps have illegal tiles, else none."""
    from colonnade.scene_image.environment import tiles_beyond_heap

    counts = [f"{count:,} of {name}" for name, count in tiles_beyond_heap(image).items() if count]
    if not counts:
        return []
    return [f"warning     tiles point beyond their heap, {', '.join(counts)}: frames that show them report an error"]


def sections(header: ImageHeader) -> list[tuple[str, int]]:
    """Parts of the column memory as (name, number of records)."""
    return [
        ("nodes", header.nodes),
        ("leaves", header.leaves),
        ("colours", header.leaves if header.has_colours else 0),
    ]


def coarse_line(header: ImageHeader) -> str | None:
    """A line on the objects whose vertices the common grid rounds coarsely; None if there are none."""
    coarse = [
        f"object {number} ({one_line(part.name)}) is {part.edge * header.frame.scale:.0f} steps long"
        for number, part in enumerate(header.parts, 1)
        if part.edge * header.frame.scale < FINE_UNITS
    ]
    if not coarse:
        return None
    return (
        f"the vertices of all objects share a grid of {_step(header)}, and {', '.join(coarse)}: raise"
        " geometry.vertexBits, or bring the objects nearer to one another"
    )


def lost_line(header: ImageHeader) -> str | None:
    """The line on a mesh of which the grid loses a percent of the faces, or more; None for others."""
    lost = header.source_triangles - header.triangles
    if 100 * lost < header.source_triangles or lost == 0:
        return None
    return (
        f"mesh {one_line(header.mesh)}: {lost:,} of {header.source_triangles:,} faces are left out, since they have no"
        f" area on a grid of {_step(header)}, or equal others: remove parts that lie far away, or raise"
        " geometry.vertexBits"
    )


def dense_line(header: ImageHeader, pixels: int) -> str | None:
    """The line on a large mesh of more than four triangles for each of the ``pixels`` that show it; None for others."""
    if header.triangles <= max(_LARGE, 4 * pixels) or pixels == 0:
        return None
    return (
        f"mesh {one_line(header.mesh)} has more than four triangles for each pixel that shows it:"
        " --simplify gives fewer, which are traced faster"
    )


def _step(header: ImageHeader) -> str:
    """The step of the grid: in a room, whose world is in metres, in millimetres."""
    return f"{1e3 / header.frame.scale:.3g} mm" if header.room is not None else f"{1 / header.frame.scale:.3g} units"


def report_lines(header: ImageHeader, manifest: Manifest | None = None) -> list[str]:
    """Describe the image in text lines; a manifest adds the use of its memories."""
    triangles, dropped = f"{header.triangles:,} triangles", header.source_triangles - header.triangles
    if dropped > 0:
        triangles += f" ({dropped:,} dropped)"
    elif dropped < 0:
        triangles += f", {header.source_triangles:,} in the file: normal maps and alpha split faces"
    lines = [f"mesh        {one_line(header.mesh)}: {triangles}"]
    lines += [
        f"object {number:<4} {one_line(part.name)}: {part.edge * header.frame.scale:,.0f} steps of {_step(header)} long"
        for number, part in enumerate(header.parts, 1)
    ]
    lines += [] if (coarse := coarse_line(header)) is None else [f"warning     {coarse}"]
    lines.append(
        f"box         {header.bounds_low} to {header.bounds_high} units, {header.frame.scale:.6g} units per mesh unit"
    )
    used = f"{header.record_count:,} records of {header.record_bits} bits"
    size, where = header.record_count * header.record_bits // 8, "per column"
    if manifest is not None:
        shape = manifest.memories["columnBvh"]
        used += f", {header.record_count / int(shape['depth']):.1%} of {int(shape['depth']):,}"
        if "line" in shape:
            size, where = dram_lines(header.record_count, manifest) * shape["line"]["pitch"], "of DRAM"
    lines.append(f"memory      {used} ({size:,} bytes {where}, {size / header.triangles:.1f} a triangle)")
    lines += [f"  {name:<10}{count:>9,} records" for name, count in sections(header) if count]
    return (
        lines
        + _tree_lines(header, manifest)
        + _environment_lines(header, manifest)
        + _texture_lines(header, manifest)
        + _light_lines(header, manifest)
    )


def _tree_lines(header: ImageHeader, manifest: Manifest | None) -> list[str]:
    tree = header.tree
    if tree is None:
        return ["tree        none: every ray tests every triangle"]
    stack = f"{tree.stack_bound} entries"
    if manifest is not None:
        stack += f" of {manifest.config['columnBvhMemory']['stackDepth']}"
    lines = [
        f"tree        {tree.nodes:,} nodes, {tree.leaves:,} leaves, depth {tree.depth}, stack bound {stack}",
        f"cost        {tree.cost:.2f} records for a random ray through the box",
    ]
    if tree.height_limit:
        lines.append(f"            limited to {tree.height_limit} binary levels by the stack")
    return lines


def _environment_lines(header: ImageHeader, manifest: Manifest | None) -> list[str]:
    if header.room is None:
        return []
    size = sum(memory.bytes for memory in header.room.memories)
    lines = [f"room        {one_line(header.room.name)}: {size:,} bytes to load"]
    if manifest is not None:
        from colonnade.scene_image.environment import environment_use

        for name, use in environment_use(header, manifest).items():
            lines.append(
                f"  {name:<10}{use['bytes']:>9,} bytes of memory, a {use['ratio']:.1f}x reduction from the map's"
                f" {use['source_bytes']:,}"
            )
    for memory in header.room.memories:
        target = "" if manifest is None else f", load target {manifest.memories[memory.memory]['target']}"
        lines.append(f"  {one_line(memory.memory):<19}{memory.words:>6,} words of {memory.word_bytes} bytes{target}")
    return lines


def _light_lines(header: ImageHeader, manifest: Manifest | None) -> list[str]:
    lines = []
    for memory in header.light:
        target = "" if manifest is None else f", load target {manifest.memories[memory.memory]['target']}"
        lines.append(f"light       a cube of {memory.words} texels, {memory.bytes:,} bytes{target}")
    return lines


def _texture_lines(header: ImageHeader, manifest: Manifest | None) -> list[str]:
    texture = header.texture
    if texture is None or texture.textures == 0:
        return []
    count = f"{texture.textures} texture{'s' if texture.textures > 1 else ''} of {texture.source_bytes:,} bytes"
    used = "" if manifest is None else f", in {manifest.config['geometry']['textureBytes']:,} bytes"
    return [f"textures    {count}, {texture.scale:.2f} texels for each of their pixels along an axis{used} per column"]


def print_report(header: ImageHeader, manifest: Manifest | None = None, write: Callable[[str], None] = print) -> None:
    """Write `report_lines`, one call per line."""
    for line in report_lines(header, manifest):
        write(line)
