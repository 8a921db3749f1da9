"""The C code that computes registers on a target: the same words on every processor, no floats."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from c_programs import DRIVER, DRIVER_FOLDER, NEEDS_RISCV, RISCV, SANITIZERS, WARNINGS

from colonnade.design import toolchain
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.registers.view_file import view_file
from colonnade.scene.model import Light, MeshSource, Scene
from colonnade.scene.view import place
from colonnade.scene_image.packer import pack

ROOT = toolchain.project_root()
SOURCES = [DRIVER_FOLDER / "tests" / "view.c", *DRIVER]
VIEW = sorted((DRIVER_FOLDER / "src").glob("colonnade_view*.c"))
MACHINE = ["-march=rv32im", "-mabi=ilp32", "-ffreestanding", "-nostdlib"]
QEMU = "qemu-riscv32"
NEEDS_QEMU = pytest.mark.skipif(shutil.which(QEMU) is None, reason=f"no {QEMU}: apt-get install qemu-user")

FRAMES, COUNTED = 2000, 10
DEVICE_BASE = 0x8000
#: Functions of the library, of one object, two lights and the camera; without those of the test.
LIBRARY = re.compile(
    r"colonnade_|find_|is_pose|is_place|set_|check_camera|write_word|compute|clip|__u?divdi3|memcpy|memset"
)
MAX_INSTRUCTIONS = 15000
#: What a C compiler may call for 64-bit integers and structures.
ALLOWED = re.compile(r"colonnade_\w+|__(u?div|u?mod|mul|ashl|ashr|lshr)di3|mem(cpy|set|move|cmp)|__stack_chk_fail")


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of ``view_table.h``: the view file of a scene with two lights, as an array."""
    manifest = Manifest.load(ROOT / "configs" / "golden" / "edge.json")
    scene = Scene(MeshSource(name="teapot:3"), more_lights=(Light((1.0, 2.0, 0.5), falloff=2.0),))
    header = pack(load_mesh("teapot:3"), manifest).header
    registers = frame_registers(scene, header, manifest, 640, 480)
    file = view_file(place(scene, header.extent, 640, 480), registers, (640, 480), header, manifest)
    written = [register for register in manifest.registers.values() if register.access == "rw"]
    first, last = written[0], max(written, key=lambda register: register.address)
    folder = tmp_path_factory.mktemp("table")
    (folder / "view_table.h").write_text(
        f"enum {{ FRAME_REGISTERS = {DEVICE_BASE + 4 * first.address},"
        f" DEVICE_END = {DEVICE_BASE + 4 * (last.address + last.words)} }};\n"
        f"static const uint8_t view_table[] = {{{', '.join(map(str, file))}}};\n"
    )
    return folder


def build(compiler: str, table: Path, name: str, *options: str) -> Path:
    program = table / name
    libraries = ["-lgcc"] if compiler == RISCV else []
    command = [
        compiler,
        *WARNINGS,
        f"-I{DRIVER_FOLDER / 'include'}",
        f"-I{table}",
        *options,
        *map(str, SOURCES),
        *libraries,
    ]
    done = subprocess.run([*command, "-o", str(program)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


def hash_of(*command: str | Path) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"[0-9a-f]{8}\n", done.stdout)
    return done.stdout.strip()


@pytest.fixture(scope="module")
def expected(table: Path) -> str:
    """The hash of random frames on this machine, optimised."""
    return hash_of(build("gcc", table, "optimised", "-O2", f"-DFRAMES={FRAMES}"))


def test_frames_without_optimisation_and_with_sanitizers_are_the_same(table: Path, expected: str) -> None:
    assert hash_of(build("gcc", table, "checked", "-O0", *SANITIZERS, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
@pytest.mark.parametrize("optimisation", ["-O2", "-Os"])
def test_frames_of_a_riscv_are_the_same(table: Path, expected: str, optimisation: str) -> None:
    program = build(RISCV, table, f"riscv{optimisation}", optimisation, *MACHINE, f"-DFRAMES={FRAMES}")
    assert hash_of(QEMU, program) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_a_frame_takes_few_instructions(table: Path, tmp_path: Path) -> None:
    """Mean of an object, a camera and two lights that all move, on an RV32IM."""
    counts = []
    for frames in (1, 1 + COUNTED):
        program = build(RISCV, table, f"counted{frames}", "-O2", *MACHINE, f"-DFRAMES={frames}")
        log = tmp_path / f"log{frames}"
        step = "-one-insn-per-tb" if "one-insn-per-tb" in subprocess.getoutput(f"{QEMU} -h") else "-singlestep"
        hash_of(QEMU, step, "-d", "exec,nochain", "-D", log, program)
        names = (line.split()[-1] for line in log.read_text().splitlines() if line.startswith("Trace"))
        counts.append(sum(LIBRARY.match(name) is not None and name != "colonnade_rotation" for name in names))
    mean = (counts[1] - counts[0]) / COUNTED
    print(f"{mean:.0f} instructions a frame")
    assert 5000 < mean <= MAX_INSTRUCTIONS


@pytest.mark.parametrize("compiler", ["gcc", pytest.param(RISCV, marks=NEEDS_RISCV)], ids=["this machine", "RV32IM"])
def test_nothing_is_allocated_and_no_float_is_used(tmp_path: Path, compiler: str) -> None:
    """Undefined symbols are those of 64-bit integers, and no instruction is one of the floating-point unit."""
    machine = MACHINE if compiler == RISCV else ["-mno-sse", "-mno-80387", "-mno-mmx"]
    for source in VIEW:
        target = tmp_path / f"{source.stem}.o"
        subprocess.run(
            [compiler, *WARNINGS, "-O2", *machine, f"-I{DRIVER_FOLDER / 'include'}", "-c", source, "-o", target],
            check=True,
        )
        nm = compiler.replace("gcc", "nm")
        symbols = subprocess.run([nm, "-u", target], capture_output=True, text=True, check=True).stdout.split()
        assert [name for name in symbols if name != "U" and ALLOWED.fullmatch(name) is None] == []
        text = source.read_text() + (DRIVER_FOLDER / "src" / "colonnade_integers.h").read_text()
        assert re.search(r"\b(float|double|malloc|__int128)\b", text) is None
