"""Compares the memory of the simulated SoC with the bit-exact model, byte by byte, and writes the frame as a PNG.

Usage: compare.py DESIGN SCENE FRAME OUTPUT CONSOLE PICTURE

SCENE and FRAME come from ``colonnade pack``, OUTPUT and CONSOLE from simulation.py; PICTURE is written. The exit status
is 1 if a byte differs, of the frame, of the files, or of what lies between, or if the processor saw another frame.
"""

from __future__ import annotations

import json
import re
import sys
import zlib
from pathlib import Path

import numpy as np
from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.registers.frame_file import read_frame_file
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.file import SceneImage
from PIL import Image

XRGB8888 = 0
UNWRITTEN = 0xA5


def main() -> None:
    """Compare, write the picture."""
    design, scene, frame_path, output, console, picture = (Path(argument) for argument in sys.argv[1:])
    manifest = Manifest.load(design)
    frame = frame_path.read_bytes()
    image = SceneImage.load(scene, manifest)
    expected = framebuffer_bytes(render_model(manifest, image, read_frame_file(frame, manifest)), XRGB8888)
    layout = json.loads((output / "layout.json").read_text())
    words = (output / "gateware" / "memory.hex").read_text().split()
    memory = np.array([int(word, 16) for word in words if not word.startswith(("@", "//"))], dtype="<u4").view(np.uint8)

    files = {"frame": frame, "image": device_image(image, manifest)}
    if "scene" in layout:
        files["scene"] = dram_image(image, manifest)
    untouched = memory[layout["frame"] - layout["main_ram"] :].copy()
    for name in (*files, "framebuffer"):
        start, size = layout[name] - layout["frame"], layout[f"{name}_bytes"]
        if name in files and untouched[start : start + size].tobytes() != files[name]:
            raise SystemExit(f"soc: the {name} in memory has changed")
        untouched[start : start + size] = UNWRITTEN
    if (untouched != UNWRITTEN).any():
        raise SystemExit(f"soc: {np.count_nonzero(untouched != UNWRITTEN)} bytes outside the framebuffer were written")

    start = layout["framebuffer"] - layout["main_ram"]
    lines = memory[start : start + layout["framebuffer_bytes"]].reshape(layout["height"], layout["stride"])
    seen = re.search(rb"crc32 ([0-9a-f]{8})", console.read_bytes())
    if seen is None or int(seen[1], 16) != zlib.crc32(lines.tobytes()):
        raise SystemExit("soc: the processor does not see the frame that is in memory")
    shown = lines[:, : 4 * layout["width"]]
    pixels = shown.reshape(layout["height"], layout["width"], 4)
    Image.fromarray(np.ascontiguousarray(pixels[:, :, 2::-1])).save(picture)
    different = np.count_nonzero(shown != expected)
    print(f"soc: {different} of {shown.size} bytes of the framebuffer differ from the model's: {picture}")
    raise SystemExit(1 if different else 0)


if __name__ == "__main__":
    main()
