"""``colonnade capture``: a recording of a moving camera, converted to a sequence and a room."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from colonnade.cli.options import FILE, Command, echo, finish, json_option, require_outputs
from colonnade.common.errors import UserError

if TYPE_CHECKING:
    _RangeType = click.ParamType[tuple[int, int]]
    _VectorType = click.ParamType[tuple[float, float, float]]
else:
    _RangeType = _VectorType = click.ParamType


class FrameRange(_RangeType):
    """A range of frames, A-B."""

    name = "range"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Parse the range."""
        found = re.fullmatch(r"(\d{1,9})-(\d{1,9})", str(value))
        if not found or int(found[1]) > int(found[2]):
            self.fail(f"{value!r} is not a range of frames, such as 0-99", param, ctx)
        return int(found[1]), int(found[2])


class Direction(_VectorType):
    """A direction, X,Y,Z."""

    name = "vector"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the direction."""
        try:
            x, y, z = map(float, str(value).split(","))
        except ValueError:
            x = y = z = 0.0
        if not 1e-6 < x * x + y * y + z * z < 1e12:
            self.fail(f"{value!r} is not a direction, such as 0,0,1", param, ctx)
        return x, y, z


@click.command(cls=Command, short_help="Convert a phone's or depth camera's recording to a sequence and a room.")
@click.argument("source", type=FILE)
@click.option("--output", type=FILE, required=True, metavar="DIR", help="New or empty folder for the result.")
@click.option(
    "--every", type=click.IntRange(1, 100_000), default=1, show_default=True, metavar="N", help="Take each Nth frame."
)
@click.option("--frames", "only", type=FrameRange(), metavar="A-B", help="Take frames A to B; the first one is 0.")
@click.option(
    "--up",
    type=Direction(),
    metavar="X,Y,Z",
    help="What points up in the capture's world, such as 0,0,1; by default the format's vertical, or the floor's,"
    " of a table, or of walls.",
)
@json_option
def capture(
    source: Path,
    output: Path,
    every: int,
    only: tuple[int, int] | None,
    up: tuple[float, float, float] | None,
    json_file: Path | None,
) -> None:
    """Convert SOURCE, a recording with depth and poses, to a sequence and a room in DIR.

    SOURCE is an .r3d file of Record3D, or a folder of Stray Scanner (odometry.csv), TUM RGB-D (groundtruth.txt) or
    nerfstudio (transforms.json). DIR gets sequence.toml, photo and depth of each frame in 640x480, and DIR/0000, the
    first frame as a room, which other commands take as --background or background.room. The world is made level, with
    the floor at 0. Notes on standard error say what was assumed or made up.
    """
    require_outputs(json_file, folders=[output])

    import numpy as np

    from colonnade.capture.convert import ROOM, convert
    from colonnade.common import progress
    from colonnade.common.atomic_files import made_folder
    from colonnade.common.temporary import replace, temporary_folder

    if output.is_dir() and any(output.iterdir()):
        raise UserError(f"{output} is not empty: name a new folder")
    if not output.name or output.name == "..":
        raise UserError(f"{output} cannot be replaced: name a new folder")
    direction = None if up is None else np.array(up)
    with made_folder(output.parent), temporary_folder(f".{output.name}.", output.parent) as folder:
        result = convert(source, folder, every, only, direction, progress.for_terminal())
        replace(folder, output)
    for note in result.notes:
        echo(f"colonnade: note: {note}", err=True)
    width, height = result.size
    echo(
        f"{output}/sequence.toml: {result.frames} frames of {width}x{height} in {result.seconds:.1f} s, from"
        f" {result.format}; depth noise {result.depth_noise:.2%}"
    )
    echo(f"{output}/{ROOM}: the first frame as a room")
    finish(asdict(result), json_file)
