"""``colonnade bench``: rays per cycle of the benchmark meshes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from colonnade.cli.options import (
    FILE,
    MESH,
    Command,
    configuration_options,
    echo,
    echo_lines,
    finish,
    json_option,
    require_outputs,
    require_suffix,
    size_option,
    strict_option,
)

if TYPE_CHECKING:
    from colonnade.common.progress import Progress

    from colonnade_lab.common.text_table import Table


@click.command(cls=Command)
@configuration_options
@click.option("--mesh", "meshes", multiple=True, type=MESH, metavar="MESH", help="Render only this mesh. Repeatable.")
@size_option("Frame size in pixels.  [default: the benchmark scene's]")
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Frames to render in parallel, one processor each.  [default: number of processors]",
)
@click.option(
    "--reuse/--fresh",
    default=False,
    show_default=True,
    help="Reuse cached results of earlier runs, also of explore.",
)
@click.option("--mirror/--no-mirror", default=True, show_default=True, help="Also render the meshes as mirrors.")
@click.option(
    "--dram-latency",
    type=click.IntRange(1, 100_000),
    metavar="CYCLES",
    help="Cycles from a read of DRAM, with --dram-banks of an open row, to its first data.  [default: 100]",
)
@click.option(
    "--dram-interval",
    type=click.IntRange(1, 1000),
    metavar="CYCLES",
    help="Cycles from a beat of DRAM to the next one.  [default: 1]",
)
@click.option(
    "--dram-banks",
    type=click.Choice(("0", "1", "2", "4", "8", "16")),
    help="Banks of a DRAM with rows and refresh; 0: every read takes the same latency.  [default: 0]",
)
@click.option(
    "--rays",
    "rays",
    type=click.IntRange(1, 1 << 24),
    metavar="N",
    help="Instead of frames, run batches of N rays of each kind on a device for rays, with one mesh.",
)
@click.option("--plot", type=FILE, metavar="FILE", help="Plot the utilisation of each stage as PNG.")
@strict_option
@json_option
def bench(
    config: str,
    overrides: tuple[str, ...],
    meshes: tuple[str, ...],
    size: str | None,
    jobs: int | None,
    reuse: bool,
    mirror: bool,
    rays: int | None,
    plot: Path | None,
    json_file: Path | None,
    **memory: int | str | None,
) -> None:
    """Render each benchmark mesh with the RTL; print rays per cycle and the bottleneck. If the hardware supports
    bounces, render each mesh again as a mirror with one reflection.

    "in box" counts only rays that enter the object's bounding box, over all cycles of the frame. "busiest" names the
    unit or port with the highest utilisation. The bounds are in-box rays per cycle for the same reads and tests: with
    a perfect memory the busiest unit is the limit, with perfect units the busiest port. Meshes that are not built in
    come from the folders in COLONNADE_MESHES.
    """
    from colonnade.common.frame_size import parse_size

    pixels = parse_size(size) if size is not None else None
    require_suffix("--plot", plot, ".png")
    require_outputs(plot, json_file)

    from colonnade.common import progress
    from colonnade.design.generator import manifest_for

    from colonnade_lab.common import paper
    from colonnade_lab.common.parallel import processors
    from colonnade_lab.evaluation.bench import MESHES
    from colonnade_lab.explore.bench import bench as run_benchmark

    terminal = progress.for_terminal()
    if rays is not None:
        if len(meshes) > 1:
            raise click.UsageError("--rays is with one --mesh", click.get_current_context())
        finish(_batches(config, overrides, meshes[0] if meshes else "armadillo", rays, terminal), json_file)
        return
    names = meshes or MESHES
    dram = {name: int(value) for name, value in memory.items() if value is not None}

    def measured(mirror: bool) -> dict[str, Any]:
        table = _table()
        report = run_benchmark(
            config,
            overrides,
            names,
            pixels,
            jobs or processors(),
            terminal,
            partial(_show, table),
            reuse=reuse,
            mirror=mirror,
            dram=dram,
        )
        in_box, bounds = report["geomean_rays_per_cycle_in_box"], report["geomean_bounds"]
        means = (in_box, report["geomean_rays_per_cycle"], bounds["perfect_memory"], bounds["perfect_units"])
        table.print("geometric mean", None, None, *means, None, None, None, None, "")
        echo(
            f"{in_box:.3f} in-box rays per cycle: "
            f"{report['ratio_to_paper']:.1f} times the paper's {paper.RAYS_PER_CYCLE}"
        )
        return report

    report = measured(mirror=False)
    if plot is not None:
        from colonnade_lab.report.stages import plot_stages

        plot_stages(report, plot)
    report["mirror"] = None
    if mirror and int(manifest_for(config, overrides, terminal).manifest.config["frame"]["maxBounces"]) > 0:
        echo_lines("\nAs mirrors, with one reflection:")
        report["mirror"] = measured(mirror=True)
    finish(report, json_file)


def _batches(config: str, overrides: tuple[str, ...], mesh: str, rays: int, terminal: Progress) -> dict[str, Any]:
    """Batches of a device for rays, see `colonnade_lab.evaluation.ray_bench`."""
    from dataclasses import asdict, astuple

    from colonnade.design.generator import manifest_for
    from colonnade.mesh.load import load_mesh
    from colonnade.rays.device import require_rays

    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation.ray_bench import measured

    table = Table(
        (
            Column("rays", 32, is_text=True),
            Column("cycles", 11, ","),
            Column("all", 6, ".3f", group="rays per cycle"),
            Column("in box", 6, ".3f", group="rays per cycle"),
            Column("nodes", 6, ".1f", group="a ray"),
            Column("triangles", 9, ".1f", group="a ray"),
        ),
        echo,
    )
    manifest = manifest_for(config, overrides, terminal).manifest
    require_rays(manifest)
    kinds = []
    for each in measured(load_mesh(mesh), config, overrides, rays, progress=terminal):
        kinds.append(asdict(each))
        table.print(*astuple(each))
    return {"config": manifest.config, "mesh": mesh, "rays": rays, "kinds": kinds}


def _table() -> Table:
    from colonnade_lab.common.text_table import Column, Table

    return Table(
        (
            Column("mesh", 14, is_text=True),
            Column("triangles", 9, ","),
            Column("cycles", 11, ","),
            Column("in box", 6, ".3f", group="rays per cycle"),
            Column("all", 6, ".3f", group="rays per cycle"),
            Column("memory", 6, ".3f", group="bound, perfect"),
            Column("units", 6, ".3f", group="bound, perfect"),
            Column("reads/ray", 9, ".2f"),
            Column("DRAM bytes", 10, ".1f"),
            Column("snooped", 7, ".0%"),
            Column("busy", 4, ".0%"),
            Column("busiest", 14, is_text=True),
        ),
        echo,
    )


def _show(table: Table, name: str, result: Mapping[str, Any]) -> None:
    busiest, bounds = result["bottleneck"], result["bounds"]
    table.print(
        name,
        result["triangles"],
        result["cycles"],
        result["rays_per_cycle_in_box"],
        result["rays_per_cycle"],
        bounds["perfect_memory"],
        bounds["perfect_units"],
        result["per_ray"]["record_reads"],
        result["per_ray"].get("dram_bytes"),
        result["snoop_share"],
        result["utilisation"][busiest],
        busiest,
    )
