"""What the caches of a design read for rays, in the order that they have (docs/rays.md)."""

from __future__ import annotations

from dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest


@dataclass(frozen=True)
class Traffic:
    """Sums over all rays.

    Attributes:
        records: Reads of records by columns. Rays of a column that want a record at the same time share its read.
        bytes: Read from DRAM, in whole beats of its bus.
    """

    records: int
    bytes: int


def cache_shape(manifest: Manifest) -> tuple[list[int], int]:
    """Columns, rays in flight in one, lines and ways of its cache and of the shared one, records of a line; its bytes.

    Raises:
        UserError: The design has no caches.
    """
    array, memory = manifest.config["array"], manifest.config["columnBvhMemory"]
    cache, line = memory["cache"], manifest.memories["columnBvh"].get("line")
    if cache is None or line is None:
        raise UserError("the design has no caches: choose one whose scene is in DRAM, such as edge")
    sizes = [cache[name] for name in ("lines", "ways", "sharedLines", "sharedWays")]
    beats = -(-line["bytes"] // cache["busBytes"])
    return [array["columns"], array["rows"] * array["contexts"], *sizes, line["records"]], beats * cache["busBytes"]
