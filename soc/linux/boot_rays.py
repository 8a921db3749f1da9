"""Boots Linux beside a Verilated shell for rays (machine.py), and compares tags and hits with the model's.

Usage: boot_rays.py KERNEL OUTPUT WIDTHxHEIGHT

OUTPUT has the folders of ``colonnade generate`` and ``registers``, torus.results of examples/rays/batches.py, and the
initramfs (tools/linux). It receives console.log. The device's memory is a display's of this size.
"""

from __future__ import annotations

import hashlib
import re
import sys
from pathlib import Path

from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from machine import Display, boot, fail


def main() -> None:
    """Boot, compare."""
    kernel, output = (Path(argument) for argument in sys.argv[1:3])
    width, height = (int(part) for part in sys.argv[3].split("x"))
    design = GeneratedDesign(output / "design", Manifest.load(output / "design"))
    tile = int(design.manifest.config["frame"]["tileSize"])
    seen = boot(kernel, output, design, Display(width, height, -(-width // tile) * tile * 4))
    log = output / "console.log"
    console = log.read_text(errors="replace")
    expected = (output / "torus.results").read_bytes()
    results, batches = (re.search(text, console) for text in (r"results: (\w+)", r"(\d+) batches, (\d+) bytes"))
    interrupts = re.search(r"interrupts: +\d+: +(\d+) ", console)
    if results is None or batches is None or interrupts is None:
        fail(f"Linux has not said what the device did: see {log}")
    # The image has one, batches that end together have one, and one that is acknowledged at once may pass unseen
    if min(len(seen.interrupts), int(interrupts[1])) < 2:
        fail(f"the device has raised {len(seen.interrupts)} interrupts, Linux has seen {interrupts[1]}: see {log}")
    version = re.search(r"Linux version (\S+)", console)
    is_same = results[1] == hashlib.sha256(expected).hexdigest() and int(batches[2]) == len(expected)
    print(
        f"linux: {version and version[1]}: tags and hits of {batches[1]} batches, {len(expected):,} bytes, "
        f"{'are' if is_same else 'differ from'} the model's; {interrupts[1]} interrupts"
    )
    raise SystemExit(0 if is_same else 1)


if __name__ == "__main__":
    main()
