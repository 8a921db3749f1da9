"""Palette fitting by weighted k-means.

This is our own code because SciPy's k-means accepts no weights, and because the encoder interleaves update steps with
its own assignment of pixels to entries.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colonnade.common import fixed_order

#: Points per batch of distance computations.
_POINTS = 8192


def nearest(points: NDArray[np.float64], entries: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Index of the nearest of entries [k, 3] for each of points [n, 3], and the squared distances [n]."""
    index = np.empty(len(points), np.intp)
    distance = np.empty(len(points))
    p = entries.astype(np.float32)
    squares = (p * p).sum(axis=1)
    for first in range(0, len(points), _POINTS):
        x = points[first : first + _POINTS].astype(np.float32)
        costs = squares - 2.0 * fixed_order.product(x, p.T)
        index[first : first + _POINTS] = costs.argmin(axis=1)
    difference = points - entries[index]
    distance[:] = (difference * difference).sum(axis=1)
    return index, distance


def initial_palette(
    points: NDArray[np.float64], weights: NDArray[np.float64], size: int, rounds: int = 6
) -> NDArray[np.float64]:
    """Fit entries [size, 3] to weighted points [n, 3]: k-means++ seeding, then Lloyd iterations."""
    random = np.random.default_rng(1)
    sample = random.choice(len(points), min(len(points), 16384), replace=False)
    candidates, importance = points[sample], weights[sample]
    entries = np.empty((size, 3))
    entries[0] = np.average(points, axis=0, weights=weights)
    distances = ((candidates - entries[0]) ** 2).sum(axis=1)
    for k in range(1, size):
        odds = np.cumsum(distances * importance)
        pick = int(np.searchsorted(odds, random.random() * odds[-1])) if odds[-1] > 0 else 0
        entries[k] = candidates[min(pick, len(candidates) - 1)]
        distances = np.minimum(distances, ((candidates - entries[k]) ** 2).sum(axis=1))
    for _ in range(rounds):
        index, distance = nearest(points, entries)
        entries = update_palette(entries, points, weights, index, distance)
    return entries


def update_palette(
    entries: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    index: NDArray[np.intp],
    distance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Move each entry to the weighted mean of its points, and unused entries to points with the largest errors."""
    size = len(entries)
    mass = np.bincount(index, weights, size)
    sums = np.stack([np.bincount(index, weights * points[:, axis], size) for axis in range(3)], axis=1)
    moved = np.where(mass[:, np.newaxis] > 0, sums / np.maximum(mass, 1e-12)[:, np.newaxis], entries)
    unused = np.flatnonzero(mass <= 0)
    if unused.size:
        worst = np.argsort(-(weights * distance), kind="stable")[:: max(1, len(points) // (64 * unused.size))]
        moved[unused] = points[worst[: unused.size]] if worst.size >= unused.size else moved[unused]
    return moved
