"""Chooses the words that tiles share in a heap.

A descriptor may point to any words, also to another tile's. So tiles offer their words, and any tile may take
any of them, with another error.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from colonnade.maps.subdivision import Subdivided

#: The share of the heap that a step tries to spend better: the first one, and the least one.
_FIRST_SHARE, _LEAST_SHARE = 0.4, 0.02
#: Most errors, of offers with tiles.
_MOST_ERRORS = 1 << 26


@dataclass(frozen=True)
class Offered:
    """Sequences of words that tiles may have.

    Attributes:
        free: float32 [tiles], errors of tiles without a sequence.
        errors: float32 [sequences, tiles].
        sizes: int64 [sequences], words.
    """

    free: NDArray[np.float32]
    errors: NDArray[np.float32]
    sizes: NDArray[np.int64]

    def reached(self, chosen: NDArray[np.bool_]) -> NDArray[np.float32]:
        """The error of each tile with the best of the chosen sequences, float32 [tiles]."""
        reached: NDArray[np.float32] = np.minimum(self.free, self.errors[chosen].min(axis=0, initial=np.inf))
        return reached

    def without_least(self, chosen: NDArray[np.bool_], words: int) -> NDArray[np.bool_]:
        """The chosen sequences without the least gains per word: as many as have so many words, at least one."""
        which = np.flatnonzero(chosen)
        options = np.vstack([self.free, self.errors[which]])
        if len(options) < 2:
            return chosen
        two = np.partition(options, 1, axis=0)[:2]
        loss = np.bincount(options.argmin(axis=0), two[1] - two[0], len(options))[1:]
        order = np.argsort(loss / self.sizes[which], kind="stable")
        kept, count = chosen.copy(), np.searchsorted(self.sizes[which][order].cumsum(), words, side="right")
        kept[which[order[: max(1, count)]]] = False
        return kept

    def filled(self, chosen: NDArray[np.bool_], budget: int) -> NDArray[np.bool_]:
        """Add sequences to the chosen ones, always the one that gains most per word, until the budget is spent."""
        filled, left = chosen.copy(), budget - int(self.sizes[chosen].sum())
        reached = self.reached(chosen)
        gains = np.maximum(reached - self.errors, 0).sum(axis=1) / self.sizes
        queue = [(-float(gains[which]), int(which)) for which in np.flatnonzero((gains > 0) & ~chosen)]
        heapq.heapify(queue)
        while queue:
            _, which = heapq.heappop(queue)
            if self.sizes[which] > left:
                continue
            # A gain only falls while others are added, so the first that is still the largest is the best
            gain = float(np.maximum(reached - self.errors[which], 0).sum() / self.sizes[which])
            if queue and gain < -queue[0][0]:
                heapq.heappush(queue, (-gain, which))
            elif gain > 0:
                filled[which] = True
                left -= int(self.sizes[which])
                reached = np.minimum(reached, self.errors[which])
        return filled


@dataclass(frozen=True)
class Users:
    """The tiles that share words of one mode.

    Attributes:
        shared: The words, as subdivisions of the tiles that they were made for.
        tiles: intp [n], the tiles that have them.
        rows: intp [n], which of `shared` each of these tiles has.
    """

    shared: Subdivided
    tiles: NDArray[np.intp]
    rows: NDArray[np.intp]

    def subdivided(self) -> Subdivided:
        """The tiles with the words as they are."""
        return replace(self.shared[self.rows], tiles=self.tiles)


def shared_words(
    free: NDArray[np.float64],
    offers: Sequence[Subdivided],
    in_heap: Sequence[NDArray[np.bool_]],
    errors_of: Callable[[Subdivided], NDArray[np.float32]],
    budget: int,
) -> tuple[NDArray[np.intp], list[Users]]:
    """Choose the words that are in the heap, and the words of each tile.

    In large maps only words that are in the heap anyway are offered, in very large ones none.

    Args:
        free: float64 [tiles], errors of tiles without words.
        offers: For each mode, tiles whose words may be shared.
        in_heap: For each mode bool [its tiles], whose words are in the heap without sharing.
        errors_of: Errors of all tiles with words, float32 [words, tiles].
        budget: Words of the heap.

    Returns:
        The tiles without words, and the users of each mode.
    """
    if sum(len(offer.tiles) for offer in offers) * len(free) > _MOST_ERRORS:
        offers = [offer[np.flatnonzero(kept)] for offer, kept in zip(offers, in_heap, strict=True)]
        in_heap = [np.ones(len(offer.tiles), dtype=np.bool_) for offer in offers]
    if sum(len(offer.tiles) for offer in offers) * len(free) > _MOST_ERRORS:
        alone = np.setdiff1d(np.arange(len(free)), np.concatenate([offer.tiles for offer in offers]))
        return alone, [Users(offer, offer.tiles, np.arange(len(offer.tiles))) for offer in offers]
    distinct, starts = [], []
    for offer, is_in_heap in zip(offers, in_heap, strict=True):
        _, first, row = np.unique(offer.words(), axis=0, return_index=True, return_inverse=True)
        distinct.append(offer[first])
        starts.append(np.bincount(row.ravel(), is_in_heap, len(first)) > 0)
    base = free.astype(np.float32)
    errors = np.concatenate([errors_of(part) for part in distinct])
    counts = [len(part.tiles) for part in distinct]
    sizes = np.repeat([part.mode.words for part in distinct], counts)
    which = np.flatnonzero(choose_shared(Offered(base, errors, sizes), budget, np.concatenate(starts)))
    best = np.vstack([base, errors[which]]).argmin(axis=0)
    has = np.append(-1, which)[best]
    users = []
    for part, begin, end in zip(distinct, np.cumsum([0, *counts]), np.cumsum(counts), strict=False):
        tiles = np.flatnonzero((has >= begin) & (has < end))
        used, rows = np.unique(has[tiles] - begin, return_inverse=True)
        users.append(Users(part[used], tiles, rows))
    return np.flatnonzero(has < 0), users


def choose_shared(offered: Offered, budget: int, start: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Choose sequences so that the sum of the tiles' errors is small, where each tile takes the best chosen sequence.

    From ``start`` on, each step drops the sequences that gain least per word, and adds the ones that gain most per word
    in their place. A step that does not reduce the error is undone and followed by a smaller one.

    Args:
        offered: The sequences.
        budget: Words of all chosen sequences; ``start`` is within it.
        start: bool [sequences], the first choice; the result has at most its error.

    Returns:
        bool [sequences].
    """
    best, share = offered.filled(start, budget), _FIRST_SHARE
    least = float(offered.reached(best).sum(dtype=np.float64))
    while share >= _LEAST_SHARE:
        tried = offered.filled(offered.without_least(best, int(share * budget)), budget)
        error = float(offered.reached(tried).sum(dtype=np.float64))
        # Rounding makes sums of tiny errors negative
        if error < least - 1e-4 * abs(least):
            best, least = tried, error
        else:
            share /= 2
    return best
