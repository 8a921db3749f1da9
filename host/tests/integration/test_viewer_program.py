"""The viewer of driver/examples: the orbit of its keys, objects that move, and meshes that bend in two copies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from c_programs import compile_test
from driver_runs import CACHE, PAGE, run_driver, run_silently
from scipy.spatial.transform import Rotation

from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.design import toolchain
from colonnade.design.generator import shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.packed_objects import MovingInstances
from colonnade.device.scene import DeviceScene
from colonnade.mesh.load import load_mesh
from colonnade.registers.instances import instance_registers
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_words import camera_values, position_values
from colonnade.scene.parser import load_scene
from colonnade.scene.view import place


def test_the_viewer_renders_the_orbit_of_its_keys(tmp_path: Path) -> None:
    """Its last frame is the model's, for the camera of the keys."""
    design = shell_design_for("tiny", ("array.columns=2",), bus_bytes=16)
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
