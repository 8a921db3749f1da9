"""Colours and normals as three fields of a memory word, and the space in which their errors are judged.

Fields lie low first: red, green, blue, or x, y, z. A colour's are linear, all ones is 1.0; a normal's are two's
complement, unit vectors times 2^(bits - 1) - 1, so that bits - 1 of them are fraction.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.srgb import linear_from_srgb, srgb_from_linear


def packed(fields: NDArray[np.int64], bits: int) -> NDArray[np.uint64]:
    """Words of three fields [..., 3], negative ones in two's complement."""
    low = (fields & ((1 << bits) - 1)).astype(np.uint64)
    shift = np.uint64(bits)
    words: NDArray[np.uint64] = low[..., 0] | (low[..., 1] << shift) | (low[..., 2] << (shift + shift))
    return words


def unpacked(words: NDArray[np.uint64], bits: int, signed: bool) -> NDArray[np.int64]:
    """Fields int64 [..., 3] of words."""
    shifts = np.arange(3, dtype=np.uint64) * np.uint64(bits)
    fields = ((words[..., np.newaxis] >> shifts) & np.uint64((1 << bits) - 1)).astype(np.int64)
    return fields - ((fields >> (bits - 1)) << bits) if signed else fields


@dataclass(frozen=True)
class VectorSpace(ABC):
    """A kind of map: how its vectors are stored, and where distances between them are measured.

    ``spread`` values are what clusters are made of: points [..., 3] whose squared distance is the error.

    Attributes:
        bits: Of a field.
    """

    bits: int

    @abstractmethod
    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """The nearest fields of vectors [..., 3]."""

    @abstractmethod
    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Vectors [..., 3] of words."""

    @abstractmethod
    def spread(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors as points whose squared distances are errors."""

    @abstractmethod
    def gathered(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The vectors of points; any point is allowed."""

    def words(self, vectors: NDArray[np.float64]) -> NDArray[np.uint64]:
        """Vectors as memory words."""
        return packed(self.fields(vectors), self.bits)


class AlbedoSpace(VectorSpace):
    """Linear colours; errors are those of 8-bit sRGB."""

    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """Unsigned, all ones is 1.0."""
        return np.rint(np.clip(vectors, 0.0, 1.0) * ((1 << self.bits) - 1)).astype(np.int64)

    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Linear colours, 0.0 to 1.0."""
        return unpacked(words, self.bits, signed=False) / float((1 << self.bits) - 1)

    def spread(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """sRGB, 0 to 255."""
        return srgb_from_linear(vectors) * 255.0

    def gathered(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Linear colours of points in sRGB."""
        return linear_from_srgb(np.clip(points, 0.0, 255.0) / 255.0)


class NormalSpace(VectorSpace):
    """Unit vectors in view space; errors are chords, on the scale of an 8-bit normal map."""

    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """Signed; 1.0 is the largest number."""
        return np.rint(np.clip(vectors, -1.0, 1.0) * ((1 << (self.bits - 1)) - 1)).astype(np.int64)

    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Vectors as the hardware reads them, unit but for rounding."""
        return unpacked(words, self.bits, signed=True) / float((1 << (self.bits - 1)) - 1)

    def spread(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit vectors times 127.5."""
        return vectors * 127.5

    def gathered(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit vectors in the points' directions; towards the camera for none."""
        lengths = np.linalg.norm(points, axis=-1, keepdims=True)
        safe = np.where(lengths > 1e-9, lengths, 1.0)
        return np.where(lengths > 1e-9, points / safe, np.array([0.0, 0.0, -1.0]))
