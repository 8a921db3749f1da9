"""Compares tags and hits in the memory of the simulated SoC with the bit-exact model's, byte by byte.

Usage: compare_rays.py FILES OUTPUT CONSOLE

FILES is the prefix of what examples/rays/batches.py has written, OUTPUT and CONSOLE come from simulation.py. The exit
status is 1 if a byte differs, of the results, of the files, or of what lies between, or if the processor saw others.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from memory import Memory, fail, require_seen, seen

#: Bit 31 of a tag.
FAILED = 1 << 31


def main() -> None:
    """Compare."""
    prefix, output, console = (Path(argument) for argument in sys.argv[1:])
    files = {name: prefix.with_name(f"{prefix.name}.{name}") for name in ("dram", "batches", "results")}
    memory = Memory(output)
    memory.require_files({"scene": files["dram"].read_bytes(), "batches": files["batches"].read_bytes()})
    memory.region("ring")
    found, expected = memory.region("results"), np.fromfile(files["results"], dtype=np.uint8)
    memory.require_untouched("ring and the results")

    batches = seen(console, r"batch \d+: .* tag ([0-9a-f]{8}), (\d+) cycles(, queued)?")
    crcs = seen(console, r"results: crc32 ([0-9a-f]{8})")
    if len(batches) != memory.layout["batch_count"] or len(crcs) != 1:
        fail(f"the program has ended {len(batches)} of {memory.layout['batch_count']} batches")
    if not any(queued for _, _, queued in batches):
        fail("no batch was queued while another ran")
    require_seen("the results", found, crcs[0])
    different = int(np.count_nonzero(found != expected))
    failed = sum(int(tag, 16) >= FAILED for tag, _, _ in batches)
    cycles = sorted(int(count) for _, count, _ in batches)
    print(
        f"soc: {different} of {len(expected)} bytes of the results of {len(batches)} batches differ from the model's;"
        f" {failed} of these failed, as intended; {cycles[failed]:,} to {cycles[-1]:,} cycles a batch"
    )
    raise SystemExit(1 if different else 0)


if __name__ == "__main__":
    main()
