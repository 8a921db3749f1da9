"""The viewer of driver/examples: the orbit of its keys, objects that move, and meshes that bend in two copies."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from animated_documents import arm
from c_programs import compile_test
from driver_runs import CACHE, PAGE, compiled_driver, run_driver, run_silently
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.design import toolchain
from colonnade.design.generator import shell_design_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.integration.design_header import design_header
from colonnade.integration.register_table import register_table
from colonnade.mesh.load import load_mesh
from colonnade.registers.instances import instance_registers
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_words import camera_values, position_values
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.prepared.packed_objects import MovingInstances
from colonnade.scene.view import world_view

#: A cache that holds all records: a frame that does not invalidate it reads old ones.
IN_DRAM = (f"columnBvhMemory.cache={json.dumps(CACHE | {'lines': 64, 'sharedLines': 256})}",)
#: A design, arguments, and how they move the camera: degrees about the vertical and sideways, a factor of its distance.
ORBITS = {
    "keys": ((), ("--keys", "xds-q+"), 4, (5.0, 5.0, 1.1)),
    "keys, in DRAM": (IN_DRAM, ("--keys", "xds-q+"), 4, (5.0, 5.0, 1.1)),
    "a turn, in DRAM": (IN_DRAM, ("--turn", "2"), 2, (180.0, 0.0, 1.0)),
}


@pytest.mark.matrix
@pytest.mark.parametrize("case", ["keys, in DRAM", "keys", "a turn, in DRAM"])
def test_the_viewer_renders_the_orbit_of_its_camera(tmp_path: Path, case: str) -> None:
    """Its last frame is the model's, for the camera of the arguments."""
    overrides, arguments, count, (azimuth, elevation, distance) = ORBITS[case]
    design = shell_design_for("tiny", ("array.columns=2", *overrides))
    size, manifest = (24, 16), design.manifest
    scene = DeviceScene.of(
        load_scene(toolchain.project_root() / "scenes" / "object.toml"), manifest, load_mesh("torus")
    )
    file = scene.view_file(size)
    files = {"image": scene.device_image(), "view": file}
    files |= {"scene": scene.dram_image()} if overrides else {}
    arguments += ("scene",) if overrides else ()
    memory, (line,) = run_driver(tmp_path, design, files, "interrupt", "image", "view", *arguments, program="viewer")
    assert line[:4] == [str(count), "frames", "of", "24x16,"] and float(line[4]) > 0
    placed = world_view(Placed(scene.scene, scene.image.header.extent), *size)
    camera, (right, _, back) = placed.camera, placed.camera.axes
    depth = float((camera.position - placed.pose.translate) @ back)
    sideways = Rotation.from_rotvec(elevation * right, degrees=True)
    moved = Rotation.from_rotvec([0, azimuth, 0], degrees=True) * sideways
    middle = camera.position - depth * back
    axes = moved.apply(camera.axes)
    target = TargetView(file, manifest)
    rotation, lens = camera_values(camera)
    turned = np.round(moved.as_matrix() @ rotation * 2.0**30).astype(int).ravel().tolist()
    target.set_camera(position_values(middle + distance * depth * axes[2], "camera"), turned, lens, size)
    expected = framebuffer_bytes(render_model(manifest, scene.image, target.registers()), 0)
    lines = lines_of(memory[PAGE:], size, manifest)[:, : expected.shape[1]]
    np.testing.assert_array_equal(lines, expected)
    assert len(np.unique(lines)) > 20


def lines_of(frame: NDArray[np.uint8], size: tuple[int, int], manifest: Manifest) -> NDArray[np.uint8]:
    """The lines of a frame at the start of a memory, as bytes."""
    tile = int(manifest.config["frame"]["tileSize"])
    stride = -(-size[0] // tile) * tile * 4
    return frame[: stride * size[1]].reshape(size[1], stride)


@pytest.mark.parametrize(
    "refit", [False, pytest.param(True, marks=pytest.mark.matrix)], ids=["by the driver", "by the unit"]
)
def test_a_mesh_that_the_viewer_bends_has_the_frames_of_the_model(tmp_path: Path, refit: bool) -> None:
    """It is all of the scene: a frame reads one of two copies of its records while the other one is bent."""
    size, count, design = (24, 16), 5, shell_design_for("tiny", ("array.columns=2", *IN_DRAM), refit=refit)
    manifest = design.manifest
    arm().write(tmp_path / "arm.gltf")
    (tmp_path / "scene.toml").write_text('mesh = {path = "arm.gltf", animation = "bend"}\n')
    scene = DeviceScene.of(load_scene(tmp_path / "scene.toml"), manifest)
    files = {"image": scene.device_image(), "view": scene.view_file(size), "clip": scene.clip_file()}
    files |= {"scene": scene.dram_image()}
    arguments = ("interrupt", "image", "view", "--play", str(count), "clip", "scene")
    memory, (line,) = run_driver(tmp_path, design, files, *arguments, program="viewer")
    assert line[:4] == [str(count), "frames", "of", "24x16,"] and ("unit" in line) == refit
    frames = [*(np.fromfile(tmp_path / f"frame.{number}", np.uint8) for number in range(count - 1)), memory[PAGE:]]
    registers, different = TargetView(files["view"], manifest).registers(), set[bytes]()
    for number, frame in enumerate(frames):
        expected = framebuffer_bytes(render_model(manifest, scene.image.posed(number / count), registers), 0)
        np.testing.assert_array_equal(
            lines_of(frame, size, manifest)[:, : expected.shape[1]], expected, err_msg=f"frame {number}"
        )
        different.add(expected.tobytes())
    assert len(different) == count


#: The design's scene is in DRAM; arguments behind the view; how the line begins.
REFUSED = {
    "no scene of keys": (True, ("--keys", "d"), "SCENE: is missing: this device has its scene in DRAM"),
    "no scene of the terminal": (True, (), "SCENE: is missing: this device has its scene in DRAM"),
    "no scene of a turn": (True, ("--turn", "2"), "SCENE: is missing: this device has its scene in DRAM"),
    "no scene of a clip": (True, ("--play", "2", "clip"), "SCENE: is missing: this device has its scene in DRAM"),
    "a scene of a device without DRAM": (False, ("--turn", "2", "scene"), "scene: is for a scene in DRAM"),
    "a mesh that bends on chip": (False, ("--play", "2", "clip"), "clip: has a mesh that bends, and this device holds"),
    "another option": (False, ("--spin", "2"), "usage: viewer /dev/uio0 IMAGE VIEW [--keys KEYS"),
    "too many arguments": (True, ("--turn", "2", "scene", "scene"), "usage: viewer /dev/uio0 IMAGE VIEW [--keys KEYS"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_viewer_cannot_show_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    in_dram, arguments, begin = REFUSED[case]
    design = shell_design_for("tiny", ("array.columns=2", *(IN_DRAM if in_dram else ())))
    arm().write(tmp_path / "arm.gltf")
    (tmp_path / "scene.toml").write_text('mesh = {path = "arm.gltf", animation = "bend"}\n')
    scene = DeviceScene.of(load_scene(tmp_path / "scene.toml"), design.manifest)
    (tmp_path / "clip").write_bytes(scene.clip_file())
    program = compiled_driver("viewer", design_header(register_table(design), design.manifest))
    command = [program, "interrupt", "image", "view", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(begin) and len(done.stderr.splitlines()) == 1


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

BENDS, BY_UNIT = "in DRAM, with a mesh that bends", "in DRAM, with a mesh that the shell's unit bends"
WALKING_SCENE = BENDING_SCENE.replace("CHARACTER", str(toolchain.project_root() / "scenes" / "character.gltf"))
#: A scene, its design, and the number of frames.
PLAYS = {
    "on chip": (MOVING_SCENE, ("frame.instances=2",), 4),
    # The steps of the figure are twelfths of the motion
    BENDS: (WALKING_SCENE, ("frame.instances=4", "frame.maxBounces=2", *IN_DRAM), 13),
    BY_UNIT: (WALKING_SCENE, ("frame.instances=4", "frame.maxBounces=2", *IN_DRAM), 13),
}


@pytest.mark.parametrize(
    "case", [BY_UNIT, *(pytest.param(case, marks=pytest.mark.matrix) for case in ("on chip", BENDS))]
)
def test_frames_that_the_viewer_plays_are_those_of_the_model(tmp_path: Path, case: str) -> None:
    """Each: registers are written, and meshes bent, while the frame before runs."""
    described, overrides, count = PLAYS[case]
    size, design = (24, 16), shell_design_for("tiny", ("array.columns=2", *overrides), refit=case == BY_UNIT)
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
    assert line[:4] == [str(count), "frames", "of", "24x16,"] and ("unit" in line) == (case == BY_UNIT)
    names = [f"frame.{number}" for number in range(count - 1)]
    frames = [*(np.fromfile(tmp_path / name, np.uint8) for name in names), memory[PAGE:]]
    target, duration = TargetView(files["view"], manifest), round(moves.seconds * 65536)
    different = set[bytes]()
    for number, frame in enumerate(frames):
        posed = scene.image.posed(duration * number // count / duration)
        header = posed.header
        target.set_bounds(header.bounds_low, header.bounds_high)
        registers = target.registers() | instance_registers(header.instances, header.frame, manifest)
        expected = framebuffer_bytes(render_model(manifest, posed, registers), 0)
        lines = lines_of(frame, size, manifest)[:, : expected.shape[1]]
        np.testing.assert_array_equal(lines, expected, err_msg=f"frame {number}")
        different.add(expected.tobytes())
        at_rest = framebuffer_bytes(render_model(manifest, scene.image, registers), 0)
        assert (at_rest != expected).any() == (in_dram and number > 0)
    assert len(different) == count


def test_no_frame_reads_a_copy_that_is_written_or_a_stale_record(tmp_path: Path) -> None:
    """Of a mesh that bends, through a cache that keeps all records until it is invalidated."""
    described, overrides, _ = PLAYS[BENDS]
    manifest = shell_design_for("tiny", ("array.columns=2", *overrides)).manifest
    (tmp_path / "scene.toml").write_text(described)
    scene = DeviceScene.of(load_scene(tmp_path / "scene.toml"), manifest)
    files = {"clip": scene.clip_file(), "scene": scene.dram_image()}
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    names = ("instances[0].matrix[0].x", "control.invalidate", "scene.recordCount")
    registers = (str(manifest.registers[name].address) for name in names)
    run_silently(compile_test("bend"), *(tmp_path / name for name in files), *registers)
