"""Palettes: k-means over a map's points, and its update by the pixels that a map gave each entry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Points that are compared at a time.
_POINTS = 8192


def nearest(points: NDArray[np.float64], entries: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """For points [n, 3] the nearest of entries [k, 3], and the squared distance."""
    index = np.empty(len(points), np.intp)
    distance = np.empty(len(points))
    p = entries.astype(np.float32)
    squares = (p * p).sum(axis=1)
    for first in range(0, len(points), _POINTS):
        x = points[first : first + _POINTS].astype(np.float32)
        costs = squares - 2.0 * (x @ p.T)
        index[first : first + _POINTS] = costs.argmin(axis=1)
    difference = points - entries[index]
    distance[:] = (difference * difference).sum(axis=1)
    return index, distance


def first_palette(
    points: NDArray[np.float64], weights: NDArray[np.float64], size: int, rounds: int = 6
) -> NDArray[np.float64]:
    """Entries [size, 3] for weighted points [n, 3]: seeds far from one another, then Lloyd's rounds."""
    random = np.random.default_rng(1)
    sample = random.choice(len(points), min(len(points), 16384), replace=False)
    candidates, importance = points[sample], weights[sample]
    entries = np.empty((size, 3))
    entries[0] = np.average(points, axis=0, weights=weights)
    reached = ((candidates - entries[0]) ** 2).sum(axis=1)
    for k in range(1, size):
        odds = np.cumsum(reached * importance)
        pick = int(np.searchsorted(odds, random.random() * odds[-1])) if odds[-1] > 0 else 0
        entries[k] = candidates[min(pick, len(candidates) - 1)]
        reached = np.minimum(reached, ((candidates - entries[k]) ** 2).sum(axis=1))
    for _ in range(rounds):
        index, distance = nearest(points, entries)
        entries = updated(entries, points, weights, index, distance)
    return entries


def updated(
    entries: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    index: NDArray[np.intp],
    distance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Each entry moved to the mean of the points that it stands for; an unused one to where the error is largest."""
    size = len(entries)
    mass = np.bincount(index, weights, size)
    sums = np.stack([np.bincount(index, weights * points[:, axis], size) for axis in range(3)], axis=1)
    moved = np.where(mass[:, np.newaxis] > 0, sums / np.maximum(mass, 1e-12)[:, np.newaxis], entries)
    unused = np.flatnonzero(mass <= 0)
    if unused.size:
        worst = np.argsort(-(weights * distance), kind="stable")[:: max(1, len(points) // (64 * unused.size))]
        moved[unused] = points[worst[: unused.size]] if worst.size >= unused.size else moved[unused]
    return moved
