"""A backend of `colonnade.rays.Scene` that keeps what a device would get."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from colonnade.rays.device import RayBackend
from colonnade.scene_image.file import LoadSection

#: Where a descriptor has its tag.
TAG = slice(44, 48)


@dataclass(frozen=True)
class RayRecords:
    """What a device for rays loads."""

    records: NDArray[np.uint8]
    attributes: tuple[LoadSection, ...] = ()


@dataclass
class RecordedRays(RayBackend):
    """Keeps a scene and batches, which have no hits.

    Attributes:
        values: The registers of the scene and its rays, by name.
        records: Its records, as the last call of `load` gave them.
        batches: Descriptor without addresses, rays, and bytes of hits of each batch.
    """

    values: dict[str, int] = field(default_factory=dict)
    records: RayRecords | None = None
    batches: list[tuple[bytes, bytes, int]] = field(default_factory=list)

    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """See `RayBackend`."""
        self.values, self.records = dict(values), RayRecords(np.frombuffer(records, np.uint8).reshape(count, -1))

    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """See `RayBackend`."""
        self.batches.append((batch, rays, size))
        return int.from_bytes(batch[TAG], "little"), bytes(size)

    def counters(self) -> dict[str, int]:
        """See `RayBackend`. A device that does nothing counts nothing."""
        return {}
