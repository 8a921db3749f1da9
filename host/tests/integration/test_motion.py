"""The C that moves objects and bends their meshes on a target: the same records and registers on every processor."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from animated_documents import arm
from c_programs import NEEDS_RISCV, RISCV, SANITIZERS
from driver_runs import CACHE
from target_programs import MACHINE, NEEDS_QEMU, QEMU, build, hash_of

from colonnade.design.generator import manifest_for
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

FRAMES, DEVICE_BASE, RECORD_BYTES = 10, 0x8000, 32
DESCRIBED = """
camera.position = [1.5, 2.0, 5.0]

[[object]]
mesh = {path = "arm.gltf", animation = "bend"}
motion = {turn = 90.0, translate = [0.3, 0.2, 0.0]}

[[object]]
mesh.name = "cube"
transform = {scale = 0.4, translate = [0.9, 0.5, 0.6]}
motion = {rotate = [50.0, 0.0, 20.0], translate = [-0.5, 0.4, 0.0]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of ``motion_table.h``: a clip file of instances, one of which bends, and the scene's records."""
    folder = tmp_path_factory.mktemp("table")
    arm().write(folder / "arm.gltf")
    (folder / "scene.toml").write_text(DESCRIBED)
    overrides = ("frame.instances=2", f"columnBvhMemory.cache={json.dumps(CACHE)}")
    manifest = manifest_for("tiny", overrides).manifest
    scene = DeviceScene.of(load_scene(folder / "scene.toml"), manifest)
    file, records = scene.clip_file(), np.frombuffer(scene.dram_image(), "<u4")
    clips = [np.frombuffer(file, "<u4")[i:] for i in range(len(file) // 4) if file[4 * i : 4 * i + 8] == b"CLNDCLIP"]
    assert len(clips) == 1
    count, depth, vertices, _, bones, targets = clips[0][17:23].tolist()
    written = [register for register in manifest.registers.values() if register.access == "rw"]
    numbers = {
        "FRAME_REGISTERS": DEVICE_BASE + 4 * min(register.address for register in written),
        "DEVICE_END": DEVICE_BASE + 4 * max(register.address + register.words for register in written),
        "INVALIDATE": DEVICE_BASE + 4 * manifest.registers["control.invalidate"].address,
        "SCENE_REGISTERS": DEVICE_BASE + 4 * manifest.registers["scene.recordCount"].address,
        "SCENE_BYTES": 4 * len(records),
        "SCENE_WORDS": len(records) + RECORD_BYTES // 4 * count,
        "VERTICES": vertices,
        "DEPTH": depth,
        "POSE_WORDS": 12 * bones + targets,
    }
    (folder / "motion_table.h").write_text(
        f"enum {{ {', '.join(f'{name} = {value}' for name, value in numbers.items())} }};\n"
        f"static const uint8_t clip_table[] = {{{', '.join(map(str, file))}}};\n"
        f"static uint32_t scene[SCENE_WORDS] = {{{', '.join(map(str, records.tolist()))}}};\n"
    )
    return folder


@pytest.fixture(scope="module")
def expected(folder: Path) -> str:
    """The hash of frames on this machine, optimised."""
    found = hash_of(build("gcc", folder, "optimised", "motion", "-O2", f"-DFRAMES={FRAMES}"))
    assert int(found, 16) != 0
    return found


@pytest.mark.matrix
def test_frames_without_optimisation_and_with_sanitizers_are_the_same(folder: Path, expected: str) -> None:
    assert hash_of(build("gcc", folder, "checked", "motion", "-O0", *SANITIZERS, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
@pytest.mark.parametrize("optimisation", ["-O3", "-Os"])
def test_frames_of_a_riscv_are_the_same(folder: Path, expected: str, optimisation: str) -> None:
    program = build(RISCV, folder, f"riscv{optimisation}", "motion", optimisation, *MACHINE, f"-DFRAMES={FRAMES}")
    assert hash_of(QEMU, program) == expected


def test_every_frame_of_the_motion_is_another(folder: Path, expected: str) -> None:
    hashes = {hash_of(build("gcc", folder, f"cut{n}", "motion", "-O1", f"-DFRAMES={n}")) for n in range(1, 4)}
    assert len(hashes | {expected}) == 4
