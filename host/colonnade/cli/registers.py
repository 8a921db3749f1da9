"""``colonnade registers``: the registers of a design for drivers, debuggers and integration tools."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from colonnade.cli.options import FILE, Command, bus_option, configuration_options, echo, refit_option, require_outputs

if TYPE_CHECKING:
    from colonnade.design.generator import BusBytes


def _address(context: click.Context, parameter: click.Parameter, value: str) -> int:
    try:
        address = int(value, 0)
    except ValueError:
        address = -1
    if not 0 <= address < 1 << 40 or address % (1 << 16):
        raise click.BadParameter(f"{value!r} is not a multiple of 0x10000 below 2^40", context, parameter)
    return address


def _framebuffer(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[int, int, int] | None:
    """Width, height and address."""
    if value is None:
        return None
    found = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})@(0x[0-9a-fA-F]{1,10}|\d{1,13})", value)
    address = int(found[3], 0) if found else -1
    if found is None or address >= 1 << 40 or address % 4096:
        raise click.BadParameter(f"{value!r} is not WxH@ADDRESS, a multiple of 4096 below 2^40", context, parameter)
    return int(found[1]), int(found[2]), address


@click.command(cls=Command, short_help="Describe the registers: SystemRDL, C, HTML, IP-XACT, SVD, device tree.")
@configuration_options
@bus_option("The bus of the AXI4 shell; auto: 64 for rays, else 16.", default="auto", show_default=True)
@refit_option
@click.option("--output", type=FILE, metavar="DIR", help="Output folder. An unmodified earlier output is replaced.")
@click.option(
    "--base", callback=_address, default="0", metavar="ADDRESS", help="Where the device is, for SVD and device tree."
)
@click.option(
    "--interrupt",
    type=click.IntRange(0, 2**32 - 1),
    default=0,
    metavar="N",
    help="Its interrupt, for SVD and device tree: a cell of 32 bits.",
)
@click.option(
    "--framebuffer",
    callback=_framebuffer,
    metavar="WxH@ADDRESS",
    help="A display's memory, for the device tree: Linux shows it as a simple-framebuffer.",
)
@click.option(
    "--cells",
    type=click.IntRange(1, 2),
    default=1,
    show_default=True,
    help="Address and size cells of the device tree's root and bus: 2 on 64-bit boards as a rule.",
)
@click.option("--shell-header", type=FILE, metavar="FILE", help="Write only the C header of the shell's registers.")
def registers(
    config: str,
    overrides: tuple[str, ...],
    bus_bytes: BusBytes,
    refit: bool,
    output: Path | None,
    base: int,
    interrupt: int,
    framebuffer: tuple[int, int, int] | None,
    cells: int,
    shell_header: Path | None,
) -> None:
    """Write the registers of a design in its AXI4 shell, from the generator's table.

    DIR receives colonnade.rdl, C headers, HTML pages, IP-XACT, SVD, and a node for a device tree.
    """
    if (output is None) == (shell_header is None):
        raise click.UsageError("give either --output DIR or --shell-header FILE", click.get_current_context())
    require_outputs(shell_header)

    from colonnade.common import progress
    from colonnade.common.atomic_files import replacing
    from colonnade.common.extras import require_extra
    from colonnade.design import generator
    from colonnade.design.design_folder import check_replaceable, listed
    from colonnade.integration import files
    from colonnade.integration.device_tree import Display

    require_extra("integration", "colonnade registers")
    if output is not None:
        check_replaceable(output)
    terminal = progress.for_terminal()
    design = generator.shell_manifest_for(config, overrides, bus_bytes, terminal, refit)
    if shell_header is not None:
        with replacing(shell_header) as stream:
            stream.write(files.shell_header(design).encode())
        return
    assert output is not None
    with terminal.step("describing the registers"):
        display = None
        if framebuffer is not None:
            width, height, address = framebuffer
            display = Display(address, width, height, int(design.manifest.config["frame"]["tileSize"]))
        files.write_registers(design, output, base, interrupt, display, cells)
    echo(f"{output}: {len(listed(output))} files, format {design.manifest.format_hash[:12]}")
