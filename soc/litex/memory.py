"""The main memory of the simulated SoC at the end of its simulation."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import layouts
import numpy as np


def fail(why: str) -> NoReturn:
    """End with status 1."""
    raise SystemExit(f"soc: {why}")


def seen(console: Path, what: str) -> list[tuple[bytes, ...]]:
    """The groups of a pattern in what the program has printed."""
    return re.findall(what.encode(), console.read_bytes())


class Memory:
    """What lies behind the program, by the layout that simulation.py has written."""

    def __init__(self, output: Path) -> None:
        self.layout: dict[str, int] = json.loads((output / "layout.json").read_text())
        words = (output / "gateware" / "memory.hex").read_text().split()
        values = [int(word, 16) for word in words if not word.startswith(("@", "//"))]
        self._bytes = np.array(values, dtype="<u4").view(np.uint8)
        self._explained = np.zeros(len(self._bytes), dtype=bool)
        self._explained[: layouts.PROGRAM_BYTES] = True

    def take(self, address: int, size: int) -> Any:
        """Bytes that may have been written."""
        place = slice(address - layouts.MAIN_RAM, address - layouts.MAIN_RAM + size)
        self._explained[place] = True
        return self._bytes[place]

    def region(self, name: str) -> Any:
        """A whole file or region of the layout, which may have been written."""
        return self.take(self.layout[name], self.layout[f"{name}_bytes"])

    def require_files(self, files: Mapping[str, bytes]) -> None:
        """Fail unless the files are as they were put there."""
        for name, content in files.items():
            if self.region(name).tobytes() != content:
                fail(f"the file {name} has changed in memory")

    def require_untouched(self, regions: str) -> None:
        """Fail if a byte has changed that was never taken."""
        count = int(np.count_nonzero((self._bytes != layouts.UNWRITTEN) & ~self._explained))
        if count:
            fail(f"{count} {'byte' if count == 1 else 'bytes'} outside the {regions} changed")


def require_seen(name: str, content: Any, crc32: bytes) -> None:
    """Fail unless the processor has seen bytes as they are in memory, by the CRC-32 that it has printed."""
    if int(crc32, 16) != zlib.crc32(content.tobytes()):
        fail(f"the processor does not see {name} as in memory")
