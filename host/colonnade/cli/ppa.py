"""``colonnade ppa``: what a configuration costs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from colonnade.cli.options import PositiveNumber, configuration_options, echo, finish, json_option, require_outputs


@click.command(short_help="Measure gates, memories and the slowest paths of a configuration.")
@configuration_options
@click.option(
    "--liberty",
    "liberties",
    multiple=True,
    metavar="F",
    help="Standard cells: a .lib or .lib.gz, or a folder of them. May be repeated: all are one library.",
)
@click.option("--delay", type=PositiveNumber(), metavar="NS", help="Delay to aim at.  [60 FO4]")
@click.option(
    "--target",
    type=click.Choice(("asic", "ecp5")),
    default="asic",
    show_default=True,
    help="Standard cells, or an FPGA of the ECP5 family.",
)
@click.option("--power/--no-power", default=True, show_default=True, help="Measure power, where there is a --liberty.")
@click.option(
    "--clock",
    "megahertz",
    type=PositiveNumber(),
    default=200,
    show_default=True,
    metavar="MHZ",
    help="Clock that power is told for.",
)
@click.option("--mesh", default="teapot", show_default=True, metavar="MESH", help="What is rendered for power.")
@click.option("--size", metavar="WxH", help="Size of that frame in pixels. Default: small enough to be replayed whole.")
@click.option(
    "--cycles",
    type=click.IntRange(min=1),
    default=16000,
    show_default=True,
    metavar="N",
    help="Most cycles of that frame to replay on the gates; some tens a second.",
)
@json_option
def ppa(
    config: str,
    overrides: tuple[str, ...],
    liberties: tuple[str, ...],
    delay: float | None,
    target: str,
    power: bool,
    megahertz: float,
    mesh: str,
    size: str | None,
    cycles: int,
    json_file: Path | None,
) -> None:
    """Synthesise every unit of a configuration on its own, with Yosys, and add them up.

    A render unit, a column and the array are composed: the hierarchy is kept at the units. Memories are black boxes,
    added by an area per bit; queues are flip-flops and count as such. Without --liberty gates are Yosys's own and
    nothing has a delay. Units are kept by content: a second run takes seconds.

    For power a frame is rendered through the RTL, and what one render unit sees of it is replayed on its gates.
    """
    from colonnade.common.frame_size import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)
    if target == "ecp5":
        if liberties or delay is not None:
            raise click.UsageError("--target ecp5 takes neither --liberty nor --delay", click.get_current_context())
        finish(_fpga(config, overrides), json_file)
        return

    from colonnade.common import progress
    from colonnade.ppa.measure import measure
    from colonnade.ppa.pages.text import UnitTable, summary
    from colonnade.ppa.power.recording import Stimulus
    from colonnade.ppa.power.report import Operation

    table = UnitTable(echo)
    operation = Operation(megahertz, Stimulus(mesh, pixels, cycles)) if power else None
    report: Mapping[str, Any] = measure(
        config, overrides, liberties, delay, operation, progress.for_terminal(), finished=table.print
    )
    for line in summary(report):
        echo(line)
    finish(report, json_file)


def _fpga(config: str, overrides: tuple[str, ...]) -> Mapping[str, Any]:
    from colonnade.common import progress
    from colonnade.ppa.studies.fpga import place, summary

    report = place(config, overrides, progress.for_terminal())
    for line in summary(report):
        echo(line)
    return report
