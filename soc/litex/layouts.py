"""Where programs of the simulated SoC, their files and what they write lie in the main memory."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

import view_places

MAIN_RAM = 0x4000_0000
MAIN_RAM_BYTES = 1 << 21
#: Every byte of the memory behind the program that no file has.
UNWRITTEN = 0xA5
PAGE = 4096
#: The program is at the beginning of the memory; then come files and regions, with a page between.
PROGRAM_BYTES = 1 << 17

#: Frames of the orbit, an eighth of a turn each, and what the program records of one.
FRAMES = 8
RECORD_BYTES = 1 << 13

#: The ring of batches has 2^RING_LOG slots of 64 bytes, of which all but one take batches.
RING_LOG = 2
#: Where the header of examples/rays/batches.py has the numbers of batches and of bytes of results.
COUNTS = 60

Sizes = dict[str, int]


def _frames(files: Mapping[str, bytes]) -> tuple[Sizes, Sizes]:
    width, height = struct.unpack_from("<2I", files["view"], 4 * view_places.WIDTH)
    stride = -(-width // 16) * 16 * 4
    numbers = {"frames": FRAMES, "width": width, "height": height, "stride": stride}
    numbers |= {"record_bytes": RECORD_BYTES, "frame_bytes": stride * height}
    return numbers, {"records": FRAMES * RECORD_BYTES, "framebuffers": FRAMES * stride * height}


def _rays(files: Mapping[str, bytes]) -> tuple[Sizes, Sizes]:
    batches, results = struct.unpack_from("<2I", files["batches"], COUNTS)
    return {"ring_log": RING_LOG, "batch_count": batches}, {"ring": 64 << RING_LOG, "results": results}


#: By program: numbers that it knows, and bytes of the regions that it or the device writes.
PROGRAMS: dict[str, Callable[[Mapping[str, bytes]], tuple[Sizes, Sizes]]] = {"frames": _frames, "rays": _rays}


def memory_layout(program: str, files: Mapping[str, bytes]) -> Sizes:
    """Numbers, addresses and sizes for a program; every file and region has an untouched page behind it."""
    layout, regions = PROGRAMS[program](files)
    place = MAIN_RAM + PROGRAM_BYTES
    for name, size in {**{name: len(file) for name, file in files.items()}, **regions}.items():
        layout |= {name: place, f"{name}_bytes": size}
        place += -(-size // PAGE) * PAGE + PAGE
    if place > MAIN_RAM + MAIN_RAM_BYTES:
        raise SystemExit(f"files and regions need {place - MAIN_RAM} bytes, the memory has {MAIN_RAM_BYTES}")
    return layout
