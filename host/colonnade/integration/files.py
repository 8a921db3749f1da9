"""Writes all descriptions of a design's registers."""

from __future__ import annotations

import zlib
from pathlib import Path

from colonnade.common.temporary import temporary_folder
from colonnade.design.design_folder import check_replaceable, replace_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.integration.design_header import design_header
from colonnade.integration.device_tree import Display, device_tree
from colonnade.integration.register_table import RegisterBlock, read_shell, register_table, shell_block
from colonnade.integration.svd import svd
from colonnade.integration.system_rdl import system_rdl

_NOTE = "/* Written by `colonnade registers` with PeakRDL. Do not edit. */\n"


def write_registers(
    design: GeneratedDesign,
    output: Path,
    base: int = 0,
    interrupt: int = 0,
    display: Display | None = None,
    cells: int = 1,
) -> None:
    """Write the folder ``output``: SystemRDL, C headers, HTML pages, IP-XACT, SVD, and a device tree node.

    Args:
        design: Generated with its shell; a manifest is enough.
        output: The folder; an unchanged earlier output is replaced.
        base: Byte address of the device, for SVD and device tree.
        interrupt: Its interrupt, for SVD and device tree.
        display: A framebuffer for the device tree.
        cells: Of its addresses and sizes.

    Raises:
        UserError: The folder cannot be replaced.
    """
    from peakrdl_html import HTMLExporter
    from peakrdl_ipxact import IPXACTExporter
    from systemrdl import RDLCompiler

    check_replaceable(output)
    table = register_table(design)
    with temporary_folder() as work:
        folder = work / "registers"
        folder.mkdir()
        source = folder / "colonnade.rdl"
        source.write_text(system_rdl("colonnade", (table.shell, table.device)))
        (folder / "colonnade_registers.h").write_text(c_header("colonnade", (table.shell, table.device), work))
        (folder / "colonnade_design.h").write_text(design_header(table, design.manifest))
        (folder / "colonnade.svd").write_text(svd(table, base, interrupt))
        (folder / "colonnade.dtsi").write_text(device_tree(table, base, interrupt, display, cells))
        compiler = RDLCompiler()
        compiler.compile_file(str(source))
        top = compiler.elaborate().top
        # In place of the time, so that the same registers give the same pages
        content = {"build_ts": zlib.crc32(source.read_bytes())}
        HTMLExporter(generate_source_links=False, user_context=content).export(top, str(folder / "html"))
        version = f"{table.version >> 16}.{table.version & 0xFFFF}"
        IPXACTExporter(vendor="colonnade", library="colonnade", version=version).export(
            top, str(folder / "colonnade.xml"), component_name="colonnade"
        )
        replace_folder(folder, output)


def shell_header(design: GeneratedDesign) -> str:
    """The C header of the shell's registers, which is the same for every design."""
    with temporary_folder() as work:
        return c_header("colonnade_shell", (shell_block(read_shell(design.dir)),), work)


def c_header(name: str, blocks: tuple[RegisterBlock, ...], work: Path) -> str:
    """PeakRDL's C header of an address map; ``work`` is a folder for temporary files."""
    from peakrdl_cheader.exporter import CHeaderExporter
    from systemrdl import RDLCompiler

    source, header = work / f"{name}.rdl", work / f"{name}.h"
    source.write_text(system_rdl(name, blocks))
    compiler = RDLCompiler()
    compiler.compile_file(str(source))
    CHeaderExporter().export(compiler.elaborate().top, str(header))
    # Bare-metal compilers may lack assert.h
    lines = [line for line in header.read_text().splitlines() if line != "#include <assert.h>"]
    checks = "#ifndef __cplusplus\n{}\n#endif"
    lines = [checks.format(f"_{line.replace('static', 'Static', 1)}") if _is_check(line) else line for line in lines]
    return _NOTE + "\n".join(lines) + "\n"


def _is_check(line: str) -> bool:
    return line.startswith("static_assert(")
