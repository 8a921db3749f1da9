"""Compares the memory of the simulated SoC with the bit-exact model, byte by byte, and writes the frames as a PNG.

Usage: compare_frames.py DESIGN SCENE VIEW OUTPUT CONSOLE PICTURE

SCENE and VIEW come from ``colonnade pack``, OUTPUT and CONSOLE from simulation.py; PICTURE is written. The exit status
is 1 if a byte differs, of the frames, of the registers that the processor computed, of the files, or of what lies
between, if the camera left its orbit, or if the processor saw other frames.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import view_places
from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.registers.target_view import TargetView
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.file import SceneImage
from memory import Memory, fail, require_seen, seen
from PIL import Image

XRGB8888 = 0
#: The program's ``struct record``: camera, light, number of words, and then the words.
RECORD = struct.Struct("<3q9i4x4q2I 3q3I4xQ I")
METRE, ONE = 1 << 32, 1 << 30
#: Of the orbit's poses, in parts of the distance, and of 1.
TOLERANCE = 2.0**-26
FRAMES_IN_A_ROW = 4


def record(memory: Memory, index: int) -> tuple[list[int], list[tuple[int, int]]]:
    """Camera and light of a frame, and the words that were set."""
    address = memory.layout["records"] + index * memory.layout["record_bytes"]
    *poses, count = RECORD.unpack(memory.take(address, RECORD.size).tobytes())
    words = memory.take(address + RECORD.size, 8 * count).view("<u4").reshape(count, 2)
    return poses, [(int(place), int(value)) for place, value in words]


def check_orbit(poses: list[int], start: list[int], centre: list[int], turns: float) -> None:
    """The camera looks at the object from the place of the start, turned around its upright axis; so does the light."""
    angle = 2 * np.pi * turns
    turned = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for first in (0, 18):
        begin, found = (np.array(values[first : first + 3]) - centre for values in (start, poses))
        if np.abs(turned @ begin - found).max() > TOLERANCE * np.linalg.norm(begin):
            fail(f"camera or light is not where a turn of {360 * turns:.0f} degrees brings it")
    begin, found = (np.array(values[3:12]).reshape(3, 3) / ONE for values in (start, poses))
    if np.abs(turned @ begin - found).max() > TOLERANCE or poses[12:18] != start[12:18]:
        fail("the camera looks elsewhere, or its lens has changed")


def main() -> None:
    """Compare, write the picture."""
    design, scene, view_path, output, console, picture = (Path(argument) for argument in sys.argv[1:])
    manifest = Manifest.load(design)
    view, memory = view_path.read_bytes(), Memory(output)
    layout, image = memory.layout, SceneImage.load(scene, manifest)
    files = {"view": view, "image": device_image(image, manifest)}
    if "scene" in layout:
        files["scene"] = dram_image(image, manifest)
    memory.require_files(files)

    target = TargetView(view, manifest)
    centre = list(struct.unpack_from("<3q", view, 4 * view_places.OBJECT))
    crcs = dict(seen(console, r"frame (\d+): crc32 ([0-9a-f]{8})"))
    start = [*struct.unpack_from("<3q9i4q2I", view, 4 * view_places.CAMERA)]
    start += struct.unpack_from("<3q3IQ", view, 4 * view_places.LIGHT)
    different, frames = 0, []
    for index in range(layout["frames"]):
        poses, words = record(memory, index)
        check_orbit(poses, start, centre, index / 8)
        target.set_camera(poses[0:3], poses[3:12], poses[12:16], (poses[16], poses[17]))
        target.set_light(0, poses[18:21], poses[21:24], poses[24])
        if target.writes() != words:
            fail(f"the processor has computed other registers of frame {index} than the host")
        expected = framebuffer_bytes(render_model(manifest, image, target.accept(words)), XRGB8888)
        lines = memory.take(layout["framebuffers"] + index * layout["frame_bytes"], layout["frame_bytes"])
        require_seen(f"frame {index}", lines, crcs.get(str(index).encode(), b"0"))
        frames.append(lines.reshape(layout["height"], layout["stride"])[:, : 4 * layout["width"]])
        different += int(np.count_nonzero(frames[-1] != expected))
    memory.require_untouched("framebuffers")

    pixels = [frame.reshape(layout["height"], layout["width"], 4)[:, :, 2::-1] for frame in frames]
    rows = [np.hstack(pixels[at : at + FRAMES_IN_A_ROW]) for at in range(0, len(pixels), FRAMES_IN_A_ROW)]
    Image.fromarray(np.ascontiguousarray(np.vstack(rows))).save(picture)
    size = sum(frame.size for frame in frames)
    print(f"soc: {different} of {size} bytes of {len(frames)} framebuffers differ from the model's: {picture}")
    raise SystemExit(1 if different else 0)


if __name__ == "__main__":
    main()
