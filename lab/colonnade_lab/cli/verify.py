"""``colonnade verify``: the RTL against its model, and the model against the floating-point reference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from colonnade.cli.options import (
    FILE,
    MESH,
    Command,
    configuration_options,
    echo,
    finish,
    json_option,
    require_outputs,
    size_option,
    strict_option,
)


@click.command(cls=Command)
@configuration_options
@click.option("--mesh", "meshes", multiple=True, type=MESH, metavar="MESH", help="Render only this mesh. Repeatable.")
@click.option(
    "--scene",
    type=FILE,
    metavar="SCENE",
    help="Scene with the material, lights and paths.  [default: the benchmark's]",
)
@size_option("Frame size in pixels.  [default: the scene's]")
@click.option("--rtl/--no-rtl", default=True, show_default=True, help="Compare the RTL with the model.")
@click.option("--reference/--no-reference", default=True, show_default=True, help="Compare the model with Embree.")
@strict_option
@json_option
@click.pass_context
def verify(
    context: click.Context,
    config: str,
    overrides: tuple[str, ...],
    meshes: tuple[str, ...],
    scene: Path | None,
    size: str | None,
    rtl: bool,
    reference: bool,
    json_file: Path | None,
) -> None:
    """Render each benchmark mesh, or a scene's several objects, with the RTL, the model and Embree, and print the
    differences.

    The exit status is 1 if any pixel, hit or counter of the RTL differs from the model.
    """
    from colonnade.common.frame_size import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)

    from colonnade.common import progress
    from colonnade.design.toolchain import project_root

    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation import verify

    table = Table(
        (
            Column("mesh", 14, is_text=True),
            Column("triangles", 9, ","),
            Column("pixels", 8, group="RTL against model: differing"),
            Column("hits", 8, group="RTL against model: differing"),
            Column("counters", 8, group="RTL against model: differing"),
            Column("hit/miss", 8, ".4%", group="model against float scene"),
            Column("triangle", 8, ".4%", group="model against float scene"),
            Column("PSNR dB", 7, ".2f", group="model against float scene"),
        ),
        echo,
    )
    keys = {
        "rtl": ("pixels", "triangles", "counters"),
        "reference": ("hit_disagreement", "triangle_disagreement", "psnr"),
    }

    def show(name: str, result: dict[str, Any]) -> None:
        compared = [(result[part] or {}).get(key) for part, of_part in keys.items() for key in of_part]
        table.print(name, result["triangles"], *compared)

    report = verify.verify(
        scene or project_root() / "scenes" / "object.toml",
        config,
        overrides,
        meshes,
        pixels,
        with_rtl=rtl,
        with_reference=reference,
        progress=progress.for_terminal(),
        finished=show,
    )
    finish(report, json_file)
    if not report["equal"]:
        context.exit(1)
