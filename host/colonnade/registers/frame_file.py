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
        registers: Values of `placed_registers`, by name.
        manifest: The design's manifest.
    """
    writes = [pair for name, value in registers.items() for pair in manifest.registers[name].encode(value)]
    content = np.zeros(_HEADER_WORDS + 2 * len(writes), dtype="<u4")
    content[:2] = np.frombuffer(MAGIC, dtype="<u4")
    content[2:4] = VERSION, content.nbytes
    content[4:12] = manifest.format_words
    content[12:15] = registers["frame.width"], registers["frame.height"], len(writes)
    content[_HEADER_WORDS:] = np.array(writes, dtype="<u4").reshape(-1)
    return content.tobytes()


def read_frame_file(content: bytes, manifest: Manifest) -> dict[str, int]:
    """The values of all registers that a file of this design sets, by name.

    Raises:
        ValueError: It is no frame file, one of another version or design, or not as long as it says.
    """
    words = np.frombuffer(content[: len(content) // 4 * 4], dtype="<u4")
    if content[:8] != MAGIC or len(words) < _HEADER_WORDS or words[2] != VERSION:
        raise ValueError("this is no frame file")
    if words[4:12].tolist() != manifest.format_words:
        raise ValueError("this frame file is for another design")
    pairs = words[_HEADER_WORDS:]
    if words[3] != len(content) or len(pairs) != 2 * words[14]:
        raise ValueError("this frame file is incomplete")
    written = dict(zip(pairs[::2].tolist(), pairs[1::2].tolist(), strict=True))
    return {
        register.name: register.decode([written[register.address + word] for word in range(register.words)])
        for register in manifest.registers.values()
        if register.access == "rw"
    }
