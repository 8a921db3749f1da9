"""``colonnade generate``: Verilog and manifest of a configuration."""

from __future__ import annotations

import json
from pathlib import Path

import click

from colonnade.commands.options import FILE, configuration_options, finish, json_option, require_outputs


@click.command(short_help="Write the Verilog and the manifest of a configuration.")
@configuration_options
@click.option("--output", type=FILE, metavar="DIR", help="Folder to write; replaced when it holds a design already.")
@click.option("--manifest-only", is_flag=True, help="Write manifest.json only: much quicker.")
@click.option("--print", "print_manifest", is_flag=True, help="Print the manifest instead of writing it.")
@click.option("--black-box-memories", is_flag=True, help="Leave the memories out as black boxes, for SRAM macros.")
@json_option
def generate(
    config: str,
    overrides: tuple[str, ...],
    output: Path | None,
    manifest_only: bool,
    print_manifest: bool,
    black_box_memories: bool,
    json_file: Path | None,
) -> None:
    """Generate the accelerator: SystemVerilog files, their list filelist.f, and manifest.json.

    The manifest describes the configuration, the layouts of all records, the register map and the streams.
    """
    if print_manifest == (output is not None):
        raise click.UsageError("give either --output DIR or --print", click.get_current_context())
    require_outputs(json_file)

    from colonnade import generator, progress

    shown = progress.for_terminal()
    if print_manifest or output is None:
        design = generator.manifest_for(config, overrides, shown)
        click.echo((design.dir / "manifest.json").read_text().rstrip("\n"))
    else:
        design = generator.generate(config, overrides, output, manifest_only, black_box_memories, shown)
    files = sorted(path.relative_to(design.dir).as_posix() for path in design.dir.rglob("*") if path.is_file())
    manifest = json.loads((design.dir / "manifest.json").read_text())
    if output is not None:
        click.echo(f"{output}: {len(files)} files, configuration {manifest['configHash'][:12]}")
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
