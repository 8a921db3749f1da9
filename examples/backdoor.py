"""Files that put the records of a device image into the column memories of a simulated design, without a load.

usage: backdoor.py DESIGN IMAGE OUTPUT

DESIGN is a folder of `colonnade generate --axi BYTES`, IMAGE a device image of `colonnade pack`. OUTPUT receives
bankB.hex, which $readmemh reads, and backdoor.sv, a module that reads them if the simulator has +backdoor=OUTPUT.

Record r is in bank r mod banks, word r div banks, of every column; its first byte is in the low bits.
"""

from __future__ import annotations

import json
import re
import struct
import sys
from pathlib import Path

HEADER = 128  # bytes
SECTION = 16


def main(design: Path, image: Path, output: Path) -> None:
    """Write the files."""
    manifest = json.loads((design / "manifest.json").read_text())
    columns, memory = (
        manifest["config"]["array"]["columns"],
        manifest["memories"]["columnBvh"],
    )
    content = image.read_bytes()
    if content[:8] != b"CLNDLOAD" or len(content) != struct.unpack_from("<I", content, 12)[0]:
        sys.exit(f"{image} is not a device image")
    (sections,) = struct.unpack_from("<I", content, 48)
    target, count = struct.unpack_from("<2I", content, HEADER) if sections else (None, 0)
    if target != 0 or sections > 1:
        sys.exit(f"{image} holds the maps of a room, or no records: load it through the bus")
    record, banks = 4 * -(-memory["bits"] // 32), memory["banks"]
    output.mkdir(parents=True, exist_ok=True)
    for bank in range(banks):
        starts = range(
            HEADER + SECTION + bank * record,
            HEADER + SECTION + count * record,
            banks * record,
        )
        lines = [content[start : start + record][::-1].hex() for start in starts]
        (output / f"bank{bank}.hex").write_text("".join(f"{line}\n" for line in lines))
    source = (design / "ColumnBvhMemory.sv").read_text()
    (output / "backdoor.sv").write_text(module(columns, re.findall(r"^  records_\w+ (\w+) \($", source, re.MULTILINE)))


def module(columns: int, banks: list[str]) -> str:
    """A second top module for Icarus Verilog, which has no bind; part of ColonnadeAxi elsewhere."""
    reads = [
        f'      $readmemh({{folder, "/bank{bank}.hex"}}, ColonnadeAxi.device.columns_{column}.memory.{name}.Memory);'
        for column in range(columns)
        for bank, name in enumerate(banks)
    ]
    return "\n".join(
        [
            "module colonnade_backdoor;",
            "  string folder;",
            "  initial",
            '    if ($value$plusargs("backdoor=%s", folder)) begin',
            *reads,
            "    end",
            "endmodule",
            "`ifndef __ICARUS__",
            "bind ColonnadeAxi colonnade_backdoor backdoor ();",
            "`endif",
            "",
        ]
    )


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
