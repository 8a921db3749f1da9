"""Compares two pictures, two hits files, or both, for `colonnade compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.hits import Hits, read_hits
from colonnade.common.image_io import read_picture
from colonnade.quality.dists import dists_or_none
from colonnade.quality.image_metrics import compare_hits, compare_pictures

#: Keys of a comparison that need pictures, and keys that need hits.
PICTURE_KEYS = ("identical", "differing_pixels", "psnr", "ssim", "flip", "dists")
HIT_KEYS = ("hit_disagreement", "triangle_disagreement")


def compare(
    first: Path,
    second: Path,
    first_hits: Path | None = None,
    second_hits: Path | None = None,
    with_dists: bool = True,
) -> dict[str, Any]:
    """Compare two frames.

    Args:
        first: reference picture, or a hits file (`.npz`).
        second: test picture, or a hits file.
        first_hits: hits file of the first frame.
        second_hits: hits file of the second frame.
        with_dists: compute DISTS too; its weights are downloaded at the first use.

    Returns:
        The values of `PICTURE_KEYS` and `HIT_KEYS`; None for those without input.

    Raises:
        UserError: The files are of different kinds or sizes, unreadable, or incomplete pairs.
    """
    are_hits = first.suffix == ".npz", second.suffix == ".npz"
    if are_hits[0] != are_hits[1]:
        raise UserError(f"{first} and {second} cannot be compared: give two pictures or two .npz files")
    if are_hits[0]:
        if first_hits or second_hits:
            raise UserError("two .npz files are already hits: leave out --hits-a and --hits-b")
        first_hits, second_hits = first, second
    elif (first_hits is None) != (second_hits is None):
        raise UserError("the hits of one frame are missing: give both --hits-a and --hits-b")

    report: dict[str, Any] = dict.fromkeys((*PICTURE_KEYS, *HIT_KEYS))
    if not are_hits[0]:
        report.update(_compare_pictures(first, second, with_dists))
    if first_hits and second_hits:
        report.update(_compare_hits(first_hits, second_hits))
    return report


def _compare_pictures(first: Path, second: Path, with_dists: bool) -> dict[str, Any]:
    require_extra("quality", "a comparison of pictures")
    pictures = read_picture(first), read_picture(second)
    _require_same_size((first, second), (pictures[0].shape[:2], pictures[1].shape[:2]))
    difference = compare_pictures(*pictures)
    report = {key: getattr(difference, key) for key in PICTURE_KEYS if hasattr(difference, key)}
    return report | {"dists": dists_or_none(*pictures) if with_dists else None}


def _compare_hits(first: Path, second: Path) -> dict[str, Any]:
    hits: tuple[Hits, Hits] = read_hits(first), read_hits(second)
    _require_same_size((first, second), (hits[0].triangle.shape, hits[1].triangle.shape))
    difference = compare_hits(hits[0].numbers(), hits[1].numbers())
    return {key: getattr(difference, key) for key in HIT_KEYS}


def _require_same_size(paths: tuple[Path, Path], shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    if shapes[0] != shapes[1]:
        (height, width), (other_height, other_width) = shapes
        raise UserError(
            f"{paths[0]} is {width}x{height} but {paths[1]} is {other_width}x{other_height}: render both at one --size"
        )
