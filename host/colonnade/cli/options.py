"""Options that several subcommands share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from colonnade.common.errors import UserError
from colonnade.common.terminal_text import plain
from colonnade.maps.encoders import ENCODERS

if TYPE_CHECKING:
    _NumberType = click.ParamType[float]
    _TextType = click.ParamType[str]
    _PathType = click.ParamType[Path]
    _BusType = click.ParamType[int | Literal["auto"]]
else:
    _NumberType = _TextType = _PathType = _BusType = click.ParamType


class PositiveNumber(_NumberType):
    """A finite number above zero. Click's own range type accepts ``nan`` and ``inf``."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse the number."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number > 0):
            self.fail(f"{value!r} is not a finite number above 0", param, ctx)
        return number


class Command(click.Command):
    """A command that refuses an option with one value if it is given twice; click would take the last in silence."""

    def make_parser(self, ctx: click.Context) -> click.parser._OptionParser:
        """A parser that looks for options that come again."""
        parser = super().make_parser(ctx)
        parse = parser.parse_args

        def parse_args(args: list[str]) -> tuple[dict[str, Any], list[str], list[click.Parameter]]:
            values, rest, order = parse(args)
            for option in order:
                if isinstance(option, click.Option) and takes_one(option) and order.count(option) > 1:
                    raise click.UsageError(f"{'/'.join(option.opts)} is given twice", ctx)
            return values, rest, order

        parser.parse_args = parse_args  # type: ignore[method-assign]
        return parser


class Commands(click.Group):
    """A group of such commands."""

    command_class = Command


def takes_one(option: click.Option) -> bool:
    """Whether an option has one value, of which there can be no second one; a flag that is repeated says the same."""
    return not option.multiple and not option.count and not (option.is_flag and not option.secondary_opts)


Decorated = TypeVar("Decorated", bound=Callable[..., Any])

#: A path argument. The code that reads the file checks that it exists and names the expected content.
FILE = click.Path(path_type=Path)


class SceneName(_PathType):
    """A scene file, or the name of one of the project's scenes, such as ``room``. A file of that name comes first."""

    name = "scene"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Find the file; the code that reads it checks that it exists."""
        from colonnade.scene.parser import scene_file

        return scene_file(value)


SCENE = SceneName()


class RoomName(_PathType):
    """The folder of a room, or the name of one of the project's rooms, such as ``living``. A folder comes first."""

    name = "room"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Find the folder; the code that reads it checks that it exists."""
        from colonnade.scene.parser import room_folder

        return room_folder(value)


def configuration_options(command: Decorated) -> Decorated:
    """Add ``--config`` and ``--set``, which choose the hardware configuration."""
    command = click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="KEY=VALUE",
        help="Set one field of the configuration, e.g. array.rows=4. Repeatable.",
    )(command)
    return click.option(
        "--config",
        default="small",
        show_default=True,
        metavar="CONFIG",
        help="Hardware configuration: a preset (tiny, small, fpga, lean, edge, traversal), a JSON "
        "file, or a precision like 32b32s64d.",
    )(command)


class BusBytes(_BusType):
    """The bytes of a bus, or ``auto``; the generator checks the number."""

    name = "bytes"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | Literal["auto"]:
        """Parse the number."""
        if value == "auto":
            return "auto"
        try:
            return int(value)
        except ValueError:
            self.fail(f"{value!r} is neither auto nor a number of bytes", param, ctx)


def bus_option(text: str, **settings: Any) -> Callable[[Decorated], Decorated]:
    """Add ``--axi``, the bus of the AXI4 shell, with a help text."""
    return click.option("--axi", "bus_bytes", type=BusBytes(), metavar="BYTES", help=text, **settings)


def refit_option(command: Decorated) -> Decorated:
    """Add ``--refit``, a part of the AXI4 shell."""
    return click.option("--refit", is_flag=True, help="Add a unit that bends meshes to the shell of --axi.")(command)


def size_option(text: str) -> Callable[[Decorated], Decorated]:
    """Add ``--size`` with a help text."""
    return click.option("--size", metavar="WxH", help=text)


class MeshName(_TextType):
    """The name or the file of a mesh. Scenes are UTF-8 text, and so are their meshes' names."""

    name = "mesh"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the name."""
        text = str(value)
        if not text:
            self.fail("name a mesh or a file", param, ctx)
        try:
            text.encode()
        except UnicodeEncodeError:
            self.fail(f"{text} is not UTF-8: rename the file", param, ctx)
        return text


MESH = MeshName()


def mesh_option(command: Decorated) -> Decorated:
    """Add ``--mesh``, which replaces the scene's mesh."""
    return click.option(
        "--mesh", type=MESH, metavar="MESH", help="Replace the scene's mesh by this one: a name or a file."
    )(command)


def simplify_option(command: Decorated) -> Decorated:
    """Add ``--simplify``, the number of triangles of a large mesh."""
    return click.option(
        "--simplify",
        type=click.IntRange(min=4),
        metavar="N",
        help="Simplify the scene's mesh to N triangles if it has more, in place of the scene's mesh.simplify.",
    )(command)


def strict_option(command: Decorated) -> Decorated:
    """Add ``--strict``, which makes a note on a mesh or a configuration an error."""

    def apply(context: click.Context, parameter: click.Parameter, value: bool) -> None:
        from colonnade.common.notes import be_strict

        if value:
            be_strict()

    return click.option(
        "--strict",
        is_flag=True,
        expose_value=False,
        callback=apply,
        help="Refuse a mesh of which something is not shown, and hardware of which a part is idle, instead of noting it"
        " on standard error.",
    )(command)


def background_option(command: Decorated) -> Decorated:
    """Add ``--background``, also called ``--room``, which replaces the scene's background by a room."""
    return click.option(
        "--background",
        "--room",
        type=RoomName(),
        metavar="DIR",
        help="Replace the scene's background by the room in this folder, or a room of the project such as living.",
    )(command)


def animation_option(command: Decorated) -> Decorated:
    """Add ``--animation``, which replaces the animation of the scene's mesh."""
    return click.option(
        "--animation", metavar="NAME", help="Play this animation of the scene's glTF file, a name or a number."
    )(command)


def encoder_option(command: Decorated) -> Decorated:
    """Add ``--encoder``."""
    return click.option(
        "--encoder",
        type=click.Choice(ENCODERS),
        help="Encoder of a room's maps and of textures. live: for a moving camera; offline: maps that are a little"
        " better, in far more time.  [default: live, where it writes the layout of the maps]",
    )(command)


def dists_option(command: Decorated) -> Decorated:
    """Add ``--no-dists``, which skips the metric whose weights are a download."""
    return click.option(
        "--no-dists", is_flag=True, help="Skip DISTS, whose weights (64 MB) are downloaded at first use."
    )(command)


def json_option(command: Decorated) -> Decorated:
    """Add ``--json``, the file for the machine-readable report."""
    return click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write the report as JSON.")(command)


def require_outputs(*paths: Path | None, folders: Sequence[Path | None] = ()) -> None:
    """Check, before the work starts, that outputs can be written, and declare them so that no input can be one."""
    from colonnade.common.atomic_files import check_folder, check_writable
    from colonnade.common.ledger import declare_output

    for path in paths:
        if path is not None:
            check_writable(path)
            declare_output(path)
    for folder in folders:
        if folder is not None:
            check_folder(folder)


def require_suffix(option: str, path: Path | None, *suffixes: str) -> None:
    """Refuse a file name with the suffix of another format than the one that is written; a name may have none."""
    if path is not None and path.suffix and path.suffix.lower() not in suffixes:
        formats = " or ".join(suffix[1:].upper() for suffix in suffixes)
        raise UserError(f"{option} {path} is written as {formats}: end its name in {' or '.join(suffixes)}")


def echo(text: str, err: bool = False) -> None:
    """Print a line. Control characters and line ends, which files and arguments may contain, are escaped."""
    click.echo(plain(text), err=err)


def echo_lines(text: str) -> None:
    """Print a text of several lines. It holds nothing from files and arguments that could start a line."""
    for line in text.split("\n"):
        echo(line)


def finish(report: Mapping[str, Any], json_file: Path | None) -> None:
    """Write the report to the file of ``--json``, if there is one."""
    if json_file is not None:
        from colonnade.common.atomic_files import write_json

        write_json(json_file, report)
