"""The ``colonnade`` command: its subcommands and its error handling."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from colonnade import __version__
from colonnade.cli.capture import capture
from colonnade.cli.compare import compare
from colonnade.cli.generate import generate
from colonnade.cli.inspect import inspect
from colonnade.cli.laboratory import laboratory
from colonnade.cli.light import light
from colonnade.cli.options import echo
from colonnade.cli.pack import pack
from colonnade.cli.rays import rays
from colonnade.cli.registers import registers
from colonnade.cli.render import render
from colonnade.cli.view import view
from colonnade.common import ledger, machine_limits, notes, progress
from colonnade.common.errors import UserError, reason_of
from colonnade.common.terminal_text import one_line

#: Exit status for wrong input, and for an internal error.
WRONG_INPUT = 2
BUG = 1
#: The environment variable that, set to anything but 0, prints the traceback of an unexpected error.
DEBUG = "COLONNADE_DEBUG"
#: Former commands, and what replaces them.
REPLACED = {"sweep": "colonnade explore STUDY.toml"}
#: The commands of the laboratory, which is a distribution of its own, and their summaries. Each one is defined in the
#: module of its name in `colonnade_lab.cli`.
LABORATORY = {
    "study": "Measure reconstructed rooms, or AR frames in them.",
    "verify": "Compare the RTL with its model, and the model with Embree.",
    "fuzz": "Compare the RTL with its model on corrupt frames, batches of rays and refits.",
    "cycles": "Count the cycles of frames, or of a change, by a model in seconds.",
    "bench": "Measure rays per cycle of the benchmark meshes.",
    "explore": "Measure quality, speed, area and power of many configurations.",
    "ppa": "Estimate area, timing and power of a configuration.",
}


class OneLineErrors(click.Group):
    """A command group that reports each error as one line on standard error, without a traceback."""

    def main(self, args: Sequence[str] | None = None, prog_name: str | None = None, **extra: Any) -> NoReturn:  # type: ignore[override]
        """Run a command line and exit with a status: 0 success, 1 internal error, 2 wrong input, 130 interrupted."""
        extra.pop("standalone_mode", None)
        try:
            with ledger.opened(), notes.opened(_note):
                status = super().main(args, prog_name, standalone_mode=False, **extra)
        except UserError as error:
            _fail(str(error), WRONG_INPUT)
        except click.UsageError as error:
            command = error.ctx.command_path if error.ctx else "colonnade"
            message = " ".join(error.format_message().split()).rstrip(".")
            _fail(f"{message}; see {command} --help", WRONG_INPUT)
        except click.ClickException as error:
            _fail(error.format_message(), WRONG_INPUT)
        except (click.Abort, KeyboardInterrupt):
            _fail("interrupted", 130)
        except Exception as error:
            _fail(*_unexpected(error))
        except BaseException as error:
            # A package in Rust that failed raises no Exception
            if type(error).__name__ != "PanicException":
                raise
            _fail(*_unexpected(error))
        sys.exit(status if isinstance(status, int) else 0)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; a former one is an error that names what replaces it."""
        if args[0] in REPLACED:
            ctx.fail(f"there is no {args[0]} any more: use {REPLACED[args[0]]}")
        name, command, rest = super().resolve_command(ctx, args)
        machine_limits.check(name or "")
        return name, command, rest

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A command by its name; commands of the laboratory are imported here."""
        return _of_laboratory(cmd_name) if cmd_name in LABORATORY else super().get_command(ctx, cmd_name)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which a user needs them, not alphabetically."""
        return [*self.commands, *LABORATORY]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, the laboratory's apart and without importing them."""
        own = [(name, command.get_short_help_str()) for name, command in self.commands.items()]
        for title, rows in (("Commands", own), ("Commands of the laboratory, colonnade-lab", [*LABORATORY.items()])):
            with formatter.section(title):
                formatter.write_dl(rows)


def _of_laboratory(name: str) -> click.Command:
    """The command of the laboratory; a `UserError` if it is not installed."""
    command = getattr(laboratory(name), name)
    assert isinstance(command, click.Command)
    return command


def _note(line: str) -> None:
    with progress.hidden():
        echo(f"colonnade: note: {line}", err=True)


def _unexpected(error: BaseException) -> tuple[str, int]:
    """Message and exit status for an error that no command handles: a limit of the machine, or a bug."""
    if os.environ.get(DEBUG, "0") not in ("", "0"):
        traceback.print_exception(error)
    if isinstance(error, MemoryError):
        return "out of memory: use a smaller input or frame", WRONG_INPUT
    if isinstance(error, RecursionError):
        return "the input is nested too deeply", WRONG_INPUT
    if isinstance(error, OSError):
        paths = [os.fsdecode(name) for name in (error.filename, error.filename2) if isinstance(name, str | bytes)]
        return ": ".join([*paths, reason_of(error)]), WRONG_INPUT
    if isinstance(error, UnicodeError):
        return f"the input is not UTF-8 text: {error}", WRONG_INPUT
    description = f"{type(error).__name__}: {error}".rstrip(": ")
    if not isinstance(error, RuntimeError) and (limit := machine_limits.reached(1, str(error))) is not None:
        return f"this machine's limit of {limit} is reached: {description}", WRONG_INPUT
    return f"{description} (internal error; {DEBUG}=1 prints the traceback)", BUG


def _fail(message: str, status: int) -> NoReturn:
    click.echo(f"colonnade: error: {one_line(message)}", err=True)
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        # The reader of the pipe is gone: keep the interpreter from flushing again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(status)


@click.group(cls=OneLineErrors, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="colonnade")
@click.pass_context
def cli(context: click.Context) -> None:
    """Generate the Colonnade ray-tracing accelerator, render scenes with it, and measure it.

    An existing output file is replaced only if it is a regular, writable file. A command never overwrites its own
    inputs or another of its outputs.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for command in (generate, registers, pack, inspect, capture, light, render, view, compare, rays):
    cli.add_command(command)
