"""``colonnade verify``: is the hardware its model, and how far is the model from the float scene?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from colonnade.commands.options import configuration_options, finish, json_option, require_outputs


@click.command(short_help="Compare the hardware with its model, and the model with Embree.")
@configuration_options
@click.option("--mesh", "meshes", multiple=True, metavar="MESH", help="Only this mesh. May be repeated.")
@click.option("--size", metavar="WxH", help="Size of the frames in pixels. Default: the benchmark scene's.")
@click.option("--rtl/--no-rtl", default=True, show_default=True, help="Render through the hardware too.")
@click.option("--reference/--no-reference", default=True, show_default=True, help="Compare with the float scene too.")
@json_option
@click.pass_context
def verify(
    context: click.Context,
    config: str,
    overrides: tuple[str, ...],
    meshes: tuple[str, ...],
    size: str | None,
    rtl: bool,
    reference: bool,
    json_file: Path | None,
) -> None:
    """Render each benchmark mesh through the RTL, the model and Embree, and print what differs.

    Exit status 1 when any pixel, hit or counter of the RTL differs from the model's.
    """
    from colonnade.sizes import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)

    from colonnade import bench, progress, verification
    from colonnade.toolchain import project_root

    def show(name: str, result: dict[str, Any]) -> None:
        click.echo(row(name, result))

    click.echo(HEADING)
    report = verification.verify(
        project_root() / "scenes" / "object.toml",
        config,
        overrides,
        meshes or bench.MESHES,
        pixels,
        with_rtl=rtl,
        with_reference=reference,
        progress=progress.for_terminal(),
        finished=show,
    )
    finish(report, json_file)
    if not report["equal"]:
        context.exit(1)


HEADING = (
    f"{'':<14} {'':>9}  RTL against model: differing   model against float scene\n"
    f"{'mesh':<14} {'triangles':>9} {'pixels':>8} {'hits':>8} {'counters':>9} "
    f"{'hit/miss %':>12} {'triangle %':>11} {'PSNR dB':>8}"
)


def row(name: str, result: dict[str, Any]) -> str:
    """One line of the table; a dash for what was not compared."""
    rtl, reference = result["rtl"], result["reference"]
    left = f"{rtl['pixels']:>8} {rtl['triangles']:>8} {rtl['counters']:>9}" if rtl else f"{'-':>8} {'-':>8} {'-':>9}"
    right = f"{'-':>12} {'-':>11} {'-':>8}"
    if reference:
        shares = f"{100 * reference['hit_disagreement']:>12.4f} {100 * reference['triangle_disagreement']:>11.4f}"
        right = f"{shares} {reference['psnr']:>8.2f}"
    return f"{name:<14} {result['triangles']:>9,} {left} {right}"
