"""``colonnade ppa``: power, performance (timing) and area of a configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from colonnade.cli.options import (
    FILE,
    Command,
    PositiveNumber,
    configuration_options,
    echo,
    finish,
    json_option,
    require_outputs,
    size_option,
    strict_option,
)

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest

    from colonnade_lab.ppa.power.workload import Workload


@click.command(cls=Command)
@configuration_options
@click.option(
    "--liberty",
    "liberties",
    multiple=True,
    metavar="PATH",
    help="Standard-cell library: asap7 or sky130, which are fetched, or a .lib or .lib.gz file, or a folder of them."
    " Repeatable; all files form one library.",
)
@click.option(
    "--delay", type=PositiveNumber(), metavar="NS", help="Target delay of technology mapping.  [default: 60 FO4]"
)
@click.option(
    "--target",
    type=click.Choice(("asic", "ecp5")),
    default="asic",
    show_default=True,
    help="asic: standard cells; ecp5: a Lattice ECP5 FPGA.",
)
@click.option("--power/--no-power", default=True, show_default=True, help="Estimate power; needs --liberty.")
@click.option(
    "--clock",
    "megahertz",
    type=PositiveNumber(),
    default=200,
    show_default=True,
    metavar="MHZ",
    help="Clock frequency for power.",
)
@click.option("--mesh", default="teapot", show_default=True, metavar="MESH", help="Mesh of the power workload.")
@size_option("Frame size of the power workload.  [default: small enough to replay the whole frame]")
@click.option(
    "--rays",
    type=click.IntRange(1, 1 << 20),
    metavar="N",
    help="Rays of each batch of the power workload, for a device for rays.  [default: 2048]",
)
@click.option(
    "--cycles",
    type=click.IntRange(min=1),
    metavar="N",
    help="Maximum number of cycles to replay on the gate netlist, at some tens per second.  [default: 16000 of a "
    "frame, 200000 of a batch]",
)
@click.option(
    "--rates",
    type=FILE,
    metavar="FILE",
    help="JSON of colonnade bench for this configuration: print its rays per cycle at the chip's area.",
)
@strict_option
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
    rays: int | None,
    cycles: int | None,
    rates: Path | None,
    json_file: Path | None,
) -> None:
    """Synthesise each unit of a configuration separately with Yosys, and sum the units.

    The areas of a traversal unit, a column and the array are sums over their units. Memories are black boxes with an
    area per bit; queues are flip-flops. Without --liberty the gates are Yosys's generic ones, without delays. Results
    are cached per unit: a second run takes seconds.

    For power the RTL renders a frame, or runs a batch of each kind of rays, and the inputs of one traversal unit are
    replayed on its gate netlist.
    """
    from colonnade.common.frame_size import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)
    if target == "ecp5":
        if liberties or delay is not None or rates is not None:
            raise click.UsageError(
                "--target ecp5 takes none of --liberty, --delay and --rates", click.get_current_context()
            )
        finish(_fpga(config, overrides), json_file)
        return

    from colonnade.common import progress
    from colonnade.design.generator import manifest_for

    from colonnade_lab.ppa.equal_area import at_clock, at_equal_area, rates_of
    from colonnade_lab.ppa.measure import measure
    from colonnade_lab.ppa.power.report import Operation
    from colonnade_lab.ppa.summary import UnitTable, summary

    terminal = progress.for_terminal()
    manifest = manifest_for(config, overrides, terminal).manifest
    faster = None if rates is None else rates_of(rates, manifest.config_hash)
    table = UnitTable(echo)
    workloads = _workloads(manifest, mesh, pixels, rays, cycles) if power else ()
    operation = Operation(megahertz, workloads) if power else None
    report: Mapping[str, Any] = measure(config, overrides, liberties, delay, operation, terminal, finished=table.print)
    for line in summary(report):
        echo(line)
    if faster is not None:
        echo(at_equal_area(report, faster))
        echo(at_clock(report, faster))
    finish(report, json_file)


def _workloads(
    manifest: Manifest, mesh: str, size: tuple[int, int] | None, rays: int | None, cycles: int | None
) -> Sequence[Workload]:
    """A frame, or a batch of each kind."""
    from colonnade.common.errors import UserError

    from colonnade_lab.evaluation.ray_bench import KINDS
    from colonnade_lab.ppa.power.batch import BatchWorkload
    from colonnade_lab.ppa.power.frame import FrameWorkload

    frame = FrameWorkload.of_benchmark(mesh, size, cycles or 16_000)
    if not manifest.has_queries:
        if rays is not None:
            raise UserError("--rays is for a device with queries: leave it out")
        return (frame,)
    if size is not None:
        raise UserError("--size is for a device that renders, and this one has queries: give --rays")
    return [BatchWorkload(frame.mesh, kind, rays or 2048, cycles or 200_000) for kind in KINDS]


def _fpga(config: str, overrides: tuple[str, ...]) -> Mapping[str, Any]:
    from colonnade.common import progress

    from colonnade_lab.ppa.studies.fpga import place, summary

    report = place(config, overrides, progress.for_terminal())
    for line in summary(report):
        echo(line)
    return report
