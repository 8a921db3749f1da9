"""The records of a scene as a design with a cache reads them from DRAM (docs/scene-cache.md): lines at a pitch."""

from __future__ import annotations

import numpy as np

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.scene_image.file import Loads

#: The address of the records is a multiple of this; register ``dram.page`` counts in it.
PAGE_BYTES = 4096


def line_layout(manifest: Manifest) -> dict[str, int]:
    """``records`` of a line, its ``bytes``, and the ``pitch`` of lines in bytes.

    Raises:
        UserError: The design holds the records on chip.
    """
    line: dict[str, int] | None = manifest.memories["columnBvh"].get("line")
    if line is None:
        raise UserError("this configuration reads no DRAM: a DRAM image needs columnBvhMemory.cache")
    return line


def moved_bytes(manifest: Manifest) -> int:
    """Bytes that the DRAM port moves for a line: whole beats of ``columnBvhMemory.cache.busBytes``.

    Raises:
        UserError: See `line_layout`.
    """
    bus = int(manifest.config["columnBvhMemory"]["cache"]["busBytes"])
    return -(-line_layout(manifest)["bytes"] // bus) * bus


def dram_lines(records: int, manifest: Manifest) -> int:
    """Lines of so many records, in whole pairs, as the device reads them; see `line_layout`."""
    return 2 * -(-records // (2 * line_layout(manifest)["records"]))


def dram_image(image: Loads, manifest: Manifest) -> bytes:
    """All lines of a scene; bytes between them are 0.

    Raises:
        UserError: See `line_layout`.
    """
    line = line_layout(manifest)
    count, size = image.records.shape
    lines = dram_lines(count, manifest)
    records = np.zeros((lines * line["records"], size), dtype=np.uint8)
    records[:count] = image.records
    content = np.zeros((lines, line["pitch"]), dtype=np.uint8)
    content[:, : line["bytes"]] = records.reshape(lines, -1)
    return content.tobytes()
