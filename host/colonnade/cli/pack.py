"""``colonnade pack``: the scene image, which the hardware loads."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import (
    FILE,
    SCENE,
    Command,
    background_option,
    configuration_options,
    echo,
    encoder_option,
    finish,
    json_option,
    mesh_option,
    require_outputs,
    simplify_option,
    size_option,
    strict_option,
)
from colonnade.maps.encoders import Encoder


@click.command(cls=Command, short_help="Pack a scene into the image that the hardware loads.")
@click.argument("scene", type=SCENE)
@configuration_options
@mesh_option
@simplify_option
@background_option
@encoder_option
@click.option(
    "--output", type=FILE, required=True, metavar="DIR", help="Folder for the scene image; created if missing."
)
@click.option("--device-image", type=FILE, metavar="FILE", help="Also write the image that the AXI4 shell loads.")
@click.option(
    "--maps-image",
    type=FILE,
    metavar="FILE",
    help="Also write the maps of the room alone, for a device that holds the scene already.",
)
@click.option(
    "--dram-image",
    type=FILE,
    metavar="FILE",
    help="Also write the records as a design with a cache reads them from DRAM.",
)
@click.option("--frame-file", type=FILE, metavar="FILE", help="Also write the registers of a frame, for a driver.")
@click.option(
    "--photo-file", type=FILE, metavar="FILE", help="Also write the photo behind the object, for the AXI4 shell."
)
@click.option("--view-file", type=FILE, metavar="FILE", help="Also write what a processor needs to move the object.")
@click.option(
    "--clip-file", type=FILE, metavar="FILE", help="Also write what a processor needs to bend or move meshes."
)
@size_option("Frame size of --frame-file, --photo-file and --view-file, e.g. 640x480.  [default: the scene's]")
@strict_option
@json_option
def pack(
    scene: Path,
    config: str,
    overrides: tuple[str, ...],
    mesh: str | None,
    simplify: int | None,
    background: Path | None,
    encoder: Encoder | None,
    output: Path,
    device_image: Path | None,
    maps_image: Path | None,
    dram_image: Path | None,
    frame_file: Path | None,
    photo_file: Path | None,
    view_file: Path | None,
    clip_file: Path | None,
    size: str | None,
    json_file: Path | None,
) -> None:
    """Pack SCENE, a TOML file or the name of one such as room, for one configuration; print its use of each memory."""
    if size is not None and frame_file is None and photo_file is None and view_file is None:
        message = "--size is for --frame-file, --photo-file and --view-file"
        raise click.UsageError(message, click.get_current_context())

    from colonnade.common import progress
    from colonnade.common.atomic_files import replacing
    from colonnade.common.errors import UserError
    from colonnade.common.frame_size import parse_size
    from colonnade.common.ledger import declare_output
    from colonnade.design.generator import manifest_for
    from colonnade.render.room_defaults import tell_without_defaults
    from colonnade.scene.parser import load_scene
    from colonnade.scene.passes import of_a_device
    from colonnade.scene.prepared.device_scene import DeviceScene
    from colonnade.scene_image.dram_image import line_layout
    from colonnade.scene_image.file import check_image_file, image_file
    from colonnade.scene_image.inspect import describe, print_report
    from colonnade.scene_image.packer import memory_use

    file = image_file(output)
    check_image_file(file)
    require_outputs(
        json_file,
        device_image,
        maps_image,
        dram_image,
        frame_file,
        photo_file,
        view_file,
        clip_file,
        folders=[file.parent],
    )
    declare_output(file)
    terminal = progress.for_terminal()
    pixels = parse_size(size) if size is not None else None
    described = load_scene(scene, background)
    if mesh is not None:
        described = described.with_mesh(mesh)
    if simplify is not None:
        described = described.with_simplified_mesh(simplify)
    if maps_image is not None and described.background.room is None:
        raise UserError(
            f"--maps-image holds the maps of a room, and {scene} has none: give background.room or --background"
        )
    manifest = manifest_for(config, overrides, terminal).manifest
    tell_without_defaults(described, config, manifest)
    if dram_image is not None:
        line_layout(manifest)
    with terminal.step("packing"):
        prepared = DeviceScene.of(of_a_device(described), manifest, encoder=encoder, progress=terminal)
        image = prepared.image
        # Everything is encoded before anything is written: a refusal leaves no file
        others: list[tuple[str, Path, bytes]] = []
        if device_image is not None:
            others.append(("for a bus", device_image, prepared.device_image()))
        if maps_image is not None and (maps := prepared.maps_image()) is not None:
            others.append(("maps", maps_image, maps))
        if dram_image is not None:
            others.append(("for DRAM", dram_image, prepared.dram_image()))
        width, height = pixels or (described.frame.width, described.frame.height)
        if frame_file is not None:
            registers = prepared.frame_file((width, height), composited=photo_file is not None)
            others.append(("a frame", frame_file, registers))
        if photo_file is not None:
            photo = prepared.photo_file((width, height))
            if photo is None:
                raise UserError(f"--photo-file holds the photo behind the object, and {scene} has no photo of its view")
            others.append(("a photo", photo_file, photo))
        if view_file is not None:
            others.append(("a view", view_file, prepared.view_file((width, height), composited=True)))
        if clip_file is not None:
            others.append(("a clip", clip_file, prepared.clip_file()))
    image.save(output)
    echo(f"packed      {file}")
    for title, path, content in others:
        with replacing(path) as stream:
            stream.write(content)
        size_of_frame = f", {width}x{height}" if path in (frame_file, photo_file, view_file) else ""
        echo(f"{title:<11} {path}{size_of_frame}")
    print_report(image.header, manifest, echo)
    finish({"file": str(file), **describe(image), "use": memory_use(image.header, manifest)}, json_file)
