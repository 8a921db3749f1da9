"""``colonnade render``: one frame of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from colonnade.commands.options import FILE, configuration_options, finish, json_option, require_outputs


@click.command(short_help="Render a frame through the hardware, its model, or Embree.")
@click.argument("scene", type=FILE)
@configuration_options
@click.option(
    "--backend",
    type=click.Choice(["rtl", "model", "reference"]),
    default="rtl",
    show_default=True,
    help="rtl: the generated hardware in a simulator; model: its bit-exact model; reference: the unquantised scene.",
)
@click.option("--size", metavar="WxH", help="Size of the frame in pixels, e.g. 640x480. Default: the scene's.")
@click.option("--mesh", metavar="MESH", help="A mesh (name or file) in place of the scene's.")
@click.option("--background", type=FILE, metavar="DIR", help="A background in place of the scene's.")
@click.option("--relit", is_flag=True, help="Show a room in the scene's lights, not the camera's photo of it.")
@click.option("--output", type=FILE, metavar="FILE", help="Write the picture, a PNG.")
@click.option("--hits", "hits_file", type=FILE, metavar="FILE", help="Write hit triangles and distances, an .npz file.")
@json_option
def render(
    scene: Path,
    config: str,
    overrides: tuple[str, ...],
    backend: str,
    size: str | None,
    mesh: str | None,
    background: Path | None,
    relit: bool,
    output: Path | None,
    hits_file: Path | None,
    json_file: Path | None,
) -> None:
    """Render one frame of SCENE, a TOML file, and print what it took."""
    from colonnade.sizes import parse_size

    pixels = parse_size(size) if size is not None else None
    require_outputs(output, hits_file, json_file)

    from colonnade import progress
    from colonnade.hits import Hits, write_hits
    from colonnade.pictures import write_png
    from colonnade.render import render as render_frame

    result = render_frame(
        scene,
        config,
        overrides,
        backend,
        pixels,
        mesh=mesh,
        background=background,
        hits=hits_file is not None,
        progress=progress.for_terminal(),
        relit=relit,
    )
    if output is not None:
        write_png(output, result.image)
    if hits_file is not None:
        write_hits(hits_file, Hits(result.hit_triangles, result.t))
    click.echo(summary(result.report))
    finish(result.report, json_file)


def summary(report: dict[str, Any]) -> str:
    """One or two lines for people from a render's report."""
    rays = report["rays"]
    words = [
        f"{report['backend']}: {report['mesh']['triangles']:,} triangles",
        f"{sum(rays[kind] for kind in ('primary', 'shadow', 'reflection', 'refraction') if rays.get(kind)):,} rays",
    ]
    if report.get("cycles"):
        words.append(f"{report['cycles']:,} cycles")
        words.append(f"{report['rays_per_cycle_in_box']:.3f} rays per cycle in box")
        words.append(f"{report['rays_per_cycle']:.3f} of all")
    seconds = ", ".join(f"{step} {value:.1f} s" for step, value in report["seconds"].items() if value is not None)
    return ", ".join(words) + (f" ({seconds})" if seconds else "")
