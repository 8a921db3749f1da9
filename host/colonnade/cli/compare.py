"""``colonnade compare``: how far two frames are apart."""

from __future__ import annotations

from pathlib import Path

import click

from colonnade.cli.options import FILE, echo, finish, json_option, require_outputs

#: What each number is called for people, in the order they are printed.
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


@click.command(short_help="Compare two pictures and the hits behind them.")
@click.argument("a", type=FILE)
@click.argument("b", type=FILE)
@click.option("--hits-a", type=FILE, metavar="FILE", help="Hits of frame A, as colonnade render --hits writes them.")
@click.option("--hits-b", type=FILE, metavar="FILE", help="Hits of frame B.")
@click.option("--no-dists", is_flag=True, help="Leave out DISTS, whose weights (64 MB) are fetched at its first use.")
@json_option
def compare(a: Path, b: Path, hits_a: Path | None, hits_b: Path | None, no_dists: bool, json_file: Path | None) -> None:
    """Compare frame B with frame A: two pictures, or two .npz files of hits.

    PSNR is in decibels over all channels, 100 for identical pictures; SSIM is 1, FLIP and DISTS are 0 for those. Hit
    disagreement is a share of all pixels, triangle disagreement one of the pixels that hit in both frames.
    """
    require_outputs(json_file)

    from colonnade.common import progress
    from colonnade.quality.compare import compare as compare_frames

    with progress.for_terminal().step("comparing"):
        report = compare_frames(a, b, hits_a, hits_b, with_dists=not no_dists)
    for key, label in LABELS.items():
        value = report[key]
        if value is not None:
            shown = ("no", "yes")[value] if isinstance(value, bool) else f"{value:.6g}"
            echo(f"{label:<20} {shown}")
    finish(report, json_file)
