"""``colonnade view``: a scene in the browser, while it is edited."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import (
    Command,
    animation_option,
    background_option,
    configuration_options,
    echo,
    encoder_option,
    size_option,
)
from colonnade.maps.encoders import Encoder


@click.command(cls=Command, short_help="Show a scene in the browser, while it is edited.")
@click.argument("scene", type=click.Path())
@configuration_options
@size_option("Frame size in pixels.  [default: 320x240]")
@background_option
@animation_option
@encoder_option
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, metavar="N", help="Port of the page.  [default: a free one]"
)
@click.option("--open/--no-open", "opens", default=True, show_default=True, help="Open the page in a browser.")
def view(
    scene: str,
    config: str,
    overrides: tuple[str, ...],
    size: str | None,
    background: Path | None,
    animation: str | None,
    encoder: Encoder | None,
    port: int,
    opens: bool,
) -> None:
    """Show SCENE, a TOML file, the name of one, or a mesh, in a page at 127.0.0.1, rendered by the bit-exact model.

    Drag orbits, the wheel zooms, shift and drag pans. The scene is loaded again whenever its file or one that it
    reads changes. The key s writes the camera into the file, r goes back to the file's. Ctrl-C ends the command.
    """
    import threading
    import webbrowser

    from colonnade.common.frame_size import parse_size
    from colonnade.common.progress import for_terminal
    from colonnade.scene.parser import scene_file
    from colonnade.viewer.server import ViewServer
    from colonnade.viewer.session import Session

    pixels = parse_size(size) if size is not None else (320, 240)
    file = scene_file(scene)
    is_own = file == Path(scene)
    session = Session(file, config, overrides, pixels, encoder, for_terminal(), is_own, background, animation)
    server = ViewServer(session, port)
    server.start()
    echo(f"{file} is in view; Ctrl-C ends. Its page, for you alone:")
    echo(server.address)
    if opens:
        webbrowser.open(server.link)
    threading.Event().wait()
