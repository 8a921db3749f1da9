"""Block and state diagrams: boxes at given places and right-angled arrows between their sides, from TOML.

``[[area]]``: ``at``, ``size``, ``text``; a tinted ground behind boxes.
``[[box]]``: ``id``, ``at``, ``size``, ``text`` (lines; the first is the name), ``kind`` (a key of ``_COLOURS``),
``copies`` (drawn behind one another), ``holds`` (other boxes lie in it).
``[[arrow]]``: ``from`` and ``to`` (``box.side`` or ``box.side@fraction``, sides ``left right top bottom``; or a point),
``text`` and ``text_at``, ``bend`` (where the middle segment lies), ``via`` (points instead), ``both``, ``dashed``.
``[[note]]``: ``at``, ``text`` (lines), ``anchor``.
All places are in pixels of the page's width, y down; ``size`` of the whole drawing comes first.
"""

from __future__ import annotations

import itertools
import sys
from typing import Any

import drawsvg as dw

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Point = tuple[float, float]

_FONT = "Helvetica, Arial, sans-serif"
_INK, _FADED, _WIRE = "#16222b", "#44545f", "#2b4a5e"
_NAME, _SMALL = 14, 12
# Fill and border of each kind of box.
_COLOURS = {
    "unit": ("#dcebf5", "#2b6a94"),
    "memory": ("#fbeecb", "#a97d14"),
    "control": ("#e3f1dd", "#4b8a35"),
    "port": ("#ffffff", "#6b7a84"),
    "state": ("#eef3f6", "#2b4a5e"),
    "part": ("#ffffff", "#2b6a94"),
}
_DIRECTIONS = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}


def draw(text: str) -> str:
    """The SVG of a source."""
    source = tomllib.loads(text)
    width, height = source["size"]
    drawing = dw.Drawing(width, height, origin=(0, 0), font_family=_FONT)
    drawing.append(dw.Title(source["description"]))
    drawing.append(dw.Rectangle(0, 0, width, height, fill="#ffffff"))
    for area in source.get("area", []):
        _area(drawing, area)
    boxes = {box["id"]: box for box in source["box"]}
    assert len(boxes) == len(source["box"]), "two boxes have one id"
    head = dw.Marker(-7, -4, 1, 4, scale=1, orient="auto-start-reverse", markerUnits="userSpaceOnUse")
    head.append(dw.Lines(-7, -3.6, 0, 0, -7, 3.6, close=True, fill=_WIRE))
    # A box that holds others is below the arrows between them
    for box in source["box"]:
        if box.get("holds"):
            _box(drawing, box)
    for arrow in source.get("arrow", []):
        _arrow(drawing, arrow, boxes, head)
    for box in source["box"]:
        if not box.get("holds"):
            _box(drawing, box)
    for arrow in source.get("arrow", []):
        if "text" in arrow:
            _label(drawing, arrow, boxes)
    for note in source.get("note", []):
        _lines(drawing, note["text"], note["at"], note.get("anchor", "start"), _SMALL, _FADED)
    svg: str = drawing.as_svg(header="")
    return svg + "\n"


def _area(drawing: dw.Drawing, area: dict[str, Any]) -> None:
    (x, y), (width, height) = area["at"], area["size"]
    drawing.append(dw.Rectangle(x, y, width, height, rx=6, fill="#f5f8fa", stroke="#a9bac5", stroke_dasharray="5,4"))
    drawing.append(dw.Text(area["text"], _NAME, x + 10, y + 19, fill=_FADED, font_weight="bold"))


def _box(drawing: dw.Drawing, box: dict[str, Any]) -> None:
    (x, y), (width, height) = box["at"], box["size"]
    kind = box.get("kind", "unit")
    fill, border = _COLOURS[kind]
    # Shadows of further copies
    for copy in range(box.get("copies", 1) - 1, 0, -1):
        drawing.append(dw.Rectangle(x + 5 * copy, y + 5 * copy, width, height, rx=3, fill=fill, stroke=border))
    radius = 16 if kind == "state" else 3
    drawing.append(dw.Rectangle(x, y, width, height, rx=radius, fill=fill, stroke=border, stroke_width=1.4))
    name, *rest = box["text"]
    heights = [_NAME * 1.2, *[_SMALL * 1.25] * len(rest)]
    top = y + height / 2 - sum(heights) / 2 if not box.get("holds") else y + 8
    middle = x + width / 2
    drawing.append(dw.Text(name, _NAME, middle, top + _NAME, fill=_INK, text_anchor="middle", font_weight="bold"))
    for index, line in enumerate(rest):
        at = top + heights[0] + (index + 0.85) * heights[1]
        drawing.append(dw.Text(line, _SMALL, middle, at, fill=_FADED, text_anchor="middle"))


def _arrow(drawing: dw.Drawing, arrow: dict[str, Any], boxes: dict[str, Any], head: dw.Marker) -> None:
    points = _route(arrow, boxes)
    line = dw.Path(fill="none", stroke=_WIRE, stroke_width=1.5, stroke_linejoin="round", marker_end=head)
    if arrow.get("both"):
        line.args["marker-start"] = head
    if arrow.get("dashed"):
        line.args["stroke-dasharray"] = "5,3"
    line.M(*points[0])
    for point in points[1:]:
        line.L(*point)
    drawing.append(line)


def _route(arrow: dict[str, Any], boxes: dict[str, Any]) -> list[Point]:
    """The corners of an arrow."""
    start, leaves = _end(arrow["from"], boxes)
    stop, enters = _end(arrow["to"], boxes)
    if "via" in arrow:
        return [start, *(tuple(point) for point in arrow["via"]), stop]
    if "bend" not in arrow and (start[0] == stop[0] or start[1] == stop[1]):
        return [start, stop]
    is_across = [leaves in ("left", "right"), enters in ("left", "right")]
    if is_across == [True, True]:
        x = arrow.get("bend", (start[0] + stop[0]) / 2)
        return [start, (x, start[1]), (x, stop[1]), stop]
    if is_across == [False, False]:
        y = arrow.get("bend", (start[1] + stop[1]) / 2)
        return [start, (start[0], y), (stop[0], y), stop]
    return [start, (stop[0], start[1]) if is_across[0] else (start[0], stop[1]), stop]


def _end(end: str | list[float], boxes: dict[str, Any]) -> tuple[Point, str]:
    """Where an arrow begins or ends, and on which side of the box."""
    if not isinstance(end, str):
        return (end[0], end[1]), end[2] if len(end) > 2 else "left"  # type: ignore[return-value]
    name, _, place = end.partition(".")
    side, _, fraction = place.partition("@")
    (x, y), (width, height) = boxes[name]["at"], boxes[name]["size"]
    behind = 5 * (boxes[name].get("copies", 1) - 1)
    along = float(fraction or 0.5)
    across, down = _DIRECTIONS[side]
    if across:
        return (x + (width + behind) * (across + 1) / 2, round(y + height * along, 1)), side
    return (round(x + width * along, 1), y + (height + behind) * (down + 1) / 2), side


def _label(drawing: dw.Drawing, arrow: dict[str, Any], boxes: dict[str, Any]) -> None:
    points = _route(arrow, boxes)
    pairs = itertools.pairwise(points)
    first, second = max(pairs, key=lambda pair: abs(pair[0][0] - pair[1][0]) + 0.5 * abs(pair[0][1] - pair[1][1]))
    middle = ((first[0] + second[0]) / 2, (first[1] + second[1]) / 2)
    text = arrow["text"] if isinstance(arrow["text"], list) else [arrow["text"]]
    if "text_at" in arrow:
        at, anchor = arrow["text_at"], arrow.get("anchor", "middle")
    elif first[1] == second[1]:
        at, anchor = (middle[0], middle[1] - 5 - (len(text) - 1) * _SMALL * 1.2), "middle"
    else:
        at, anchor = (middle[0] + 6, middle[1] + 4 - (len(text) - 1) * _SMALL * 0.6), "start"
    _lines(drawing, text, at, anchor, _SMALL, _WIRE)


def _lines(drawing: dw.Drawing, lines: list[str], at: Any, anchor: str, size: float, colour: str) -> None:
    for index, line in enumerate(lines):
        drawing.append(
            dw.Text(
                line,
                size,
                at[0],
                at[1] + index * size * 1.2,
                fill=colour,
                text_anchor=anchor,
                stroke="#ffffff",
                stroke_width=3,
                paint_order="stroke",
                stroke_linejoin="round",
            )
        )
