"""``colonnade light``: lights for a room, fitted to its photo."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from colonnade.cli.options import FILE, Command, echo, echo_lines, finish, json_option, require_outputs


@click.command(cls=Command, short_help="Fit lights to the photo of a room.")
@click.argument("room", type=FILE)
@click.option(
    "--lights",
    "count",
    type=click.IntRange(min=0, max=4),
    default=2,
    show_default=True,
    metavar="N",
    help="Largest number of point lights; the hardware supports frame.lights.",
)
@click.option("--output", type=FILE, metavar="DIR", help="Write light.png: the photo, the fit, and their difference.")
@json_option
def light(room: Path, count: int, output: Path | None, json_file: Path | None) -> None:
    """Fit ambient light and point lights to the photo of ROOM, a folder, and print them as tables of a scene.

    A scene in a room that names neither a light nor ambient light is rendered under these lights.
    """
    require_outputs(json_file, folders=[output])

    from colonnade.common import notes, progress
    from colonnade.common.atomic_files import made_folder
    from colonnade.common.image_io import write_png
    from colonnade.environment.fitted_lights import fitted_lights
    from colonnade.environment.light_fit import comparison_picture, relit_psnr
    from colonnade.environment.load import load_environment
    from colonnade.environment.photo_colours import photo_colours
    from colonnade.mesh.load import load_mesh
    from colonnade.scene.model import Background, MeshSource, Scene
    from colonnade.scene.object_pose import Placed
    from colonnade.scene.room_lights import lights_of, scene_text

    environment = load_environment(room)
    environment.tell_notes()
    notes.flush()
    with progress.for_terminal().step("fitting lights to the photo"):
        fit = fitted_lights(environment, count)
    colours = photo_colours(environment, fit.lights)
    default = Scene(MeshSource("teapot"), background=Background(room=room))
    before = relit_psnr(environment, lights_of(Placed(default, load_mesh("teapot").extent, environment)))
    echo(
        f"# {environment.name}, relit without shadows, against its photo: {fit.psnr:.1f} dB; ambient light alone"
        f" {fit.ambient_psnr:.1f} dB, the default light of scenes {before:.1f} dB."
    )
    echo(f"# Reflections show the photo with lights of {colours.headroom:.2f}x, too dark in {colours.clamped:.1%}.")
    echo_lines(scene_text(fit.lights))
    if output is not None:
        with made_folder(output):
            write_png(output / "light.png", comparison_picture(environment, fit.lights))
    report = asdict(fit) | {"default_psnr": before, "headroom": colours.headroom, "clamped": colours.clamped}
    finish(report, json_file)
