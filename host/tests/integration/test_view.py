"""The C code that computes registers on a target: the same words on every processor, no floats."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from c_programs import NEEDS_RISCV, RISCV, SANITIZERS
from target_programs import MACHINE, NEEDS_QEMU, QEMU, build, executed, hash_of

from colonnade.design import toolchain
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.view_file import view_file
from colonnade.scene.model import Light, MeshSource, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import world_view
from colonnade.scene_image.packer import pack

ROOT = toolchain.project_root()

FRAMES, COUNTED = 2000, 10
DEVICE_BASE = 0x8000
#: Functions of the library, of one object, two lights and the camera; signed divisions are the test's.
LIBRARY = re.compile(
    r"colonnade_|find_|is_pose|is_place|set_|check_camera|write_word|compute|clip|__udivdi3|memcpy|memset"
)
MAX_INSTRUCTIONS = 15000


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of ``view_table.h``: the view file of a scene with two lights, as an array."""
    manifest = Manifest.load(ROOT / "configs" / "golden" / "edge.json")
    scene = Scene(MeshSource(name="teapot:3"), more_lights=(Light((1.0, 2.0, 0.5), falloff=2.0),))
    header = pack(load_mesh("teapot:3"), manifest).header
    registers = frame_registers(scene, header, manifest, 640, 480)
    file = view_file(world_view(Placed(scene, header.extent), 640, 480), registers, (640, 480), header, manifest)
    written = [register for register in manifest.registers.values() if register.access == "rw"]
    first, last = written[0], max(written, key=lambda register: register.address)
    folder = tmp_path_factory.mktemp("table")
    (folder / "view_table.h").write_text(
        f"enum {{ FRAME_REGISTERS = {DEVICE_BASE + 4 * first.address},"
        f" DEVICE_END = {DEVICE_BASE + 4 * (last.address + last.words)} }};\n"
        f"static const uint8_t view_table[] = {{{', '.join(map(str, file))}}};\n"
    )
    return folder


@pytest.fixture(scope="module")
def expected(table: Path) -> str:
    """The hash of random frames on this machine, optimised."""
    return hash_of(build("gcc", table, "optimised", "view", "-O2", f"-DFRAMES={FRAMES}"))


def test_frames_without_optimisation_and_with_sanitizers_are_the_same(table: Path, expected: str) -> None:
    assert hash_of(build("gcc", table, "checked", "view", "-O0", *SANITIZERS, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
@pytest.mark.parametrize("optimisation", ["-O2", "-Os"])
def test_frames_of_a_riscv_are_the_same(table: Path, expected: str, optimisation: str) -> None:
    program = build(RISCV, table, f"riscv{optimisation}", "view", optimisation, *MACHINE, f"-DFRAMES={FRAMES}")
    assert hash_of(QEMU, program) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_a_frame_takes_few_instructions(table: Path, tmp_path: Path) -> None:
    """Mean of an object, a camera and two lights that all move, on an RV32IM."""
    programs = [
        build(RISCV, table, f"counted{frames}", "view", "-O2", *MACHINE, f"-DFRAMES={frames}")
        for frames in (1, 1 + COUNTED)
    ]
    counts = [
        sum(LIBRARY.match(name) is not None and name != "colonnade_rotation" for name in executed(program, tmp_path))
        for program in programs
    ]
    mean = (counts[1] - counts[0]) / COUNTED
    print(f"{mean:.0f} instructions a frame")
    assert 5000 < mean <= MAX_INSTRUCTIONS
