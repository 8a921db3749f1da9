"""``colonnade pack``: the scene image that the hardware loads."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.commands.options import FILE, configuration_options, finish, json_option, require_outputs


@click.command(short_help="Pack a scene into the image that the hardware loads.")
@click.argument("scene", type=FILE)
@configuration_options
@click.option("--mesh", metavar="MESH", help="A mesh (name or file) in place of the scene's.")
@click.option("--output", type=FILE, required=True, metavar="DIR", help="Folder for the scene image; made if missing.")
@json_option
def pack(
    scene: Path, config: str, overrides: tuple[str, ...], mesh: str | None, output: Path, json_file: Path | None
) -> None:
    """Pack SCENE, a TOML file, for one configuration, and print what it uses of each memory."""
    require_outputs(json_file)

    from colonnade import progress
    from colonnade.generator import manifest_for
    from colonnade.inspect import describe, print_report
    from colonnade.meshes import load_mesh
    from colonnade.pack import memory_use
    from colonnade.pack import pack as pack_mesh
    from colonnade.scene import load_scene
    from colonnade.viewpoint import made_of

    shown = progress.for_terminal()
    described = load_scene(scene)
    if mesh is not None:
        described = described.with_mesh(mesh)
    manifest = manifest_for(config, overrides, shown).manifest
    with shown.step("loading the mesh"):
        loaded = load_mesh(described.mesh_source)
    with shown.step("packing"):
        image = pack_mesh(loaded, manifest, made_of(loaded.materials, described.material))
    file = image.save(output)

    click.echo(f"packed      {file}")
    print_report(image.header, manifest, click.echo)
    finish({"file": str(file), **describe(image), "use": memory_use(image.header, manifest)}, json_file)
