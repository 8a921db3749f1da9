"""Places for the labels of a scatter plot in a file: beside their points, apart from each other and from all points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from colonnade_lab.report.explorer.rows import Row, scale_of

#: Of a label in the font of the charts: width of a character, height, distance from the centre of its point; pixels.
_CHARACTER, _HEIGHT, _DISTANCE = 6.3, 12.0, 13.0
#: Half of the edge of a point, pixels.
_POINT = 6.0


@dataclass(frozen=True)
class _Box:
    x: float
    y: float
    half_width: float
    half_height: float

    def meets(self, other: _Box) -> bool:
        near_x = abs(self.x - other.x) < self.half_width + other.half_width
        return near_x and abs(self.y - other.y) < self.half_height + other.half_height


def placed(rows: Sequence[Row], x: str, y: str, area: tuple[float, float], padding: tuple[float, float]) -> list[Row]:
    """The rows with ``dx`` and ``dy``, pixels from the point to the middle of its label, and ``label``, empty without a
    place. Rows of a low ``rank`` come first.

    Args:
        rows: Of `rows.scatter_rows`.
        x: Key of the figure across.
        y: Key of the figure upwards.
        area: Width and height of the plot, pixels.
        padding: Between the plot's edges and its outermost points, pixels.
    """
    drawn = [row for row in rows if row["numbers"][x] is not None and row["numbers"][y] is not None]
    across = _pixels(drawn, x, area[0], padding[0])
    down = [area[1] - value for value in _pixels(drawn, y, area[1], padding[1])]
    points = [_Box(*centre, _POINT, _POINT) for centre in zip(across, down, strict=True)]
    taken, labels = list(points), dict[str, Row]()
    for row, point in sorted(zip(drawn, points, strict=True), key=lambda each: each[0]["rank"]):
        label = {"label": "", "dx": 0.0, "dy": 0.0}
        for box in _places(point, _CHARACTER * len(row["name"]) / 2):
            inside = box.half_width <= box.x <= area[0] - box.half_width and 0 <= box.y <= area[1]
            if inside and not any(box.meets(other) for other in taken):
                taken.append(box)
                label = {"label": row["name"], "dx": box.x - point.x, "dy": box.y - point.y}
                break
        labels[row["name"]] = label
    return [row | labels.get(row["name"], {}) for row in rows]


def _pixels(rows: Sequence[Row], key: str, size: float, padding: float) -> list[float]:
    """Pixels of a figure on an axis that spans all of them."""
    values = [row["numbers"][key] for row in rows]
    if scale_of(rows, key)["type"] == "log":
        values = [math.log(value) for value in values]
    low, high = min(values, default=0.0), max(values, default=0.0)
    share = [(value - low) / (high - low) if high > low else 0.5 for value in values]
    return [padding + each * (size - 2 * padding) for each in share]


def _places(point: _Box, half_width: float) -> Iterator[_Box]:
    """Boxes of a label around its point, from the best place on."""
    beside = _POINT + 3.0 + half_width
    for right, below in ((0, -1), (1, 0), (0, 1), (-1, 0), (1, -0.6), (-1, -0.6), (1, 0.6), (-1, 0.6), (0, -2), (0, 2)):
        yield _Box(point.x + right * beside, point.y + below * _DISTANCE, half_width, _HEIGHT / 2)
