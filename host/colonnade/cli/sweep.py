"""``colonnade sweep``: rays per cycle over a range of configurations."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from colonnade.cli.options import (
    FILE,
    configuration_options,
    echo,
    finish,
    json_option,
    measurement_options,
    require_outputs,
)

if TYPE_CHECKING:
    from colonnade.evaluation.measure import Conditions


@click.command(short_help="Measure rays per cycle over a range of configurations.")
@configuration_options
@click.option(
    "--vary",
    "variations",
    multiple=True,
    required=True,
    metavar="KEY=V,V,…",
    help="Values of a field, e.g. array.rows=1,2,4. Repeatable; the sweep covers all combinations.",
)
@click.option("--one-by-one", is_flag=True, help="Vary each field alone; the others stay as in --config.")
@click.option("--mesh", "meshes", multiple=True, metavar="MESH", help="Mesh to render. Repeatable.  [default: teapot]")
@measurement_options
@click.option("--plot", type=FILE, metavar="FILE", help="Plot the rates as PNG.")
@json_option
def sweep(
    config: str,
    overrides: tuple[str, ...],
    variations: tuple[str, ...],
    one_by_one: bool,
    meshes: tuple[str, ...],
    conditions: Conditions,
    plot: Path | None,
    json_file: Path | None,
) -> None:
    """Build and run a design for each combination of values. The table starts with the unchanged --config.

    Cycles are sums over the meshes, rates are geometric means. All configurations are checked before the first frame.
    The first failure ends the sweep.
    """
    require_outputs(plot, json_file)

    from colonnade.common import progress
    from colonnade.common.text_table import Column, Table
    from colonnade.evaluation import sweep as sweeping

    varied = sweeping.parse_variations(variations)
    table = Table(
        (
            *(Column(variation.key, 6) for variation in varied),
            Column("cycles", 11, ","),
            Column("in box", 6, ".3f", group="rays per cycle"),
            Column("per unit", 8, ".4f", group="rays per cycle"),
            Column("to base", 7, ".3f"),
            Column("busiest", 14, is_text=True),
        ),
        echo,
    )

    def show(point: Mapping[str, Any]) -> None:
        values = (value if isinstance(value, str) else json.dumps(value) for value in point["values"].values())
        busiest = dict.fromkeys(mesh["bottleneck"] for mesh in point["meshes"].values())
        table.print(
            *values,
            point["cycles"],
            point["geomean_rays_per_cycle_in_box"],
            point["in_box_per_unit"],
            point["ratio_to_base"],
            ", ".join(busiest),
        )

    report = sweeping.sweep(
        config,
        overrides,
        varied,
        meshes or ("teapot",),
        conditions,
        one_by_one,
        progress.for_terminal(),
        finished=show,
    )
    if plot is not None:
        from colonnade.report.sweep import plot_sweep

        plot_sweep(report, plot)
    finish(report, json_file)
