"""The frame file: the registers of one frame, for a driver without the host (docs/driver.md), words of 32 bits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from colonnade.design.manifest import Manifest

MAGIC = b"CLNDFRAM"
VERSION = 1

_HEADER_WORDS = 16


def frame_file(registers: Mapping[str, int], manifest: Manifest) -> bytes:
    """The file that sets all rw registers of a frame.

    Args:
        registers: Values of `frame_registers`, by name.
        manifest: The design's manifest.
    """
    writes = [pair for name, value in registers.items() for pair in manifest.registers[name].encode(value)]
    digits = manifest.format_hash
    content = np.zeros(_HEADER_WORDS + 2 * len(writes), dtype="<u4")
    content[:2] = np.frombuffer(MAGIC, dtype="<u4")
    content[2:4] = VERSION, content.nbytes
    content[4:12] = [int(digits[start : start + 8], 16) for start in range(0, 64, 8)]
    content[12:15] = registers["frame.width"], registers["frame.height"], len(writes)
    content[_HEADER_WORDS:] = np.array(writes, dtype="<u4").reshape(-1)
    return content.tobytes()
