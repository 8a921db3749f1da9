"""``colonnade fuzz``: corrupt frames rendered by the RTL and by its model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from colonnade.cli.options import Command, configuration_options, finish, json_option, require_outputs

if TYPE_CHECKING:
    from colonnade_lab.evaluation.fuzz.campaign import Disagreement


@click.command(cls=Command)
@configuration_options
@click.option(
    "--frames",
    type=click.IntRange(1, 1_000_000),
    default=200,
    show_default=True,
    metavar="N",
    help="Number of corrupt frames.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**62),
    default=1,
    show_default=True,
    metavar="N",
    help="Seed of the first frame; each later frame adds one.",
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    metavar="KIND",
    help="Kind of corruption: records, registers, both, maps or gather. Repeatable.  [default: all]",
)
@json_option
@click.pass_context
def fuzz(
    context: click.Context,
    config: str,
    overrides: tuple[str, ...],
    frames: int,
    seed: int,
    kinds: tuple[str, ...],
    json_file: Path | None,
) -> None:
    """Corrupt records and registers of small legal frames, and render them with the RTL and the model.

    Pixels, hits, error bits and counters must be equal, also in the legal frame that follows each corrupt one. The
    table counts frames by kind and outcome: legal picture, changed picture, error bit, watchdog. The exit status is 1
    if any frame differs.
    """
    from colonnade.common import progress
    from colonnade.common.errors import UserError
    from colonnade.design.generator import design_for

    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation.fuzz import campaign
    from colonnade_lab.evaluation.fuzz.corruption import KINDS

    for kind in kinds:
        if kind not in KINDS:
            raise UserError(f"no kind of corruption {kind}: choose from {', '.join(KINDS)}")
    require_outputs(json_file)
    terminal = progress.for_terminal()

    def show(failed: Disagreement) -> None:
        with terminal.paused():
            click.echo(f"seed {failed.seed}, {failed.kind}, {failed.change}: {'; '.join(failed.differences)}")

    report = campaign.fuzz(design_for(config, overrides, terminal), frames, seed, kinds, terminal, show)
    table = Table(
        (Column("kind", 10, is_text=True), *(Column(outcome, 8, ",") for outcome in campaign.OUTCOMES)), click.echo
    )
    for name, counts in report["kinds"].items():
        table.print(name, *counts.values())
    click.echo(f"{frames:,} corrupt frames; {report['legal_failures']} of the legal frames after them differ")
    if (gathered := report["gathered"]) is not None:
        click.echo(f"{gathered['corrupt']:,} corrupt and {gathered['legal']:,} legal frames gathered light")
    finish({"config": config, "overrides": list(overrides), **report}, json_file)
    if report["disagreements"]:
        context.exit(1)
