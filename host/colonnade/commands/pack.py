"""``colonnade pack``: the scene image that the hardware loads."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.commands.options import FILE, configuration_options, echo, finish, json_option, require_outputs


@click.command(short_help="Pack a scene into the image that the hardware loads.")
@click.argument("scene", type=FILE)
@configuration_options
@click.option("--mesh", metavar="MESH", help="A mesh (name or file) in place of the scene's.")
@click.option("--background", type=FILE, metavar="DIR", help="A background in place of the scene's.")
@click.option("--output", type=FILE, required=True, metavar="DIR", help="Folder for the scene image; made if missing.")
@json_option
def pack(
    scene: Path,
    config: str,
    overrides: tuple[str, ...],
    mesh: str | None,
    background: Path | None,
    output: Path,
    json_file: Path | None,
) -> None:
    """Pack SCENE, a TOML file, for one configuration, and print what it uses of each memory."""
    from colonnade import progress
    from colonnade.generator import manifest_for
    from colonnade.image import check_image_file, image_file
    from colonnade.inspect import describe, print_report
    from colonnade.ledger import declare_output
    from colonnade.pack import memory_use
    from colonnade.render import pack_scene
    from colonnade.room_registers import HeldRoom
    from colonnade.scene import load_scene

    file = image_file(output)
    check_image_file(file)
    require_outputs(json_file, folders=[file.parent])
    declare_output(file)
    shown = progress.for_terminal()
    described = load_scene(scene)
    if mesh is not None:
        described = described.with_mesh(mesh)
    if background is not None:
        described = described.with_room(background)
    manifest = manifest_for(config, overrides, shown).manifest
    folder = described.background.room
    with shown.step("packing"):
        room = None if folder is None else HeldRoom.load(folder, manifest)
        image = pack_scene(described, manifest, room)
    image.save(output)

    echo(f"packed      {file}")
    print_report(image.header, manifest, echo)
    finish({"file": str(file), **describe(image), "use": memory_use(image.header, manifest)}, json_file)
