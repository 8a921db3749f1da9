"""Maps cut into tiles and back. Tiles at the right and lower edges are filled with the last column and row."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.environment.encoding.layout import AttributeLayout


def cut(values: NDArray[Any], layout: AttributeLayout) -> NDArray[Any]:
    """[height, width, ...] to [tiles, tile_size, tile_size, ...]."""
    size, rows, columns = layout.tile_size, layout.tile_rows, layout.tile_columns
    margin = ((0, rows * size - layout.height), (0, columns * size - layout.width))
    padded = np.pad(values, margin + ((0, 0),) * (values.ndim - 2), mode="edge")
    grid = padded.reshape(rows, size, columns, size, *values.shape[2:])
    return np.ascontiguousarray(grid.swapaxes(1, 2)).reshape(rows * columns, size, size, *values.shape[2:])


def joined(tiles: NDArray[Any], layout: AttributeLayout) -> NDArray[Any]:
    """[tiles, tile_size, tile_size, ...] to [height, width, ...]."""
    size, rows, columns = layout.tile_size, layout.tile_rows, layout.tile_columns
    grid = tiles.reshape(rows, columns, size, size, *tiles.shape[3:]).swapaxes(1, 2)
    return grid.reshape(rows * size, columns * size, *tiles.shape[3:])[: layout.height, : layout.width]


def present(layout: AttributeLayout) -> NDArray[np.float64]:
    """1.0 for the pixels of each tile that the map has, 0.0 beyond its edge: [tiles, tile_size, tile_size]."""
    size = layout.tile_size
    shape = (layout.tile_rows * size, layout.tile_columns * size)
    inside = np.zeros(shape)
    inside[: layout.height, : layout.width] = 1.0
    grid = inside.reshape(layout.tile_rows, size, layout.tile_columns, size).swapaxes(1, 2)
    return np.ascontiguousarray(grid).reshape(layout.tiles, size, size)


def pooled(tiles: NDArray[Any], cells: int) -> NDArray[Any]:
    """Sums over cells: [tiles, size, size, ...] to [tiles, cells * cells, ...], row by row."""
    count, size = tiles.shape[:2]
    edge = size // cells
    grid: NDArray[Any] = tiles.reshape(count, cells, edge, cells, edge, *tiles.shape[3:]).sum(axis=(2, 4))
    return grid.reshape(count, cells * cells, *tiles.shape[3:])


def spread_cells(cells: NDArray[Any], size: int) -> NDArray[Any]:
    """Each cell's value for all its pixels: [tiles, cells * cells, ...] to [tiles, size, size, ...]."""
    edge_cells = round(cells.shape[1] ** 0.5)
    grid = cells.reshape(cells.shape[0], edge_cells, edge_cells, *cells.shape[2:])
    return grid.repeat(size // edge_cells, axis=1).repeat(size // edge_cells, axis=2)
