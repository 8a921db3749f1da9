"""Which few of many candidates serve a tile best, and which tiles deserve how much memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Tiles that are worked on at a time: their costs fit a cache.
_TILES = 32


def best_subsets(
    costs: NDArray[np.float32], counts: tuple[int, ...], rounds: int
) -> dict[int, tuple[NDArray[np.intp], NDArray[np.float64]]]:
    """For every tile the candidates that serve its cells best, each cell by the best one of them.

    Greedy: the best one, the best next to it, and so on up to the largest of ``counts``; then, for each count, every
    member in turn is replaced by the best one beside the others, ``rounds`` times.

    Args:
        costs: float32 [tiles, cells, candidates].
        counts: Sizes of the subsets, ascending.
        rounds: Of replacement.

    Returns:
        For each count: intp [tiles, count] candidates, float64 [tiles] costs.
    """
    tiles = costs.shape[0]
    results = {count: (np.empty((tiles, count), np.intp), np.empty(tiles)) for count in counts}
    for first in range(0, tiles, _TILES):
        part = slice(first, min(first + _TILES, tiles))
        for count, (members, total) in _subsets(costs[part], counts, rounds).items():
            results[count][0][part] = members
            results[count][1][part] = total
    return results


def _subsets(
    costs: NDArray[np.float32], counts: tuple[int, ...], rounds: int
) -> dict[int, tuple[NDArray[np.intp], NDArray[np.float32]]]:
    tile = np.arange(costs.shape[0])
    scratch = np.empty_like(costs)

    def best_beside(reached: NDArray[np.float32] | None) -> NDArray[np.intp]:
        """The candidate whose addition lowers the cost most."""
        if reached is None:
            totals = costs.sum(axis=1)
        else:
            np.minimum(costs, reached[:, :, np.newaxis], out=scratch)
            totals = scratch.sum(axis=1)
        best: NDArray[np.intp] = totals.argmin(axis=1)
        return best

    def of(members: NDArray[np.intp]) -> NDArray[np.float32]:
        """Costs [tiles, cells, members]."""
        return np.take_along_axis(costs, members[:, np.newaxis, :], axis=2)

    results = {}
    chosen: list[NDArray[np.intp]] = []
    reached: NDArray[np.float32] | None = None
    for count in counts:
        while len(chosen) < count:
            chosen.append(best_beside(reached))
            column = costs[tile, :, chosen[-1]]
            reached = column if reached is None else np.minimum(reached, column)
        members = np.stack(chosen, axis=1)
        if count > 1:
            for turn in range(rounds * count):
                place = turn % count
                members[:, place] = best_beside(of(np.delete(members, place, axis=1)).min(axis=2))
        results[count] = (members, of(members).min(axis=2).sum(axis=1))
        chosen = [members[:, place] for place in range(count)]
        reached = of(members).min(axis=2)
    return results


def within_budget(errors: NDArray[np.float64], sizes: NDArray[np.int64], budget: int) -> NDArray[np.intp]:
    """A choice for every tile, so that the sum of errors is small and the sum of sizes is at most ``budget``.

    Lagrange: each tile takes what minimises error + price * size; the price is the least that keeps the budget. What
    is left goes to the upgrades that gain most for a word.

    Args:
        errors: float64 [tiles, choices].
        sizes: int64 [choices]; some choice has the size 0.
        budget: Of all tiles together.

    Returns:
        intp [tiles].
    """

    def at(price: float) -> NDArray[np.intp]:
        choice: NDArray[np.intp] = (errors + price * sizes).argmin(axis=1)
        return choice

    tile = np.arange(errors.shape[0])
    low, high = 0.0, float(errors.max()) + 1.0
    if sizes[at(0.0)].sum() <= budget:
        return at(0.0)
    for _ in range(60):
        middle = (low + high) / 2
        if sizes[at(middle)].sum() <= budget:
            high = middle
        else:
            low = middle
    choice = at(high)
    left = budget - int(sizes[choice].sum())
    while left > 0:
        gain = errors[tile, choice][:, np.newaxis] - errors
        more = sizes[np.newaxis, :] - sizes[choice][:, np.newaxis]
        fits = (more > 0) & (more <= left) & (gain > 0)
        if not fits.any():
            break
        rate = np.where(fits, gain / np.maximum(more, 1), 0.0)
        which, upgrade = np.unravel_index(int(rate.argmax()), rate.shape)
        left -= int(more[which, upgrade])
        choice[which] = upgrade
    return choice
