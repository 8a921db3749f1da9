"""``colonnade inspect``: the content of a scene image, or the loss of a room's encoded maps."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import (
    FILE,
    Command,
    dists_option,
    echo,
    encoder_option,
    finish,
    json_option,
    require_outputs,
)
from colonnade.maps.encoders import Encoder


@click.command(cls=Command, short_help="Describe a scene image, or the encoded maps of a room.")
@click.argument("directory", metavar="[DIR]", type=FILE, required=False)
@click.option(
    "--config",
    metavar="CONFIG",
    help="Hardware configuration to check the image against: a preset, a JSON file, or a precision.",
)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Set one field of --config. Repeatable.")
@click.option("--background", type=FILE, metavar="DIR", help="Encode the maps of the room in this folder.")
@click.option(
    "--encoding",
    type=click.Choice(["twoLevel", "slic"]),
    default="twoLevel",
    show_default=True,
    help="Encoding of the room's albedo and normal maps.",
)
@encoder_option
@click.option(
    "--output", type=FILE, metavar="DIR", help="Write pictures of the room's maps: source, decoded, difference."
)
@dists_option
@json_option
def inspect(
    directory: Path | None,
    config: str | None,
    overrides: tuple[str, ...],
    background: Path | None,
    encoding: str,
    encoder: Encoder | None,
    output: Path | None,
    no_dists: bool,
    json_file: Path | None,
) -> None:
    """Describe a scene image: the statistics of its BVH and its memory map.

    DIR is a folder written by colonnade pack. With --config the image must match that configuration, and the memory
    utilisation is printed too. With --background instead of DIR the command encodes a room's maps, and prints their
    sizes and their loss.
    """
    context = click.get_current_context()
    if overrides and config is None:
        raise click.UsageError("--set needs --config", context)
    if (directory is None) == (background is None):
        raise click.UsageError("give either the folder of a scene image or --background DIR", context)
    if encoder == "live" and (background is None or encoding == "slic"):
        raise click.UsageError("--encoder live needs --background and the encoding twoLevel", context)
    if output is not None and background is None:
        raise click.UsageError("--output needs --background", context)
    require_outputs(json_file, folders=[output])
    if background is not None:
        _inspect_environment(background, encoding, encoder, output, not no_dists, json_file)
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
    background: Path,
    encoding: str,
    encoder: Encoder | None,
    output: Path | None,
    with_dists: bool,
    json_file: Path | None,
) -> None:
    from colonnade.common import notes, progress
    from colonnade.common.extras import require_extra
    from colonnade.environment.load import load_environment
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.maps.quality import measure, report_lines
    from colonnade.maps.visualise import map_pictures, write_pictures

    require_extra("quality", "inspect --background")
    environment = load_environment(background)
    environment.tell_notes()
    notes.flush()
    with progress.for_terminal().step("encoding the room"):
        layout = AttributeLayout(environment.width, environment.height, encoding)
        image = encoded_environment(environment, layout, encoder=encoder)
        report = measure(environment, image, with_dists)
    for line in report_lines(report):
        echo(line)
    if output is not None:
        write_pictures(output, map_pictures(environment, image))
    finish(report, json_file)
