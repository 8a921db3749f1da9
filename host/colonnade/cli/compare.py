"""``colonnade compare``: the differences between two frames."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import FILE, Command, dists_option, echo, finish, json_option, require_outputs

#: The printed label of each metric, in printing order.
LABELS = {
    "identical": "identical",
    "differing_pixels": "differing pixels",
    "psnr": "PSNR (dB)",
    "ssim": "SSIM",
    "flip": "FLIP",
    "dists": "DISTS",
    "hit_disagreement": "hit or miss differs",
    "triangle_disagreement": "triangle differs",
}


@click.command(cls=Command, short_help="Compare two pictures and their hits.")
@click.argument("a", type=FILE)
@click.argument("b", type=FILE)
@click.option("--hits-a", type=FILE, metavar="FILE", help="Hits of frame A, written by colonnade render --hits.")
@click.option("--hits-b", type=FILE, metavar="FILE", help="Hits of frame B.")
@dists_option
@json_option
def compare(a: Path, b: Path, hits_a: Path | None, hits_b: Path | None, no_dists: bool, json_file: Path | None) -> None:
    """Compare frame B with frame A. Each is a picture, or an .npz file of hits.

    PSNR is in decibels over all channels. Identical pictures have PSNR 100, SSIM 1, FLIP 0 and DISTS 0. "hit or miss
    differs" is a share of all pixels, "triangle differs" a share of the pixels that hit in both frames.
    """
    require_outputs(json_file)

    from colonnade.common import progress
    from colonnade.quality.compare import compare as compare_frames

    with progress.for_terminal().step("comparing"):
        report = compare_frames(a, b, hits_a, hits_b, with_dists=not no_dists)
    for key, label in LABELS.items():
        value = report[key]
        if value is not None:
            formatted = ("no", "yes")[value] if isinstance(value, bool) else f"{value:.6g}"
            echo(f"{label:<20} {formatted}")
    finish(report, json_file)
