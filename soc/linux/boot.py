"""Boots Linux beside a Verilated shell (machine.py), and compares what its display shows with the model.

Usage: boot.py KERNEL OUTPUT WIDTHxHEIGHT FRAMES

OUTPUT has the folders of ``colonnade generate``, ``registers`` and ``pack``, and the initramfs (tools/linux). It
receives console.log, console.png, orbit.png. The exit status is 1 if a byte differs, or Linux sees another display or
other maps.
"""

from __future__ import annotations

import hashlib
import math
import re
import struct
import sys
from pathlib import Path

import numpy as np
from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.registers.target_view import TargetView
from colonnade.scene_image.file import SceneImage
from machine import PIXELS, REGISTER_BYTES, REGISTERS, Display, Run, boot, fail
from numpy.typing import NDArray
from PIL import Image

#: Words of a view file: positions and rotations of object and camera (docs/driver.md).
OBJECT, CAMERA = 45, 60
METRE, ONE = 1 << 32, 1 << 30
#: How `init` moves the torus, millimetres.
MOTION = (100, 0, -50)
FRAMES_IN_A_ROW = 3


def orbit(view: TargetView, file: bytes, size: tuple[int, int], azimuth: float) -> None:
    """Move the camera around the middle of the picture, by radians around the upright axis, as viewer.c does."""
    middle = struct.unpack_from("<3q", file, 4 * OBJECT)
    camera = struct.unpack_from("<3q9i4q", file, 4 * CAMERA)
    position, axes = np.array(camera[:3]) / METRE, np.array(camera[3:12]).reshape(3, 3).T / ONE
    depth = float(axes[2] @ (np.array(middle) / METRE - position))
    c, s = math.cos(azimuth), math.sin(azimuth)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    placed = position + depth * axes[2] - turn @ (depth * axes[2])
    view.set_camera(
        [round(value * METRE) for value in placed.tolist()],
        [round(value * ONE) for value in (turn @ axes.T).ravel().tolist()],
        camera[12:16],
        size,
    )


def expected_frames(output: Path, manifest: Manifest, size: tuple[int, int], frames: int) -> list[NDArray[np.uint8]]:
    """Of the model: the orbit around the teapot, then the torus that moved by (100, 0, -50) mm."""
    found = list[NDArray[np.uint8]]()
    for mesh, views in (("teapot", frames), ("torus", 1)):
        image = SceneImage.load(output / mesh, manifest)
        file = (output / "image" / f"{mesh}.view").read_bytes()
        view = TargetView(file, manifest)
        for number in range(views):
            if number:
                orbit(view, file, size, 2 * math.pi * number / views)
            if mesh == "torus":
                position, rotation = np.split(np.array(struct.unpack_from("<3q9i", file, 4 * OBJECT)), [3])
                moved = position + [METRE * part // 1000 for part in MOTION]
                view.set_object(moved.tolist(), rotation.tolist())
            found.append(framebuffer_bytes(render_model(manifest, image, view.registers()), 0))
    return found


def check_console(console: str, display: Display, frames: int, seen: Run, torus: NDArray[np.uint8]) -> None:
    """What Linux has printed about display and device is what the device tree says, and it sees the same bytes."""
    found = dict(re.findall(r"^(display|map0|map1|interrupts|torus\.xrgb|fb0): (.*?)\r?$", console, re.MULTILINE))
    expected = {
        "display": f"simple {display.width},{display.height} {display.stride} 32",
        "map0": f"{REGISTERS:#018x} {REGISTER_BYTES:#018x}",
        "map1": f"{PIXELS:#018x} {display.size:#018x}",
        "torus.xrgb": hashlib.sha256(torus.tobytes()).hexdigest() + "  -",
        "fb0": hashlib.sha256(seen.end).hexdigest() + "  -",
    }
    for name, value in expected.items():
        if " ".join(found.get(name, "nothing").split()) != " ".join(value.split()):
            fail(f"{name}: Linux has {found.get(name, 'nothing')}, not {value}: see console.log")
    interrupts = re.match(r"\d+: +(\d+) ", found.get("interrupts", "").strip())
    if interrupts is None or int(interrupts[1]) < len(seen.interrupts):
        fail(f"Linux has seen fewer than {len(seen.interrupts)} interrupts: {found.get('interrupts')}")
    driver = f"format=x8r8g8b8, mode={display.width}x{display.height}x32, linelength={display.stride}"
    for line in (driver, f"{frames} frames of {display.width}x{display.height}, "):
        if line not in console:
            fail(f"Linux has not said {line!r}: see console.log")


def main() -> None:
    """Boot, compare, write the pictures."""
    kernel, output = (Path(argument) for argument in sys.argv[1:3])
    width, height = (int(part) for part in sys.argv[3].split("x"))
    frames = int(sys.argv[4])
    design = GeneratedDesign(output / "design", Manifest.load(output / "design"))
    tile = int(design.manifest.config["frame"]["tileSize"])
    display = Display(width, height, -(-width // tile) * tile * 4)
    images = [(output / "image" / f"{mesh}.image").read_bytes() for mesh in ("teapot", "torus")]
    if max(map(len, images)) > display.size:
        fail(f"an image has {max(map(len, images))} bytes, the display {display.size}: take a larger one")
    seen = boot(kernel, output, design, display)
    log = output / "console.log"
    if not seen.console:
        fail(f"Linux has ended without an access to the device: see {log}")
    Image.fromarray(np.ascontiguousarray(display.colours(seen.console))).save(output / "console.png")
    # The first interrupt of a program is its image's, whose bytes lie in the framebuffer then
    kinds = [images[0], *[None] * frames, images[1], None]
    if len(seen.interrupts) != len(kinds):
        fail(f"{len(seen.interrupts)} interrupts in place of {len(kinds)}: see {log}")
    displayed = list[bytes]()
    for content, image in zip(seen.interrupts, kinds, strict=True):
        if image is None:
            displayed.append(content)
        elif not content.startswith(image):
            fail("an image in memory is not its file")
    console = log.read_text(errors="replace")
    expected = expected_frames(output, design.manifest, (width, height), frames)
    check_console(console, display, frames, seen, expected[-1])
    different = sum(
        int((display.pixels(a) != b).reshape(height, width, 4).any(axis=2).sum())
        for a, b in zip(displayed, expected, strict=True)
    )
    picture = output / "orbit.png"
    pictures = [display.colours(content) for content in displayed]
    pictures += [np.zeros_like(pictures[0])] * (-len(pictures) % FRAMES_IN_A_ROW)
    rows = [np.hstack(pictures[at : at + FRAMES_IN_A_ROW]) for at in range(0, len(pictures), FRAMES_IN_A_ROW)]
    Image.fromarray(np.ascontiguousarray(np.vstack(rows))).save(picture)
    kernel_version = re.search(r"Linux version (\S+)", console)
    found = f"{different} of {width * height * len(displayed)} pixels of {len(displayed)} frames"
    print(f"linux: {kernel_version and kernel_version[1]}: {found} on the display differ from the model's: {picture}")
    raise SystemExit(1 if different else 0)


if __name__ == "__main__":
    main()
