"""Metrics of two pictures in regions: the whole frame, the object's pixels, and its shadow."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from colonnade.quality.dists import dists_or_none
from colonnade.quality.image_metrics import flip_map, psnr
from numpy.typing import NDArray

#: Margin of pixels around a region for DISTS, so that the region's outline counts.
MARGIN = 8


@dataclass(frozen=True)
class RegionDifference:
    """The difference of two 8-bit sRGB pictures in a region.

    Attributes:
        pixels: Number of the region's pixels.
        psnr: Over the region's pixels, decibels; None for an empty region.
        flip: Mean over the region's pixels of the whole pictures' FLIP map; None for an empty region.
        dists: Over the region's bounding box with a margin; pixels outside the region are the reference's in both
            pictures. None for an empty region or without DISTS's weights.
    """

    pixels: int
    psnr: float | None
    flip: float | None
    dists: float | None


def compare_regions(
    reference: NDArray[np.uint8],
    test: NDArray[np.uint8],
    regions: Mapping[str, NDArray[np.bool_]],
    with_dists: Collection[str] | bool = True,
) -> dict[str, RegionDifference]:
    """Compare two pictures, uint8 [height, width, 3] sRGB, in each region, bool [height, width].

    Args:
        reference: The true picture.
        test: The other one.
        regions: By name.
        with_dists: Names of the regions whose DISTS is computed too; True: all.
    """
    errors = flip_map(reference, test)
    measured: Collection[str] = regions if with_dists is True else with_dists or ()
    result = {}
    for name, region in regions.items():
        if not region.any():
            result[name] = RegionDifference(0, None, None, None)
            continue
        result[name] = RegionDifference(
            pixels=int(np.count_nonzero(region)),
            psnr=psnr(reference[region], test[region]),
            flip=float(errors[region].mean(dtype=np.float64)),
            dists=dists_or_none(*_cut_out(reference, test, region)) if name in measured else None,
        )
    return result


def frame_regions(
    object_mask: NDArray[np.bool_], shadow_ratio: NDArray[np.float64], darkest: float = 0.97
) -> dict[str, NDArray[np.bool_]]:
    """The regions of an AR frame, by name, as masks bool [height, width].

    Args:
        object_mask: bool [height, width], pixels of the object in the reference.
        shadow_ratio: float64 [height, width, 3], the reference's light with the object over light without it.
        darkest: A background pixel is in the shadow if its ratio is lower in any channel.
    """
    shadow = ~object_mask & (shadow_ratio < darkest).any(axis=2)
    return {"frame": np.ones_like(object_mask), "object": object_mask, "shadow": shadow}


def _cut_out(
    reference: NDArray[np.uint8], test: NDArray[np.uint8], region: NDArray[np.bool_]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    rows, columns = (np.flatnonzero(region.any(axis=axis)) for axis in (1, 0))
    box = tuple(slice(max(0, int(span[0]) - MARGIN), int(span[-1]) + 1 + MARGIN) for span in (rows, columns))
    return reference[box], np.where(region[..., None], test, reference)[box]
