"""``colonnade inspect``: what a scene image holds."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.commands.options import FILE, finish, json_option, require_outputs


@click.command(short_help="Show what a scene image holds.")
@click.argument("directory", metavar="DIR", type=FILE)
@click.option("--config", metavar="C", help="Hardware that the image is for: a preset, a JSON file, or a precision.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change one field of --config.")
@json_option
def inspect(directory: Path, config: str | None, overrides: tuple[str, ...], json_file: Path | None) -> None:
    """Show what a scene image holds: its tree's statistics and the map of its memory.

    DIR is the folder that colonnade pack wrote. With --config the image must be one for that hardware, and how full
    its memories are is shown as well.
    """
    if overrides and config is None:
        raise click.UsageError("--set changes a configuration: give --config as well", click.get_current_context())
    require_outputs(json_file)

    from colonnade import progress
    from colonnade.generator import manifest_for
    from colonnade.image import SceneImage
    from colonnade.inspect import describe, print_report

    manifest = None if config is None else manifest_for(config, overrides, progress.for_terminal()).manifest
    image = SceneImage.load(directory, manifest)
    print_report(image.header, manifest, click.echo)
    finish(describe(image), json_file)
