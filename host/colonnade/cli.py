"""The ``colonnade`` command: one subcommand a file in `colonnade.commands`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from colonnade import __version__
from colonnade.commands.bench import bench
from colonnade.commands.compare import compare
from colonnade.commands.fuzz import fuzz
from colonnade.commands.generate import generate
from colonnade.commands.inspect import inspect
from colonnade.commands.pack import pack
from colonnade.commands.ppa import ppa
from colonnade.commands.render import render
from colonnade.commands.study import study
from colonnade.commands.sweep import sweep
from colonnade.commands.verify import verify
from colonnade.errors import UserError

#: Exit status for wrong input.
WRONG_INPUT = 2


class OneLineErrors(click.Group):
    """A group whose errors are one line on standard error; a traceback is a bug."""

    def main(self, args: Sequence[str] | None = None, prog_name: str | None = None, **extra: Any) -> NoReturn:  # type: ignore[override]
        """Run a command line and exit: 0 when all is well, 2 for wrong input, 130 when interrupted."""
        extra.pop("standalone_mode", None)
        try:
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
        sys.exit(status if isinstance(status, int) else 0)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order of the work, not of the alphabet."""
        return list(self.commands)


def _fail(message: str, status: int) -> NoReturn:
    click.echo(f"colonnade: error: {message}", err=True)
    sys.exit(status)


@click.group(cls=OneLineErrors, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="colonnade")
@click.pass_context
def cli(context: click.Context) -> None:
    """Generate the Colonnade ray-tracing accelerator, render with it, and judge its pictures."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for command in (generate, pack, inspect, render, compare, study, verify, fuzz, bench, sweep, ppa):
    cli.add_command(command)


def main() -> NoReturn:
    """Entry point of the console script."""
    cli.main(prog_name="colonnade")
