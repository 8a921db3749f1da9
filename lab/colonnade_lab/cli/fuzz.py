"""``colonnade fuzz``: corrupt frames, batches of rays and refits, by the RTL and by its model."""

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
    "--refit",
    is_flag=True,
    help="Bend meshes by the refit unit of the AXI4 shell, in place of frames.",
)
@click.option(
    "--axi",
    "bus_bytes",
    type=click.IntRange(4, 64),
    default=16,
    show_default=True,
    metavar="BYTES",
    help="With --refit: width of the shell's data bus.",
)
@click.option(
    "--cases",
    "--frames",
    "cases",
    type=click.IntRange(1, 1_000_000),
    default=200,
    show_default=True,
    metavar="N",
    help="Number of cases: corrupt frames, refits, or rings of batches.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**62),
    default=1,
    show_default=True,
    metavar="N",
    help="Seed of the first case; each later one adds one.",
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    metavar="KIND",
    help="Kind of case. Frames: records, registers, both, maps, gather, instances; a device for rays: rays, batches, "
    "bus; refits: vertices, plans, bus. Repeatable.  [default: all]",
)
@json_option
@click.pass_context
def fuzz(
    context: click.Context,
    config: str,
    overrides: tuple[str, ...],
    refit: bool,
    bus_bytes: int,
    cases: int,
    seed: int,
    kinds: tuple[str, ...],
    json_file: Path | None,
) -> None:
    """Corrupt small legal frames, or batches of a device for rays, or refits, and run them with the RTL and the model.

    Pixels, hits, records, error bits and counters must be equal, also in the legal work that follows each case. The
    table counts cases by kind and outcome: the legal result, another one, an error bit, the watchdog. The exit status
    is 1 if any case differs.
    """
    from colonnade.common import progress
    from colonnade.common.errors import UserError

    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation.fuzz import campaign
    from colonnade_lab.evaluation.fuzz.bench import OUTCOMES

    for kind in kinds:
        if kind not in campaign.ALL_KINDS:
            raise UserError(f"no kind of case {kind}: choose from {', '.join(campaign.ALL_KINDS)}")
    if bus_bytes & (bus_bytes - 1):
        raise UserError(f"--axi is {bus_bytes}: give a power of two from 4 to 64")
    if not refit and context.get_parameter_source("bus_bytes") is not click.core.ParameterSource.DEFAULT:
        raise UserError("--axi is the bus of the refit unit's shell: give --refit, too")
    require_outputs(json_file)
    terminal = progress.for_terminal()

    def show(failed: Disagreement) -> None:
        with terminal.paused():
            click.echo(f"seed {failed.seed}, {failed.kind}, {failed.change}: {'; '.join(failed.differences)}")

    design = campaign.fuzzed_design(config, overrides, refit, bus_bytes, terminal)
    report = campaign.fuzz(design, cases, seed, kinds, terminal, show)
    table = Table((Column("kind", 10, is_text=True), *(Column(outcome, 8, ",") for outcome in OUTCOMES)), click.echo)
    for name, counts in report["kinds"].items():
        table.print(name, *counts.values())
    click.echo(f"{cases:,} cases; the legal work after {report['legal_failures']} of them differs")
    if report["sums"]:
        click.echo(", ".join(f"{number:,} {name}" for name, number in report["sums"].items()))
    finish({"config": config, "overrides": list(overrides), "refit": refit, **report}, json_file)
    if report["disagreements"]:
        context.exit(1)
