"""``colonnade fuzz``: corrupt frames through the hardware and its model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from colonnade.cli.options import configuration_options, finish, json_option, require_outputs

if TYPE_CHECKING:
    from colonnade.evaluation.fuzz.campaign import Disagreement


@click.command(short_help="Compare the hardware with its model on corrupt frames.")
@configuration_options
@click.option(
    "--frames", type=click.IntRange(1, 1_000_000), default=200, show_default=True, metavar="N", help="Corrupt frames."
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**62),
    default=1,
    show_default=True,
    metavar="S",
    help="Of the first frame; the others follow.",
)
@click.option("--kind", "kinds", multiple=True, metavar="KIND", help="Only this kind. May be repeated. Default: all.")
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
    """Corrupt records and registers of small legal frames, and render them through the RTL and the model.

    Pixels, hits, error bits and counters must be equal, and so must the legal frame after each. Prints the frames by
    kind and outcome: the legal picture, a changed one, an error bit, the watchdog. Exit status 1 when a frame
    disagrees.
    """
    from colonnade.common import progress
    from colonnade.common.errors import UserError
    from colonnade.common.text_table import Column, Table
    from colonnade.design.generator import design_for
    from colonnade.evaluation.fuzz import campaign
    from colonnade.evaluation.fuzz.corruption import KINDS

    for kind in kinds:
        if kind not in KINDS:
            raise UserError(f"there is no kind of corruption {kind!r}: choose from {', '.join(KINDS)}")
    require_outputs(json_file)
    shown = progress.for_terminal()

    def show(failed: Disagreement) -> None:
        with shown.paused():
            click.echo(f"seed {failed.seed}, {failed.kind}, {failed.change}: {'; '.join(failed.differences)}")

    report = campaign.fuzz(design_for(config, overrides, shown), frames, seed, kinds, shown, show)
    table = Table(
        (Column("kind", 10, is_text=True), *(Column(outcome, 8, ",") for outcome in campaign.OUTCOMES)), click.echo
    )
    for name, counts in report["kinds"].items():
        table.print(name, *counts.values())
    click.echo(f"{frames:,} corrupt frames, {report['legal_failures']} legal frames after them not exact")
    finish({"config": config, "overrides": list(overrides), **report}, json_file)
    if report["disagreements"]:
        context.exit(1)
