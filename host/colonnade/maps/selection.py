"""Selects the best subset of candidates for each tile, and the best choice per tile within a memory budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Tiles per batch, so that their costs fit a cache.
_TILES = 32


def best_subsets(
    costs: NDArray[np.float32], counts: tuple[int, ...], rounds: int
) -> dict[int, tuple[NDArray[np.intp], NDArray[np.float64]]]:
    """Choose for each tile the subset of candidates with the lowest cost; each cell takes the best member.

    The members are added greedily, up to the largest of ``counts``. Then, for each count, each member is replaced in
    turn by the candidate that is best together with the others, ``rounds`` times.

    Args:
        costs: float32 [tiles, cells, candidates].
        counts: Sizes of the subsets, ascending.
        rounds: Replacement rounds.

    Returns:
        For each count, the members, intp [tiles, count], and the costs, float64 [tiles].
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

    def best_addition(reached: NDArray[np.float32] | None) -> NDArray[np.intp]:
        """The candidate with which the cost of each tile is lowest."""
        if reached is None:
            totals = costs.sum(axis=1)
        else:
            np.minimum(costs, reached[:, :, np.newaxis], out=scratch)
            totals = scratch.sum(axis=1)
        best: NDArray[np.intp] = totals.argmin(axis=1)
        return best

    def member_costs(members: NDArray[np.intp]) -> NDArray[np.float32]:
        """Costs of the members: float32 [tiles, cells, members]."""
        return np.take_along_axis(costs, members[:, np.newaxis, :], axis=2)

    results = {}
    chosen: list[NDArray[np.intp]] = []
    reached: NDArray[np.float32] | None = None
    for count in counts:
        while len(chosen) < count:
            chosen.append(best_addition(reached))
            column = costs[tile, :, chosen[-1]]
            reached = column if reached is None else np.minimum(reached, column)
        members = np.stack(chosen, axis=1)
        if count > 1:
            for step in range(rounds * count):
                slot = step % count
                members[:, slot] = best_addition(member_costs(np.delete(members, slot, axis=1)).min(axis=2))
        results[count] = (members, member_costs(members).min(axis=2).sum(axis=1))
        chosen = [members[:, slot] for slot in range(count)]
        reached = member_costs(members).min(axis=2)
    return results


def choose_within_budget(errors: NDArray[np.float64], sizes: NDArray[np.int64], budget: int) -> NDArray[np.intp]:
    """Choose an option for each tile so that the total error is small and the total size is within ``budget``.

    This is Lagrangian rate allocation: each tile minimises error + price * size, with the lowest price that keeps the
    budget. The rest of the budget goes to the upgrades with the largest gain per word.

    Args:
        errors: float64 [tiles, options].
        sizes: int64 [options], words; at least one is 0.
        budget: Words for all tiles.

    Returns:
        The option of each tile, intp [tiles].
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
