"""``colonnade rays``: the library for rays in C with Embree's calls, and what rays cost."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.laboratory import laboratory
from colonnade.cli.options import FILE, MESH, Command, configuration_options, echo, json_option, require_outputs


@click.command(cls=Command, short_help="Compile the library with Embree's calls, or measure rays a second.")
@configuration_options
@click.option("--mesh", type=MESH, metavar="MESH", default="teapot", show_default=True, help="Mesh that the rays hit.")
@click.option("--rays", "count", type=click.IntRange(1), default=100_000, show_default=True, help="Rays of each kind.")
@click.option("--calls", is_flag=True, help="Measure the CPU time of Embree's calls, of the library and of Embree.")
@click.option("--library", type=FILE, metavar="DIR", help="Compile libembree4.so.4 into a folder, and measure nothing.")
@json_option
def rays(
    config: str,
    overrides: tuple[str, ...],
    mesh: str,
    count: int,
    calls: bool,
    library: Path | None,
    json_file: Path | None,
) -> None:
    """Count the rays that the model and Embree answer a second, and what the model and its caches read for one.

    "shuffled" rays have no order; the others have `colonnade.rays.Scene.order`. The measurements need
    colonnade-lab.

    With --library programs for Embree 4 take their rays from the model, of `edge` without a file.
    """
    require_outputs(json_file)
    if library is not None:
        from colonnade.rays.library import compile_library

        file = compile_library(library, "-march=native")
        echo(str(file))
        echo(f"LD_PRELOAD={file} PROGRAM")
    elif calls:
        laboratory("rays").print_calls(mesh, count, json_file)
    else:
        laboratory("rays").print_rates(config, overrides, mesh, count, json_file)
