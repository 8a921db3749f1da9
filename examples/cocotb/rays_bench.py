"""A bench of a device for rays in cocotb: batches in a ring, whose tags and hits go to a file."""

from __future__ import annotations

import struct
from typing import Any

import cocotb
from cocotb.utils import get_sim_time
from device import IMAGE, SCENE, Job, cycles_since

RING, BATCHES = 0x80000, 0x80400
RING_LOG = 4  # of its slots, of which all but one take batches
HEADER_BYTES, BATCH_BYTES, LINE_BYTES = 128, 64, 64
BATCH_DONE = 1  # interrupt


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def traces_batches(dut: Any) -> None:
    """Files come from the environment: see run.py, and examples/rays/batches.py for what BATCHES has."""
    job = Job(dut, "BATCHES")
    device, memory = job.device, job.memory
    content = job.files["BATCHES"].read_bytes()
    registers = struct.unpack_from("<14I", content)
    records, count, size, unwritten = struct.unpack_from("<4I", content, 4 * len(registers))
    results = BATCHES + -(-len(content) // LINE_BYTES) * LINE_BYTES
    assert count < 1 << RING_LOG and results + size <= SCENE
    assert IMAGE + job.files["IMAGE"].stat().st_size <= RING
    memory.write(BATCHES, content)
    memory.write(results, unwritten.to_bytes(4, "little") * (size // 4))
    # Addresses in the file count from its beginning, or the results'
    for number in range(count):
        batch = bytearray(content[HEADER_BYTES + BATCH_BYTES * number :][:BATCH_BYTES])
        for word, base in ((0, BATCHES), (8, results), (48, results)):
            struct.pack_into("<Q", batch, word, struct.unpack_from("<Q", batch, word)[0] + base)
        memory.write(RING + BATCH_BYTES * number, bytes(batch))

    await device.reset()
    await job.load()
    await job.set_scene()
    for name, values in (("bounds.low.x", registers[:6]), ("placement.mantissa", registers[6:])):
        for word, value in enumerate(values):
            await device.write(device.addresses[name] + 4 * word, value)
    for name, value in (("scene.recordCount", records), ("ring.base", RING), ("ring.sizeLog", RING_LOG)):
        await device.write(device.addresses[name], value)
    await device.set("rays.windowBase", RING)
    await device.set("rays.windowEnd", results + size)
    await device.write(device.addresses["control.start"], 1)
    before = memory.read(0, results), memory.read(results + size, memory.size - results - size)

    await device.set("interrupt.status", 7)
    await device.set("interrupt.enable", BATCH_DONE)
    begin = get_sim_time("ns")
    await device.write(device.addresses["rays.tail"], count)
    ended = 0
    while ended < count:
        await device.interrupt()
        await device.set("interrupt.status", 7)
        ended = await device.read(device.addresses["rays.head"])
        print(f"batches: {ended} of {count} after {cycles_since(begin)} cycles")
    after = memory.read(0, results), memory.read(results + size, memory.size - results - size)
    assert before == after, "a byte outside the results was written"
    job.end(memory.read(results, size))
