"""Packs words into a heap. Equal sequences are stored once, also where they overlap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def pack_words(groups: Sequence[NDArray[np.uint16]], size: int) -> tuple[NDArray[np.uint16], list[NDArray[np.int64]]]:
    """Store sequences, the longest first: each one where its words already are, or behind what ends as it begins.

    Args:
        groups: Sequences of one length each, uint16 [n, length].
        size: Words of the heap; at least as many as all different sequences have.

    Returns:
        The heap, uint16 [size], and for each group the addresses of its sequences, int64 [n].
    """
    heap, pointers = b"", [np.zeros(len(group), np.int64) for group in groups]
    for number in sorted(range(len(groups)), key=lambda number: -groups[number].shape[1]):
        different, row = np.unique(groups[number], axis=0, return_inverse=True)
        places = np.zeros(len(different), np.int64)
        for place, sequence in enumerate(different.astype("<u2")):
            words = sequence.tobytes()
            places[place] = _place(heap, words)
            heap += words[len(heap) - 2 * places[place] :]
        pointers[number] = places[row.ravel()]
    packed = np.zeros(size, np.uint16)
    packed[: len(heap) // 2] = np.frombuffer(heap, dtype="<u2")
    return packed, pointers


def _place(heap: bytes, words: bytes) -> int:
    """The first word of a heap from which on words lie there, or from which on its end is their beginning."""
    start = heap.find(words)
    while start % 2 and start >= 0:
        start = heap.find(words, start + 1)
    if start >= 0:
        return start // 2
    common = next((size for size in range(len(words) - 2, 0, -2) if heap.endswith(words[:size])), 0)
    return (len(heap) - common) // 2
