"""Options of all commands: one with a single value is refused if it comes twice."""

from __future__ import annotations

from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.cli.options import takes_one


def leaves(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """The commands below a group, by their words."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from leaves(command, (*words, name))
        else:
            yield (*words, name), command


COMMANDS = dict(leaves(cli))


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_an_option_with_one_value_is_refused_if_it_comes_twice(words: tuple[str, ...]) -> None:
    options = [each for each in COMMANDS[words].params if isinstance(each, click.Option) and takes_one(each)]
    for option in options:
        name = option.opts[0]
        pairs = [name, *option.secondary_opts] if option.is_flag else [f"{name}=a", f"{name}=b"]
        done = CliRunner().invoke(cli, [*words, *pairs])
        assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
        assert done.stderr.startswith(f"colonnade: error: {'/'.join(option.opts)} is given twice; see ")


def test_other_options_may_come_again() -> None:
    again = ["--set", "array.rows=2", "--set", "array.rows=3", "--manifest-only", "--manifest-only", "--print"]
    done = CliRunner().invoke(cli, ["generate", "--config", "tiny", *again])
    assert done.exit_code == 0 and '"rows": 3' in done.stdout
