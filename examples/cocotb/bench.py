"""A bench of ColonnadeAxi, or of the top with AXI4 ports, in cocotb: a frame in a memory, whose lines go to a file."""

from __future__ import annotations

import struct
from typing import Any

import cocotb
from device import IMAGE, SCENE, Job

FRAMEBUFFER = 0x80000
FRAME_DONE = 1  # interrupt
START = 1  # command


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def renders_a_frame(dut: Any) -> None:
    """Files come from the environment: see run.py."""
    job = Job(dut, "FRAME")
    device, memory = job.device, job.memory
    await device.reset()
    if "backdoor" not in cocotb.plusargs:
        assert IMAGE + job.files["IMAGE"].stat().st_size <= FRAMEBUFFER
        await job.load()

    # The words of a frame file: docs/driver.md
    words = [word for (word,) in struct.iter_unpack("<I", job.files["FRAME"].read_bytes())]
    width, height, count = words[12:15]
    for address, value in zip(words[16::2], words[17::2], strict=True):
        await device.write(device.base + 4 * address, value)
    assert len(words) == 16 + 2 * count
    await job.set_scene()
    stride = -(-width // device.tile) * device.tile * 4
    end = FRAMEBUFFER + stride * height
    assert end <= SCENE
    window = {
        "base": FRAMEBUFFER,
        "windowBase": FRAMEBUFFER,
        "windowEnd": end,
        "stride": stride,
        "format": 0,
    }
    for name, value in window.items():
        await device.set(f"framebuffer.{name}", value)
    print(f"frame: {await device.run(START, FRAME_DONE)} cycles")
    assert await device.get("framebuffer.errors") == 0
    await device.require_no_errors()
    lines = (memory.read(FRAMEBUFFER + stride * line, 4 * width) for line in range(height))
    job.end(b"".join(lines))
