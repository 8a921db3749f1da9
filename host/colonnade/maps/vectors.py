"""Storage formats of colours and normals, and the spaces in which their errors are measured.

A memory word holds three fields, low bits first: red, green, blue, or x, y, z. Colours are linear and unsigned; all
ones is 1.0. Normals are in two's complement, scaled by 2^(bits - 1) - 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from colonnade.common.srgb import linear_from_srgb, srgb_from_linear


def pack(fields: NDArray[np.int64], bits: int) -> NDArray[np.uint64]:
    """Pack three fields [..., 3] into words; negative fields are in two's complement."""
    low = (fields & ((1 << bits) - 1)).astype(np.uint64)
    shift = np.uint64(bits)
    words: NDArray[np.uint64] = low[..., 0] | (low[..., 1] << shift) | (low[..., 2] << (shift + shift))
    return words


def unpack(words: NDArray[np.uint64], bits: int, signed: bool) -> NDArray[np.int64]:
    """Unpack words into fields, int64 [..., 3]."""
    shifts = np.arange(3, dtype=np.uint64) * np.uint64(bits)
    fields = ((words[..., np.newaxis] >> shifts) & np.uint64((1 << bits) - 1)).astype(np.int64)
    return fields - ((fields >> (bits - 1)) << bits) if signed else fields


@dataclass(frozen=True)
class VectorSpace(ABC):
    """The storage format of a map's vectors, and the space in which they are clustered.

    `to_points` maps vectors to points [..., 3] whose squared distance is the error.

    Attributes:
        bits: Bits of a field.
    """

    bits: int

    @abstractmethod
    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """Quantise vectors [..., 3] to the nearest fields."""

    @abstractmethod
    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Decode words to vectors [..., 3]."""

    @abstractmethod
    def to_points(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map vectors to points whose squared distances are errors."""

    @abstractmethod
    def from_points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map any points to the nearest valid vectors."""

    def words(self, vectors: NDArray[np.float64]) -> NDArray[np.uint64]:
        """Encode vectors as memory words."""
        return pack(self.fields(vectors), self.bits)


class AlbedoSpace(VectorSpace):
    """Linear colours; errors are measured in 8-bit sRGB."""

    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """Quantise to unsigned fields; all ones is 1.0."""
        return np.rint(np.clip(vectors, 0.0, 1.0) * ((1 << self.bits) - 1)).astype(np.int64)

    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Decode to linear colours, 0.0 to 1.0."""
        return unpack(words, self.bits, signed=False) / float((1 << self.bits) - 1)

    def to_points(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map to sRGB, 0 to 255."""
        return srgb_from_linear(vectors) * 255.0

    def from_points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points in sRGB to linear colours."""
        return linear_from_srgb(np.clip(points, 0.0, 255.0) / 255.0)


class NormalSpace(VectorSpace):
    """Unit vectors in view space; errors are chord lengths on the scale of an 8-bit normal map."""

    def fields(self, vectors: NDArray[np.float64]) -> NDArray[np.int64]:
        """Quantise to signed fields; 1.0 is the largest value."""
        return np.rint(np.clip(vectors, -1.0, 1.0) * ((1 << (self.bits - 1)) - 1)).astype(np.int64)

    def vectors(self, words: NDArray[np.uint64]) -> NDArray[np.float64]:
        """Decode as the hardware does; unit length up to rounding."""
        return unpack(words, self.bits, signed=True) / float((1 << (self.bits - 1)) - 1)

    def to_points(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scale unit vectors by 127.5."""
        return vectors * 127.5

    def from_points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalise points to unit vectors; a zero point gives the direction to the camera."""
        lengths = np.linalg.norm(points, axis=-1, keepdims=True)
        safe = np.where(lengths > 1e-9, lengths, 1.0)
        return np.where(lengths > 1e-9, points / safe, np.array([0.0, 0.0, -1.0]))
