"""Options that several subcommands share."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from colonnade.common.terminal_text import plain

if TYPE_CHECKING:
    from colonnade.evaluation.measure import Conditions


if TYPE_CHECKING:
    _NumberType = click.ParamType[float]
else:
    _NumberType = click.ParamType


class PositiveNumber(_NumberType):
    """A finite number above zero: click's own range takes ``nan`` and ``inf``."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number of a text."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number > 0):
            self.fail(f"{value!r} is no finite number above 0", param, ctx)
        return number


Command = TypeVar("Command", bound=Callable[..., Any])

#: A path argument; whether it exists is checked where it is read, with a message that says what it should be.
FILE = click.Path(path_type=Path)


def configuration_options(command: Command) -> Command:
    """Add ``--config`` and ``--set``: which hardware is meant."""
    command = click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="KEY=VALUE",
        help="Change one field of the configuration, e.g. array.rows=4. May be repeated.",
    )(command)
    return click.option(
        "--config",
        default="small",
        show_default=True,
        metavar="C",
        help="Hardware: a preset (tiny, small, edge), a JSON file, or a precision such as 32b32s64d.",
    )(command)


def measurement_options(command: Command) -> Callable[..., Any]:
    """Add ``--size``, ``--jobs`` and ``--reuse``: the command gets them as `conditions`, on the benchmark's scene."""

    @functools.wraps(command)
    def with_conditions(*, size: str | None, jobs: int | None, reuse: bool, **others: Any) -> Any:
        return command(conditions=_conditions(size, jobs, reuse), **others)

    wrapped = click.option(
        "--reuse/--fresh",
        default=False,
        show_default=True,
        help="Take the counters of a kept run of the same hardware and the same scene image.",
    )(with_conditions)
    wrapped = click.option(
        "--jobs",
        type=click.IntRange(min=1),
        metavar="N",
        help="Frames to render at a time, each on one processor. Default: the number of processors.",
    )(wrapped)
    return click.option("--size", metavar="WxH", help="Size of the frames in pixels. Default: the benchmark scene's.")(
        wrapped
    )


def _conditions(size: str | None, jobs: int | None, reuse: bool) -> Conditions:
    from colonnade.common.frame_size import parse_size
    from colonnade.common.parallel import processors
    from colonnade.design.toolchain import project_root
    from colonnade.evaluation.measure import Conditions

    pixels = parse_size(size) if size is not None else None
    return Conditions(project_root() / "scenes" / "object.toml", pixels, jobs or processors(), reuse)


def json_option(command: Command) -> Command:
    """Add ``--json``: the report for machines."""
    return click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write the report as JSON.")(command)


def require_outputs(*paths: Path | None, folders: Sequence[Path | None] = ()) -> None:
    """Refuse outputs that cannot be written, before the work starts; no file read later may be one of them."""
    from colonnade.common.atomic_files import check_folder, check_writable
    from colonnade.common.ledger import declare_output

    for path in paths:
        if path is not None:
            check_writable(path)
            declare_output(path)
    for folder in folders:
        if folder is not None:
            check_folder(folder)


def echo(text: str, err: bool = False) -> None:
    """Print a line; control characters, which files and arguments may hold, are escaped."""
    click.echo(plain(text), err=err)


def finish(report: Mapping[str, Any], json_file: Path | None) -> None:
    """Write the report where ``--json`` asks for it."""
    if json_file is not None:
        from colonnade.common.atomic_files import write_json

        write_json(json_file, report)
