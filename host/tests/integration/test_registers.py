"""Register descriptions have the addresses, widths and accesses of the generator's table."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path

import pytest
from click.testing import CliRunner
from systemrdl import RDLCompiler

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_manifest_for
from colonnade.integration.device_tree import Display, device_tree
from colonnade.integration.files import shell_header, write_registers
from colonnade.integration.register_table import RegisterTable, register_table

BASE = 0x90000000


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_manifest_for("tiny")


@pytest.fixture(scope="module")
def table(design: GeneratedDesign) -> RegisterTable:
    return register_table(design)


@pytest.fixture(scope="module")
def folder(design: GeneratedDesign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("registers") / "out"
    write_registers(design, output, BASE, 5)
    return output


def expected(table: RegisterTable) -> dict[str, tuple[int, int]]:
    """Address and bits of each word."""
    return {
        f"{block.name}.{word.name}": (block.base + word.address, sum(field.width for field in word.fields))
        for block in (table.shell, table.device)
        for word in block.words
    }


def test_the_table_has_all_words_of_the_manifest(design: GeneratedDesign, table: RegisterTable) -> None:
    addresses = [word.address for word in table.device.words]
    registers = [register for register in design.manifest.registers.values() if register.name != "control.start"]
    words = [4 * (register.address + word) for register in registers for word in range(register.words)]
    assert addresses == words
    assert sum(field.width for word in table.device.words for field in word.fields) == sum(r.width for r in registers)


def test_system_rdl_has_the_words_of_the_table(folder: Path, table: RegisterTable) -> None:
    compiler = RDLCompiler()
    compiler.compile_file(str(folder / "colonnade.rdl"))
    top = compiler.elaborate().top
    found = {
        register.get_path().removeprefix("colonnade."): (
            register.absolute_address,
            sum(field.width for field in register.fields()),
        )
        for block in top.children()
        for register in block.registers()
    }
    assert found == expected(table)


def test_svd_has_the_words_of_the_table(folder: Path, table: RegisterTable) -> None:
    (peripheral,) = ET.parse(folder / "colonnade.svd").getroot().iter("peripheral")
    assert [element.tag for element in peripheral] == ["name", "baseAddress", "addressBlock", "interrupt", "registers"]
    assert int(peripheral.findtext("baseAddress", ""), 0) == BASE
    assert peripheral.findtext("interrupt/name") and peripheral.findtext("interrupt/description")
    assert int(peripheral.findtext("interrupt/value", "")) == 5
    found = {}
    for cluster in peripheral.iter("cluster"):
        for register in cluster.iter("register"):
            address = int(cluster.findtext("addressOffset", ""), 0) + int(register.findtext("addressOffset", ""), 0)
            bits = sum(int(field.findtext("bitWidth", "")) for field in register.iter("field"))
            found[f"{cluster.findtext('name')}.{register.findtext('name')}"] = (address, bits)
    assert found == expected(table)


def test_all_files_are_there(folder: Path) -> None:
    names = {path.name for path in folder.iterdir()}
    headers = {"colonnade_registers.h", "colonnade_design.h"}
    assert names >= headers | {"colonnade.xml", "colonnade.dtsi", "html"}
    # A number of the registers in place of the time: a release is the same each time
    number = zlib.crc32((folder / "colonnade.rdl").read_bytes())
    assert f"BUILD_TS = {number};" in (folder / "html" / "index.html").read_text()
    assert ET.parse(folder / "colonnade.xml").getroot().tag.endswith("component")
    assert f"colonnade@{BASE:x}" in (folder / "colonnade.dtsi").read_text()


@pytest.mark.parametrize("compiler", ["gcc -std=c11", "g++ -std=c++17", "g++ -std=c++20"])
def test_all_headers_compile_without_a_library(folder: Path, tmp_path: Path, compiler: str) -> None:
    """As a SoC's own program includes them, in C++ too."""
    names = ("colonnade_design.h", "colonnade_registers.h", "colonnade_shell.h", "colonnade_view.h")
    source = tmp_path / ("program.cpp" if "++" in compiler else "program.c")
    use = "unsigned word(void);\nunsigned word(void) { return colonnade_design.maps[0].words; }"
    source.write_text("".join(f'#include "{name}"\n' for name in names) + use)
    command = [*compiler.split(), "-ffreestanding", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only"]
    includes = [f"-I{toolchain.project_root() / 'driver' / 'include'}", f"-I{folder}"]
    done = subprocess.run([*command, *includes, source], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("interrupt", ["4294967296", "999999999999999999999999999999", "-1"])
def test_an_interrupt_beyond_a_cell_of_a_device_tree_is_refused(interrupt: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["registers", "--interrupt", interrupt, "--output", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert f"{interrupt} is not in the range 0<=x<=4294967295" in done.output
    assert not (tmp_path / "out").exists()


def test_numbers_of_a_device_tree_fit_their_cells(table: RegisterTable) -> None:
    assert "reg = <0x90000000 0x10000>;" in device_tree(table, BASE, 5)
    assert "reg = <0x0 0x90000000 0x0 0x10000>;" in device_tree(table, BASE, 5, cells=2)
    assert "reg = <0x12 0x90000000 0x0 0x10000>;" in device_tree(table, 0x12 << 32 | BASE, 2**32 - 1)


@pytest.mark.parametrize(("cells", "pixels"), [(1, 0x8000_0000), (2, 0x8000_0000), (2, 0x8_0000_0000)])
def test_a_framebuffer_of_a_device_tree_compiles(table: RegisterTable, tmp_path: Path, cells: int, pixels: int) -> None:
    """By its compiler, without warnings; a line has whole tile rows of 16 pixels, the memory whole pages."""
    nodes = device_tree(table, BASE, 5, Display(pixels, 1000, 600, 16), cells if pixels < 1 << 32 else 1)
    region = {1: "0x80000000 0x24f000", 2: f"{pixels >> 32:#x} {pixels & 0xFFFFFFFF:#x} 0x0 0x24f000"}[cells]
    assert nodes.count(f"<{region}>") == 3
    for line in ("stride = <4032>;", 'format = "x8r8g8b8";'):
        assert line in nodes
    device, root = nodes.split("\n/* Include these in the root")
    counts = f"#address-cells = <{cells}>; #size-cells = <{cells}>;"
    head = f"/dts-v1/; / {{ {counts} interrupt-parent = <&pic>; "
    pic = "pic: pic { interrupt-controller; #interrupt-cells = <1>; #address-cells = <0>; };"
    (tmp_path / "board.dts").write_text(f"{head} {pic} soc {{ {counts} ranges; {device} }}; /* {root} }};")
    if shutil.which("dtc") is None:
        pytest.skip("no dtc: apt-get install device-tree-compiler")
    command = ["dtc", "-O", "dtb", "-o", tmp_path / "board.dtb", tmp_path / "board.dts"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr


@pytest.mark.parametrize("framebuffer", ["640x480", "0x480@4096", "640x480@4097", "640x480@0x10000000000"])
def test_a_framebuffer_that_is_none_is_refused(framebuffer: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["registers", "--framebuffer", framebuffer, "--output", str(tmp_path / "out")])
    assert done.exit_code == 2 and "multiple of 4096 below 2^40" in done.output


def test_the_shell_is_the_same_in_every_design(design: GeneratedDesign) -> None:
    """Also in the repository's header."""
    header = (toolchain.project_root() / "driver" / "include" / "colonnade_shell.h").read_text()
    assert shell_header(design) == header
    assert shell_header(shell_manifest_for("small", bus_bytes=64)) == header
    assert re.search(r"STATUS__ISLOADING_bm 0x4$", header, re.MULTILINE)


@pytest.mark.parametrize("command", [["registers"], ["generate", "--axi", "auto", "--manifest-only"]])
def test_a_shell_that_refits_is_legal_as_for_generate(command: list[str], tmp_path: Path) -> None:
    arguments = [*command, "--refit", "--output", str(tmp_path / "out"), "--config", "tiny"]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 2
    assert done.stderr == "colonnade: error: --refit needs columnBvhMemory.cache={}\n"
    assert CliRunner().invoke(cli, [*arguments, "--set", "columnBvhMemory.cache={}"]).exit_code == 0


def test_a_foreign_folder_is_not_replaced(design: GeneratedDesign, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("irreplaceable")
    with pytest.raises(UserError, match="holds files"):
        write_registers(design, tmp_path)
