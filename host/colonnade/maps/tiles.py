"""Splits maps into tiles and joins them. Edge tiles are padded with the last column and row."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.maps.layout import AttributeLayout


def split_tiles(values: NDArray[Any], layout: AttributeLayout) -> NDArray[Any]:
    """Split [height, width, ...] into [tiles, tile_size, tile_size, ...]."""
    size, rows, columns = layout.tile_size, layout.tile_rows, layout.tile_columns
    margin = ((0, rows * size - layout.height), (0, columns * size - layout.width))
    padded = np.pad(values, margin + ((0, 0),) * (values.ndim - 2), mode="edge")
    grid = padded.reshape(rows, size, columns, size, *values.shape[2:])
    return np.ascontiguousarray(grid.swapaxes(1, 2)).reshape(rows * columns, size, size, *values.shape[2:])


def join_tiles(tiles: NDArray[Any], layout: AttributeLayout) -> NDArray[Any]:
    """Join [tiles, tile_size, tile_size, ...] to [height, width, ...]."""
    size, rows, columns = layout.tile_size, layout.tile_rows, layout.tile_columns
    grid = tiles.reshape(rows, columns, size, size, *tiles.shape[3:]).swapaxes(1, 2)
    return grid.reshape(rows * size, columns * size, *tiles.shape[3:])[: layout.height, : layout.width]


def inside_mask(layout: AttributeLayout) -> NDArray[np.float64]:
    """1.0 for pixels in the map and 0.0 for padding: float64 [tiles, tile_size, tile_size]."""
    size = layout.tile_size
    shape = (layout.tile_rows * size, layout.tile_columns * size)
    inside = np.zeros(shape)
    inside[: layout.height, : layout.width] = 1.0
    grid = inside.reshape(layout.tile_rows, size, layout.tile_columns, size).swapaxes(1, 2)
    return np.ascontiguousarray(grid).reshape(layout.tiles, size, size)


def sum_cells(tiles: NDArray[Any], cells: int) -> NDArray[Any]:
    """Sum the pixels of each cell: [tiles, size, size, ...] to [tiles, cells * cells, ...], row by row."""
    count, size = tiles.shape[:2]
    edge = size // cells
    grid: NDArray[Any] = tiles.reshape(count, cells, edge, cells, edge, *tiles.shape[3:]).sum(axis=(2, 4))
    return grid.reshape(count, cells * cells, *tiles.shape[3:])


def expand_cells(cells: NDArray[Any], size: int) -> NDArray[Any]:
    """Copy each cell's value to its pixels: [tiles, cells * cells, ...] to [tiles, size, size, ...]."""
    edge_cells = math.isqrt(cells.shape[1])
    grid = cells.reshape(cells.shape[0], edge_cells, edge_cells, *cells.shape[2:])
    return grid.repeat(size // edge_cells, axis=1).repeat(size // edge_cells, axis=2)
