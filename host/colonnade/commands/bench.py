"""``colonnade bench``: rays per cycle of the benchmark's meshes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from colonnade.commands.options import configuration_options, finish, json_option, require_outputs


@click.command(short_help="Measure rays per cycle of the benchmark's meshes.")
@configuration_options
@click.option("--mesh", "meshes", multiple=True, metavar="MESH", help="Only this mesh. May be repeated.")
@click.option("--size", metavar="WxH", help="Size of the frames in pixels. Default: the benchmark scene's.")
@json_option
def bench(
    config: str, overrides: tuple[str, ...], meshes: tuple[str, ...], size: str | None, json_file: Path | None
) -> None:
    """Render each benchmark mesh through the RTL; print rays per cycle and the busiest unit.

    In box counts the rays that enter the object's box, over all cycles of the frame. Meshes that are not built in
    are looked for in the folders of COLONNADE_MESHES.
    """
    from colonnade.sizes import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)

    from colonnade import bench as benchmark
    from colonnade import progress
    from colonnade.toolchain import project_root

    def show(name: str, result: Mapping[str, Any]) -> None:
        busiest = result["bottleneck"]
        click.echo(
            f"{name:<14} {result['triangles']:>9,} {result['cycles']:>11,} {result['rays_per_cycle_in_box']:>8.3f} "
            f"{result['rays_per_cycle']:>9.3f}   {busiest} {result['utilisation'][busiest]:.0%}"
        )

    click.echo(f"{'mesh':<14} {'triangles':>9} {'cycles':>11} {'in box':>8} {'all rays':>9}   busiest")
    report = benchmark.bench(
        project_root() / "scenes" / "object.toml",
        config,
        overrides,
        meshes or benchmark.MESHES,
        pixels,
        progress.for_terminal(),
        show,
    )
    click.echo(
        f"geometric mean {report['geomean_rays_per_cycle_in_box']:.3f} rays per cycle in box, "
        f"{report['ratio_to_paper']:.1f} times the paper's {benchmark.PAPER_RAYS_PER_CYCLE}"
    )
    finish(report, json_file)
