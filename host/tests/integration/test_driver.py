"""The C driver: errors by name, waits, random inputs, frames of a simulated device, and warnings of three compilers."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from c_programs import DRIVER, DRIVER_FOLDER, RISCV, WARNINGS, compile_c, compile_test, driver_objects
from colonnade_lab.evaluation.demonstration.walk import walk_scene, write_walk
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room
from driver_runs import CACHE, PAGE, UNWRITTEN, run_driver, run_silently
from numpy.typing import NDArray

from colonnade.common.framebuffer import Frame
from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes, photo_lines
from colonnade.common.image_io import resized_photo
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.environment.sequence import load_sequence
from colonnade.integration.design_header import design_header
from colonnade.integration.register_table import register_table
from colonnade.maps.encoded import layout_of
from colonnade.maps.live import LiveEncoder, LiveFrame
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.frame_file import frame_file
from colonnade.registers.target_view import TargetView
from colonnade.render.sequence_frames import sequence_scenes
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.device_image import device_image, load_cycles, maps_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.packer import pack

WIDTH, HEIGHT = 28, 21


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", ("array.columns=2",), bus_bytes=16)


@pytest.fixture(scope="module")
def stub() -> Path:
    return compile_test("stub", "shell")


TESTS = (
    "probe",
    "images",
    "frames",
    "photos",
    "scenes",
    "names",
    "events",
    "posted writes",
    "long frame files",
    "maps",
)


@pytest.mark.parametrize("test", (*TESTS, "refused frame files"))
def test_the_driver_against_a_shell_that_refuses(stub: Path, test: str) -> None:
    run_silently(stub, test)


def test_a_wait_by_interrupts_enables_its_events_and_leaves_the_others_as_they_were() -> None:
    """No sleep waits for an interrupt that nobody has enabled, and attempts bound the sleeps."""
    run_silently(compile_test("waits", "shell"))


def test_a_refit_by_the_unit_is_refused_or_waited_for() -> None:
    run_silently(compile_test("refit_unit", "shell"))


def test_batches_take_the_places_of_their_ring_in_turn() -> None:
    run_silently(compile_test("batches", "shell"))


@pytest.mark.parametrize(
    "names",
    [("fuzz", "shell"), ("fuzz_view",), ("fuzz_mesh",), ("fuzz_motion",)],
    ids=["driver", "registers from poses", "meshes that bend", "objects that move"],
)
def test_random_inputs_of_the_fuzzers_break_nothing(names: tuple[str, ...]) -> None:
    """Also without libFuzzer: calls in any order, view files of legal and extreme numbers, tiles of any size."""
    run_silently(compile_test(*names, options=("-DRUNS=5000", "-lm")))


@pytest.mark.parametrize("compiler", ["gcc", "clang", f"{RISCV} -march=rv32im -mabi=ilp32"])
def test_the_driver_compiles_without_a_warning(compiler: str, tmp_path: Path) -> None:
    """Without a library, too."""
    if shutil.which(compiler.split()[0]) is None:
        pytest.skip(f"no {compiler.split()[0]}")
    for source in DRIVER:
        command = [
            *compiler.split(),
            *WARNINGS,
            "-O2",
            "-ffreestanding",
            f"-I{DRIVER_FOLDER / 'include'}",
            "-c",
            source,
        ]
        run_silently(*command, "-o", tmp_path / f"{source.stem}.o")


def test_the_linux_example_compiles(tmp_path: Path, design: GeneratedDesign) -> None:
    (tmp_path / "colonnade_design.h").write_text(design_header(register_table(design), design.manifest))
    linux = [DRIVER_FOLDER / "examples" / name for name in ("target.c", "target_files.c", "target_uio.c")]
    for name, options in (("uio", ()), ("viewer", ("-lm",))):
        program = compile_c(
            [DRIVER_FOLDER / "examples" / f"{name}.c", *linux, *driver_objects()], tmp_path / name, *options
        )
        done = subprocess.run([program, "uio9", "none", "none"], capture_output=True, text=True)
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1


def take_file(memory: NDArray[np.uint8], place: int, content: bytes) -> None:
    """Check that a file is in the memory, and erase it."""
    assert memory[place : place + len(content)].tobytes() == content
    memory[place : place + len(content)] = UNWRITTEN


def take_frame(memory: NDArray[np.uint8], line: list[str], expected: Frame, code: int) -> None:
    """Check that a frame is in the memory, and erase it."""
    _, place, stride, _, hits = line
    lines = memory[int(place) : int(place) + int(stride) * HEIGHT].reshape(HEIGHT, int(stride))
    used = lines[:, : WIDTH * PIXEL_BYTES[code]]
    np.testing.assert_array_equal(used, framebuffer_bytes(expected, code))
    used[:] = UNWRITTEN
    assert int(hits) == expected.counters["hits"]


def of_another_format(image: bytes) -> bytes:
    return image[:44] + bytes([image[44] ^ 1]) + image[45:]


#: A design, and how the driver waits.
CASES = {
    "by interrupts": ((), "interrupt"),
    "by polling": ((), "poll"),
    "scene in DRAM": ((f"columnBvhMemory.cache={json.dumps(CACHE)}",), "interrupt"),
}


@pytest.mark.parametrize("case", CASES)
def test_frames_by_the_driver_are_those_of_the_model(tmp_path: Path, case: str) -> None:
    """Bad images are refused by name, and no byte outside the windows changes."""
    overrides, mode = CASES[case]
    design = shell_design_for("tiny", ("array.columns=2", *overrides), bus_bytes=16)
    manifest = design.manifest
    image = pack(load_mesh("torus"), manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("torus")
    registers = frame_registers(scene, image.header, manifest, WIDTH, HEIGHT)
    expected = render_model(manifest, image, registers)
    data = device_image(image, manifest)
    files = {"image": data, "other": of_another_format(data), "frame": frame_file(registers, manifest)}
    files |= {"scene": dram_image(image, manifest)} if overrides else {}
    memory, lines = run_driver(tmp_path, design, files, "image", "frame", mode, *(["scene"] if overrides else []))
    take_file(memory, PAGE, data)
    if overrides:
        take_file(memory, int(lines.pop(0)[1]), files["scene"])
    for code, line in zip((0, 1, 2, 0), lines, strict=True):
        take_frame(memory, line, expected, code)
    assert (memory == UNWRITTEN).all()


ROOM_SCENE = """
mesh.name = "torus"
background = {{room = "rooms/{room}", colours = "albedo"}}
object.size = 0.5
material.kind = "mirror"
paths.bounces = 1
light.position = [0.1, 2.0, 1.0]
"""


MAPS = {"width": 96, "height": 72, "mapBytes": 4096, "planeBytes": 4096}
MAP_OVERRIDES = ("array.columns=2", "frame.maxBounces=1", f"physicalAttributeMemory={json.dumps(MAPS)}")


@pytest.mark.matrix
@pytest.mark.parametrize("mode", ["interrupt", "poll"])
def test_maps_of_another_view_are_loaded_between_frames(tmp_path: Path, mode: str) -> None:
    """The frame after that is the one of a device that has never had others; a soft reset keeps the maps."""
    design = shell_design_for("tiny", MAP_OVERRIDES, bus_bytes=16)
    manifest = design.manifest
    views = []
    for name, walked in (("first", 0.0), ("second", 0.4)):
        write_room(tmp_path / "rooms" / name, generated_room(4, MAPS["width"], MAPS["height"], walked).environment)
        (tmp_path / f"{name}.toml").write_text(ROOM_SCENE.format(room=name))
        views.append(DeviceScene.of(load_scene(tmp_path / f"{name}.toml"), manifest, encoder="live"))
    registers = [view.registers((WIDTH, HEIGHT)) for view in views]
    expected = [render_model(manifest, view.image, of_view) for view, of_view in zip(views, registers, strict=True)]
    data, (first, second) = device_image(views[0].image, manifest), (frame_file(each, manifest) for each in registers)
    assert views[1].maps is not None
    loaded = maps_image(views[1].maps.image, manifest)
    assert len(loaded) < len(data) and not np.array_equal(*(frame.colour for frame in expected))
    files = {"image": data, "other": of_another_format(data), "frame": first, "second": second}
    files |= {"maps": loaded, "other-maps": of_another_format(loaded)}
    memory, lines = run_driver(tmp_path, design, files, "image", "frame", mode, "maps", "other-maps", "second")
    take_file(memory, PAGE, data)
    (stored,) = (line for line in lines if line[0] == "stored")
    take_file(memory, int(stored[1]), loaded)
    lines.remove(stored)
    for code, view, line in zip((0, 1, 2, 0, 0), (0, 0, 0, 1, 1), lines, strict=True):
        take_frame(memory, line, expected[view], code)
    assert (memory == UNWRITTEN).all()


@pytest.mark.parametrize(
    ("every", "frames"),
    [pytest.param(1, 3, marks=pytest.mark.matrix), (2, 4), pytest.param(4, 6, marks=pytest.mark.matrix)],
)
def test_frames_of_a_moving_camera_are_those_of_the_model(tmp_path: Path, every: int, frames: int) -> None:
    """The first frames of a demonstration: maps of each keyframe, registers from poses or from files, photos."""
    size, design = (48, 36), shell_design_for("tiny", MAP_OVERRIDES, bus_bytes=16)
    manifest = design.manifest
    sequence = load_sequence(write_walk(tmp_path / "room", (MAPS["width"], MAPS["height"]), 12))
    scene = walk_scene(MAPS["width"], MAPS["height"])
    (tmp_path / "scene.toml").write_text(f"{scene}paths.bounces = 1\n")
    encoder = LiveEncoder(layout_of(manifest))
    scenes = sequence_scenes(
        sequence,
        load_scene(tmp_path / "scene.toml"),
        manifest,
        size,
        lambda room: encoder.encode(LiveFrame.of(room)).image,
        every=every,
    )
    files, expected, loads = dict[str, bytes](), list[NDArray[np.uint8]](), list[int]()
    for number, prepared in enumerate(islice(scenes, frames)):
        if number == 0:
            files["image"] = device_image(prepared.image, manifest)
        assert prepared.maps is not None and prepared.photo is not None
        loads.append(0)
        if number % every == 0:
            files[f"maps.{number}"] = maps_image(prepared.maps.image, manifest)
            loads[-1] = load_cycles(prepared.maps.image, manifest)
            files[f"view.{number}"] = prepared.view_file(size, composited=True)
            registers = TargetView(files[f"view.{number}"], manifest).registers()
        else:
            registers = prepared.registers(size, composited=True)
            files[f"frame.{number}"] = frame_file(registers, manifest)
        assert registers["environment.isMapCamera"] == int(number % every == 0)
        strength = np.arange(size[0] * size[1], dtype=np.uint8).reshape(size[1], size[0])
        photo = np.dstack([resized_photo(prepared.photo, *size), strength])
        lines = photo_lines(photo, 16)
        files[f"photo.{number}"] = lines.tobytes()
        frame = render_model(manifest, prepared.image, registers)
        expected.append(framebuffer_bytes(frame, 0, photo))
        assert (expected[-1] != framebuffer_bytes(frame, 0)).any() and (
            expected[-1].reshape(lines.shape) != lines
        ).any()
    memory, printed = run_driver(tmp_path, design, files, "image", str(frames), program="live")
    for line, wanted, load in zip(printed, expected, loads, strict=True):
        _, place, stride, _, loading, _, rendering = line
        found = memory[int(place) : int(place) + int(stride) * size[1]].reshape(size[1], int(stride))
        np.testing.assert_array_equal(found[:, : wanted.shape[1]], wanted)
        assert load <= int(loading) <= 1.2 * load and int(rendering) > 0
    assert len({each.tobytes() for each in expected}) == frames
