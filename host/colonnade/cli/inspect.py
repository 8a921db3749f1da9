"""``colonnade inspect``: what a scene image holds, or what clustering does to a room."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import FILE, echo, finish, json_option, require_outputs


@click.command(short_help="Show what a scene image holds, or what clustering does to a room.")
@click.argument("directory", metavar="DIR", type=FILE, required=False)
@click.option("--config", metavar="C", help="Hardware that the image is for: a preset, a JSON file, or a precision.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change one field of --config.")
@click.option("--background", type=FILE, metavar="ROOM", help="A room's folder: cluster its maps and show the loss.")
@click.option(
    "--encoding",
    type=click.Choice(["twoLevel", "slic"]),
    default="twoLevel",
    show_default=True,
    help="How the room's maps are clustered.",
)
@click.option(
    "--plane-cells",
    type=click.Choice(["8", "16"]),
    default="8",
    show_default=True,
    help="Most cells on a tile's edge in the plane map.",
)
@click.option(
    "--output", type=FILE, metavar="FOLDER", help="Write the room's maps as pictures: before, after, difference."
)
@click.option("--no-dists", is_flag=True, help="Leave out DISTS, whose weights (64 MB) are fetched at its first use.")
@json_option
def inspect(
    directory: Path | None,
    config: str | None,
    overrides: tuple[str, ...],
    background: Path | None,
    encoding: str,
    plane_cells: str,
    output: Path | None,
    no_dists: bool,
    json_file: Path | None,
) -> None:
    """Show what a scene image holds: its tree's statistics and the map of its memory.

    DIR is the folder that colonnade pack wrote. With --config the image must be one for that hardware, and how full
    its memories are is shown as well. With --background instead of DIR a room's maps are clustered, and their bytes
    and losses are shown.
    """
    context = click.get_current_context()
    if overrides and config is None:
        raise click.UsageError("--set changes a configuration: give --config as well", context)
    if (directory is None) == (background is None):
        raise click.UsageError("name the folder of a scene image, or --background ROOM, one of the two", context)
    if output is not None and background is None:
        raise click.UsageError("--output is for the maps of --background", context)
    require_outputs(json_file, folders=[output])
    if background is not None:
        _inspect_environment(background, encoding, int(plane_cells), output, not no_dists, json_file)
    elif directory is not None:
        _inspect_image(directory, config, overrides, json_file)


def _inspect_image(directory: Path, config: str | None, overrides: tuple[str, ...], json_file: Path | None) -> None:
    from colonnade.common import progress
    from colonnade.design.generator import manifest_for
    from colonnade.scene_image.file import SceneImage
    from colonnade.scene_image.inspect import describe, illegal_lines, print_report

    manifest = None if config is None else manifest_for(config, overrides, progress.for_terminal()).manifest
    image = SceneImage.load(directory, manifest)
    print_report(image.header, manifest, echo)
    for line in illegal_lines(image):
        echo(line)
    finish(describe(image), json_file)


def _inspect_environment(
    background: Path, encoding: str, plane_cells: int, output: Path | None, with_dists: bool, json_file: Path | None
) -> None:
    from colonnade.common import progress
    from colonnade.environment.encoding.cache import encoded_environment
    from colonnade.environment.encoding.layout import AttributeLayout
    from colonnade.environment.encoding.quality import measure, report_lines
    from colonnade.environment.encoding.visualise import map_pictures, write_pictures
    from colonnade.environment.load import load_environment

    environment = load_environment(background)
    for note in environment.notes:
        echo(f"colonnade: note: {environment.name}: {note}", err=True)
    with progress.for_terminal().step("measuring the room"):
        image = encoded_environment(
            environment, AttributeLayout(environment.width, environment.height, encoding, plane_cells=plane_cells)
        )
        report = measure(environment, image, with_dists)
    for line in report_lines(report):
        echo(line)
    if output is not None:
        write_pictures(output, map_pictures(environment, image))
    finish(report, json_file)
