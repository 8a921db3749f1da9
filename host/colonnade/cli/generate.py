"""``colonnade generate``: the Verilog and the manifest of a configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from colonnade.cli.options import (
    FILE,
    Command,
    bus_option,
    configuration_options,
    echo,
    echo_lines,
    finish,
    json_option,
    refit_option,
    require_outputs,
)
from colonnade.common.errors import UserError

if TYPE_CHECKING:
    from colonnade.design.generator import BusBytes


@click.command(cls=Command, short_help="Write the Verilog and the manifest of a configuration.")
@configuration_options
@click.option("--output", type=FILE, metavar="DIR", help="Output folder. An unmodified earlier output is replaced.")
@click.option("--manifest-only", is_flag=True, help="Write only manifest.json, which is much faster.")
@click.option("--print", "print_manifest", is_flag=True, help="Print the manifest instead of writing files.")
@click.option("--black-box-memories", is_flag=True, help="Emit memories as black boxes, for SRAM macros.")
@bus_option("Add the AXI4 shell, with a bus of 4 to 128 BYTES; auto: 64 for rays, else 16.")
@click.option("--pixel-stream", is_flag=True, help="Add an AXI4-Stream of pixels to the shell of --axi.")
@refit_option
@json_option
def generate(
    config: str,
    overrides: tuple[str, ...],
    output: Path | None,
    manifest_only: bool,
    print_manifest: bool,
    black_box_memories: bool,
    bus_bytes: BusBytes | None,
    pixel_stream: bool,
    refit: bool,
    json_file: Path | None,
) -> None:
    """Generate the accelerator: SystemVerilog files, their list filelist.f, and manifest.json.

    The manifest describes the configuration, the record layouts, the register map and the streams. DIR also receives
    .colonnade.sha256, the checksums of its files. A later run replaces DIR only if its files are exactly those.
    """
    if print_manifest == (output is not None):
        raise click.UsageError("give either --output DIR or --print", click.get_current_context())
    require_outputs(json_file)

    from colonnade.common import progress
    from colonnade.design import design_folder, generator

    if output is not None:
        design_folder.check_replaceable(output)
        if json_file is not None and design_folder.holds(output, json_file):
            raise UserError(f"{json_file} is in the folder that --output replaces: choose another path for --json")

    terminal = progress.for_terminal()
    if print_manifest or output is None:
        design = generator.manifest_for(config, overrides, terminal)
        echo_lines((design.dir / "manifest.json").read_text().rstrip("\n"))
    else:
        design = generator.generate(
            config, overrides, output, manifest_only, black_box_memories, terminal, bus_bytes, pixel_stream, refit
        )
    files = ["manifest.json"] if output is None else design_folder.listed(design.dir)
    manifest = json.loads((design.dir / "manifest.json").read_text())
    if output is not None:
        echo(f"{output}: {len(files)} files, configuration {manifest['configHash'][:12]}")
    finish(
        {
            "config": manifest["config"],
            "config_hash": manifest["configHash"],
            "format_hash": manifest["formatHash"],
            "output": None if output is None else str(output),
            "files": files,
        },
        json_file,
    )
