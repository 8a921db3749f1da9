"""The C driver: errors by name, waits, random inputs, frames of a simulated device, and warnings of three compilers."""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from c_programs import DRIVER, DRIVER_FOLDER, RISCV, WARNINGS, compile_c, compile_test, driver_objects, scratch
from colonnade_lab.evaluation.demonstration.walk import walk_scene, write_walk
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from colonnade.common.framebuffer import Frame
from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes, photo_lines
from colonnade.common.image_io import resized_photo
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.packed_objects import MovingInstances
from colonnade.device.scene import DeviceScene
from colonnade.device.shell_build import build_shell_simulator
from colonnade.environment.sequence import load_sequence
from colonnade.integration.design_header import design_header
from colonnade.integration.register_table import register_table
from colonnade.maps.encoded import layout_of
from colonnade.maps.live import LiveEncoder, LiveFrame
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.frame_file import frame_file
from colonnade.registers.instances import instance_registers
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_words import camera_values, position_values
from colonnade.render.sequence_frames import sequence_scenes
from colonnade.scene.parser import load_scene
from colonnade.scene.view import place
from colonnade.scene_image.device_image import device_image, load_cycles, maps_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.packer import pack

WIDTH, HEIGHT = 28, 21
PAGE, MEMORY = 4096, 1 << 22
UNWRITTEN = 0xA5
CACHE = {
    **{"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8},
    **{"busBytes": 32, "parity": True},
}


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", ("array.columns=2",), bus_bytes=16)


@pytest.fixture(scope="module")
def stub() -> Path:
    return compile_test("stub", "shell")


def run_silently(*command: str | Path) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


#: Every error has its name, and no access is made that the shell refuses.
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


@functools.cache
def compiled_driver(program: str, header: str) -> Path:
    """A program of the tests, or the viewer of the examples, with the driver, for the design of a header."""
    folder = scratch()
    (folder / "colonnade_design.h").write_text(header)
    tests, examples = DRIVER_FOLDER / "tests", DRIVER_FOLDER / "examples"
    if program == "viewer":
        sources = [
            examples / "viewer.c",
            examples / "target.c",
            examples / "target_files.c",
            tests / "target_simulated.c",
        ]
        return compile_c([*sources, *driver_objects()], folder / "driver", f"-I{examples}", "-lm")
    return compile_c([tests / f"{program}.c", *driver_objects()], folder / "driver")


def run_driver(
    folder: Path, design: GeneratedDesign, files: Mapping[str, bytes], *arguments: str, program: str = "simulated"
) -> tuple[NDArray[np.uint8], list[list[str]]]:
    """Run the driver with files against the Verilated shell: the memory at the end, and the lines that it prints."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    driver = compiled_driver(program, design_header(register_table(design), design.manifest))
    options = {"bus": 16, "memory": MEMORY, "latency": 20, "stall": 10, "seed": 4, "shared": "ram"}
    (folder / "ram").write_bytes(bytes([UNWRITTEN]) * MEMORY)
    command = [
        build_shell_simulator(design),
        *(text for key, value in options.items() for text in (f"--{key}", str(value))),
    ]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "cwd": folder}
    with subprocess.Popen([*command, "-"], stderr=subprocess.PIPE, **pipes) as device:
        done = subprocess.run(
            [driver, *arguments], stdin=device.stdout, stdout=device.stdin, stderr=subprocess.PIPE, cwd=folder
        )
        assert device.stdin is not None and device.stderr is not None
        device.stdin.close()
        problems = device.stderr.read()
        assert (device.wait(), done.returncode, problems) == (0, 0, b""), done.stderr.decode()
    memory = np.frombuffer((folder / "memory").read_bytes(), dtype=np.uint8).copy()
    return memory, [line.split() for line in done.stderr.decode().splitlines()]


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


def test_the_viewer_renders_the_orbit_of_its_keys(tmp_path: Path, design: GeneratedDesign) -> None:
    """Its last frame is the model's, for the camera of the keys."""
    size, manifest = (24, 16), design.manifest
    scene = DeviceScene.of(
        load_scene(toolchain.project_root() / "scenes" / "object.toml"), manifest, load_mesh("torus")
    )
    file = scene.view_file(size)
    files = {"image": scene.device_image(), "view": file}
    memory, (line,) = run_driver(
        tmp_path, design, files, "interrupt", "image", "view", "--keys", "xds-q+", program="viewer"
    )
    assert line[:4] == ["4", "frames", "of", "24x16,"] and float(line[4]) > 0
    placed = place(scene.scene, scene.image.header.extent, *size, None)
    camera, (right, _, back) = placed.camera, placed.camera.axes
    depth = float((camera.position - placed.pose.translate) @ back)
    moved = Rotation.from_rotvec([0, 5, 0], degrees=True) * Rotation.from_rotvec(5 * right, degrees=True)
    middle = camera.position - depth * back
    axes = moved.apply(camera.axes)
    target = TargetView(file, manifest)
    rotation, lens = camera_values(camera)
    turned = np.round(moved.as_matrix() @ rotation * 2.0**30).astype(int).ravel().tolist()
    target.set_camera(position_values(middle + 1.1 * depth * axes[2], "camera"), turned, lens, size)
    expected = framebuffer_bytes(render_model(manifest, scene.image, target.registers()), 0)
    tile = int(manifest.config["frame"]["tileSize"])
    stride = -(-size[0] // tile) * tile * 4
    lines = memory[PAGE : PAGE + stride * size[1]].reshape(size[1], stride)[:, : expected.shape[1]]
    np.testing.assert_array_equal(lines, expected)
    assert len(np.unique(lines)) > 20


MOVING_SCENE = """
camera.position = [1.5, 2.0, 5.0]

[[object]]
mesh.name = "torus"
motion = {turn = 90.0, translate = [0.3, 0.2, 0.0]}

[[object]]
mesh.name = "cube"
transform = {scale = 0.4, translate = [0.9, 0.5, 0.6]}
motion = {rotate = [50.0, 0.0, 20.0], translate = [-0.5, 0.4, 0.0]}
"""


#: As scenes/live.toml: three objects that move, and a figure that bends as it walks.
BENDING_SCENE = """
camera = {position = [0.5, 0.8, 1.9], target = [0.12, 0.5, 0.0], fov = 36.0}
light.position = [0.9, 2.2, 1.6]
paths.bounces = 2

[[object]]
mesh = {name = "teapot:4"}
material = {kind = "mirror", albedo = [0.95, 0.94, 0.92]}
transform = {scale = 0.1, translate = [-0.35, 0.3, -0.2]}
motion = {turn = 360.0}

[[object]]
mesh = {name = "sphere:320"}
material = {kind = "glass", albedo = [0.93, 0.98, 0.96], ior = 1.5}
transform = {scale = 0.2, translate = [0.7, 0.2, 0.2]}
motion = {translate = [-0.6, 0.3, 0.0]}

[[object]]
mesh = {name = "cube"}
material = {albedo = [0.15, 0.5, 0.3]}
transform = {scale = 0.12, translate = [-0.5, 0.2, 0.6]}
motion = {rotate = [180.0, 90.0, 0.0], translate = [0.4, 0.3, 0.0]}

[[object]]
mesh = {path = "CHARACTER", animation = "walk"}
transform = {scale = 0.6, translate = [0.2, 0.0, 0.2]}
motion = {turn = 60.0, translate = [0.1, 0.0, -0.2]}
"""

BENDS = "in DRAM, with a mesh that bends"
#: A scene, its design, and the number of frames.
PLAYS = {
    "on chip": (MOVING_SCENE, ("frame.instances=2",), 4),
    BENDS: (
        BENDING_SCENE.replace("CHARACTER", str(toolchain.project_root() / "scenes" / "character.gltf")),
        (
            "frame.instances=4",
            "frame.maxBounces=2",
            f"columnBvhMemory.cache={json.dumps(CACHE | {'lines': 64, 'sharedLines': 256})}",
        ),
        13,  # the steps of the figure are twelfths of the motion
    ),
}


@pytest.mark.parametrize("case", PLAYS)
def test_frames_that_the_viewer_plays_are_those_of_the_model(tmp_path: Path, case: str) -> None:
    """Each: registers are written, and meshes bent, while the frame before runs."""
    described, overrides, count = PLAYS[case]
    size, design = (24, 16), shell_design_for("tiny", ("array.columns=2", *overrides), bus_bytes=16)
    manifest = design.manifest
    in_dram = "line" in manifest.memories["columnBvh"]
    (tmp_path / "scene.toml").write_text(described)
    scene = DeviceScene.of(load_scene(tmp_path / "scene.toml"), manifest)
    moves = scene.image.moves
    assert isinstance(moves, MovingInstances)
    files = {"image": scene.device_image(), "view": scene.view_file(size), "clip": scene.clip_file()}
    files |= {"scene": scene.dram_image()} if in_dram else {}
    arguments = ("image", "view", "--play", str(count), "clip", *(["scene"] if in_dram else []))
    memory, (line,) = run_driver(tmp_path, design, files, "interrupt", *arguments, program="viewer")
    assert line[:4] == [str(count), "frames", "of", "24x16,"]
    names = [f"frame.{number}" for number in range(count - 1)]
    frames = [*(np.fromfile(tmp_path / name, np.uint8) for name in names), memory[PAGE:]]
    stride = -(-size[0] // (tile := int(manifest.config["frame"]["tileSize"]))) * tile * 4
    target, duration = TargetView(files["view"], manifest), round(moves.seconds * 65536)
    different = set[bytes]()
    for number, frame in enumerate(frames):
        posed = scene.image.posed(duration * number // count / duration)
        header = posed.header
        target.set_bounds(header.bounds_low, header.bounds_high)
        registers = target.registers() | instance_registers(header.instances, header.frame, manifest)
        expected = framebuffer_bytes(render_model(manifest, posed, registers), 0)
        lines = frame[: stride * size[1]].reshape(size[1], stride)[:, : expected.shape[1]]
        np.testing.assert_array_equal(lines, expected, err_msg=f"frame {number}")
        different.add(expected.tobytes())
        at_rest = framebuffer_bytes(render_model(manifest, scene.image, registers), 0)
        assert (at_rest != expected).any() == (in_dram and number > 0)
    assert len(different) == count


def test_no_frame_reads_a_copy_that_is_written_or_a_stale_record(tmp_path: Path) -> None:
    """Of a mesh that bends, through a cache that keeps all records until it is invalidated."""
    described, overrides, _ = PLAYS[BENDS]
    manifest = shell_design_for("tiny", ("array.columns=2", *overrides), bus_bytes=16).manifest
    (tmp_path / "scene.toml").write_text(described)
    scene = DeviceScene.of(load_scene(tmp_path / "scene.toml"), manifest)
    files = {"clip": scene.clip_file(), "scene": scene.dram_image()}
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    names = ("instances[0].matrix[0].x", "control.invalidate", "scene.recordCount")
    registers = (str(manifest.registers[name].address) for name in names)
    run_silently(compile_test("bend"), *(tmp_path / name for name in files), *registers)


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


@pytest.mark.parametrize("mode", ["interrupt", pytest.param("poll", marks=pytest.mark.matrix)])
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
