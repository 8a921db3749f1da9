"""The C driver: errors by name against a stub, frames of a simulated device, and warnings of two compilers."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.device.shell_build import build_shell_simulator
from colonnade.integration.design_header import design_header
from colonnade.integration.register_table import register_table
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.frame_file import frame_file
from colonnade.scene.parser import load_scene
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import dram_image
from colonnade.scene_image.packer import pack

SOFTWARE = toolchain.project_root() / "software"
DRIVER = sorted((SOFTWARE / "src").glob("*.c"))
WARNINGS = "-std=c11 -O1 -Wall -Wextra -Wconversion -Werror -pedantic".split()
SANITIZERS = "-g -fsanitize=address,undefined -fno-sanitize-recover=all".split()
RISCV = "riscv64-unknown-elf-gcc"
WIDTH, HEIGHT = 44, 33
PAGE = 4096
UNWRITTEN = 0xA5
CACHE = {
    **{"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8},
    **{"busBytes": 32, "parity": False},
}


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", ("array.columns=2",), bus_bytes=16)


def compile_c(sources: list[Path], program: Path, *options: str) -> Path:
    includes = [f"-I{SOFTWARE / 'include'}", f"-I{program.parent}"]
    command = ["gcc", *WARNINGS, *SANITIZERS, *includes, *options, *map(str, sources), "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def stub(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tests = SOFTWARE / "tests"
    return compile_c([tests / "stub.c", tests / "shell.c", *DRIVER], tmp_path_factory.mktemp("stub") / "stub")


#: Every error has its name, and no access is made that the shell refuses.
TESTS = ("probe", "images", "frames", "photos", "scenes", "names", "events", "posted writes", "long frame files")


@pytest.mark.parametrize("test", (*TESTS, "refused frame files"))
def test_the_driver_against_a_shell_that_refuses(stub: Path, test: str) -> None:
    done = subprocess.run([stub, test], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(shutil.which(RISCV) is None, reason=f"no {RISCV}: apt-get install gcc-riscv64-unknown-elf")
def test_the_driver_compiles_for_a_bare_riscv(tmp_path: Path) -> None:
    for source in DRIVER:
        machine = ["-march=rv32im", "-mabi=ilp32", "-ffreestanding", f"-I{SOFTWARE / 'include'}"]
        command = [RISCV, *WARNINGS, *machine, "-c", str(source), "-o", str(tmp_path / f"{source.stem}.o")]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_the_linux_example_compiles(tmp_path: Path, design: GeneratedDesign) -> None:
    (tmp_path / "colonnade_design.h").write_text(design_header(register_table(design), design.manifest))
    compile_c([SOFTWARE / "examples" / "uio.c", *DRIVER], tmp_path / "uio")


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
    records = dram_image(image, manifest) if overrides else b""
    files = {"image": data, "other": data[:44] + bytes([data[44] ^ 1]) + data[45:], "scene": records}
    files["frame"] = frame_file(registers, manifest)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "colonnade_design.h").write_text(design_header(register_table(design), manifest))
    driver = compile_c([SOFTWARE / "tests" / "simulated.c", *DRIVER], tmp_path / "driver")

    simulator = build_shell_simulator(design)
    options = {"bus": 16, "memory": 1 << 22, "latency": 20, "stall": 10, "seed": 4}
    arguments = [text for name, value in options.items() for text in (f"--{name}", str(value))]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "cwd": tmp_path}
    with subprocess.Popen([simulator, *arguments, "-"], stderr=subprocess.PIPE, **pipes) as device:
        done = subprocess.run(
            [driver, "image", "frame", mode, *(["scene"] if records else [])],
            stdin=device.stdout,
            stdout=device.stdin,
            stderr=subprocess.PIPE,
            cwd=tmp_path,
        )
        assert device.stdin is not None and device.stderr is not None
        device.stdin.close()
        problems = device.stderr.read()
        assert (device.wait(), done.returncode, problems) == (0, 0, b""), done.stderr.decode()

    memory = np.frombuffer((tmp_path / "memory").read_bytes(), dtype=np.uint8).copy()
    np.testing.assert_array_equal(memory[PAGE : PAGE + len(data)], np.frombuffer(data, dtype=np.uint8))
    memory[PAGE : PAGE + len(data)] = UNWRITTEN
    frames = [line.split() for line in done.stderr.decode().splitlines()]
    if records:
        place = int(frames.pop(0)[1])
        assert memory[place : place + len(records)].tobytes() == records
        memory[place : place + len(records)] = UNWRITTEN
    assert len(frames) == 4
    for code, (_, place, stride, _, hits) in zip((0, 1, 2, 0), frames, strict=True):
        lines = memory[int(place) : int(place) + int(stride) * HEIGHT].reshape(HEIGHT, int(stride))
        used = lines[:, : WIDTH * PIXEL_BYTES[code]]
        np.testing.assert_array_equal(used, framebuffer_bytes(expected, code))
        used[:] = UNWRITTEN
        assert int(hits) == expected.counters["hits"]
    assert (memory == UNWRITTEN).all()
