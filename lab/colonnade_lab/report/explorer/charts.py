"""The charts of a study as Vega-Lite specifications.

Each holds the rows of all libraries and workloads; its parameters select what is drawn. The page changes the
parameters by its drop-downs, a static plot has them fixed.

Texts of a study are only data, domains, and titles of axes (`axis_title_of`). Vega-Lite compiles titles of tooltips and
sort orders into expressions, which some characters would break.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import altair as alt

from colonnade_lab.report.explorer.rows import OFF_FRONT, ON_FRONT, Row, scale_of
from colonnade_lab.report.explorer.study import Column, axis_title_of
from colonnade_lab.report.stages import STAGES
from colonnade_lab.report.style import COLOURS

Spec = dict[str, Any]

#: Marks text and lines with the colour of the surrounding text, so that one chart suits a light and a dark page.
INK = "currentColor"

#: Colours of the units of a stack, distinguishable side by side; `rows.MAX_UNITS` of them.
UNIT_COLOURS = (
    *("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00"),
    *("#F0E442", "#8C6D31", "#7A68A6", "#9ACD32", "#A9A9A9", "#D9D9D9"),
)

#: Space between the points of a scatter plot and its edges, for labels, and its height; pixels.
SCATTER_PADDING, SCATTER_HEIGHT = (42, 26), 540

_STEP = 24
_FONT = "system-ui, -apple-system, 'Segoe UI', 'Liberation Sans', Arial, sans-serif"


def scatter(rows: Sequence[Row], x: Column, y: Column, fields: int, *, has_front: bool) -> Spec:
    """Two figures of all points; parameters ``x``, ``y`` (keys of columns) and ``selected`` (a name).

    Every point has a label, above it unless its row has ``label``, ``dx`` and ``dy`` of `labels.placed`. The page
    leaves out those without a place.
    """
    base = (
        alt.Chart(_data(rows), height=SCATTER_HEIGHT)
        .add_params(_param("x", x["key"]), _param("y", y["key"]), _param("selected", ""))
        .transform_calculate(x="datum.numbers[x]", y="datum.numbers[y]", xText="datum.texts[x]", yText="datum.texts[y]")
        .transform_filter("isValid(datum.x) && isValid(datum.y)")
    )
    wide, high = (
        alt.Scale(padding=padding, **scale_of(rows, column["key"]))
        for column, padding in zip((x, y), SCATTER_PADDING, strict=True)
    )
    horizontal, vertical = (
        alt.X("x:Q", title=axis_title_of(x), scale=wide),
        alt.Y("y:Q", title=axis_title_of(y), scale=high),
    )
    kinds = [ON_FRONT, OFF_FRONT] if has_front else [OFF_FRONT]
    legend = alt.Legend(title=None, orient="top", symbolSize=110) if has_front else None
    colour = alt.Scale(domain=kinds, range=[COLOURS[5], COLOURS[0]][-len(kinds) :])
    shape = alt.Scale(domain=kinds, range=["diamond", "circle"][-len(kinds) :])
    points = base.mark_point(filled=True, opacity=0.9, cursor="pointer").encode(
        x=horizontal,
        y=vertical,
        color=alt.Color("kind:N", scale=colour, legend=legend),
        shape=alt.Shape("kind:N", scale=shape, legend=legend),
        size=alt.when("datum.name === selected").then(alt.value(330)).otherwise(alt.value(130)),
        stroke=alt.value(INK),
        strokeWidth=alt.when("datum.name === selected").then(alt.value(2.5)).otherwise(alt.value(0)),
        description=alt.Description("name:N"),
        tooltip=[
            alt.Tooltip("name:N", title="point"),
            *([alt.Tooltip("configuration:N", title="configuration")] if fields else []),
            alt.Tooltip("xText:N", title="x"),
            alt.Tooltip("yText:N", title="y"),
        ],
    )
    labels = (
        base.transform_calculate(
            text="isValid(datum.label) ? datum.label : datum.name",
            rank="datum.name === selected ? -1 : datum.rank",
        )
        .mark_text(
            fontSize=11,
            color=INK,
            limit=220,
            dx=alt.expr("isValid(datum.dx) ? datum.dx : 0"),
            dy=alt.expr("isValid(datum.dy) ? datum.dy : 0"),
        )
        .encode(x=horizontal, y=vertical, text="text:N")
    )
    return _spec(points + labels)


def render_index(rows: Sequence[Row], libraries: Sequence[str]) -> Spec:
    """The RenderIndex of all points, a bar for each library."""
    chart = (
        alt.Chart(_data(rows), height=300)
        .mark_bar()
        .encode(
            x=alt.X("name:N", sort=None, title=None, axis=alt.Axis(labelAngle=-30)),
            y=alt.Y("index:Q", title="RenderIndex"),
            xOffset=alt.XOffset("library:N", sort=None),
            color=alt.Color(
                "library:N",
                scale=alt.Scale(domain=list(libraries), range=_cycle(COLOURS, len(libraries))),
                legend=alt.Legend(title=None, orient="top"),
            ),
            tooltip=[
                alt.Tooltip("name:N", title="point"),
                alt.Tooltip("library:N"),
                alt.Tooltip("index:Q", title="RenderIndex", format=".3g"),
                alt.Tooltip("loss:Q", format=".3g"),
                alt.Tooltip("norm_loss:Q", title="norm of loss", format=".3g"),
                alt.Tooltip("norm_power:Q", title="norm of power", format=".3g"),
                alt.Tooltip("norm_area:Q", title="norm of area", format=".3g"),
            ],
        )
    )
    return _spec(chart)


def units(rows: Sequence[Row], library: str, level: str, title: str, unit: str) -> Spec:
    """A figure by unit, stacked, a bar for each point; parameters ``library`` and ``level``.

    Args:
        rows: Rows of `rows.unit_rows`.
        library: Initial value.
        level: Initial value.
        title: What is drawn.
        unit: Its unit.
    """
    names = _points(rows)
    chart = (
        alt.Chart(_data(rows), height=_STEP * len(names))
        .add_params(_param("library", library), _param("level", level))
        .transform_filter("datum.library === library && datum.level === level")
        .mark_bar()
        .encode(
            x=alt.X("value:Q", title=f"{title}, {unit}"),
            y=alt.Y("point:N", title=None, scale=alt.Scale(domain=names)),
            order=alt.Order("order:Q"),
            color=alt.Color(
                "unit:N",
                sort=alt.EncodingSortField(field="order", op="min"),
                scale=alt.Scale(range=list(UNIT_COLOURS)),
                legend=alt.Legend(title=None, symbolLimit=0),
            ),
            tooltip=[
                alt.Tooltip("point:N"),
                alt.Tooltip("unit:N"),
                alt.Tooltip("value:Q", title=unit, format=",.3~f"),
            ],
        )
    )
    return _spec(chart)


def stalls(rows: Sequence[Row], workload: str) -> Spec:
    """Context cycles by state, stacked, a bar for each point; parameter ``workload``."""
    stages = list(dict.fromkeys([*STAGES, *(row["stage"] for row in rows)]))
    stages = [stage for stage in stages if any(row["stage"] == stage for row in rows)]
    spare = iter(_cycle(UNIT_COLOURS, len(stages)))
    ranked = [row | {"order": stages.index(row["stage"])} for row in rows]
    names = _points(rows)
    chart = (
        alt.Chart(_data(ranked), height=_STEP * len(names))
        .add_params(_param("workload", workload))
        .transform_filter("datum.workload === workload")
        .mark_bar()
        .encode(
            x=alt.X("share:Q", title="context cycles", axis=alt.Axis(format=".0%"), scale=alt.Scale(domainMax=1)),
            y=alt.Y("point:N", title=None, scale=alt.Scale(domain=names)),
            order=alt.Order("order:Q"),
            color=alt.Color(
                "stage:N",
                scale=alt.Scale(domain=stages, range=[STAGES.get(stage) or next(spare) for stage in stages]),
                legend=alt.Legend(title=None, symbolLimit=0),
            ),
            tooltip=[
                alt.Tooltip("point:N"),
                alt.Tooltip("stage:N", title="state"),
                alt.Tooltip("share:Q", format=".1%"),
            ],
        )
    )
    return _spec(chart)


def utilisation(rows: Sequence[Row], workload: str) -> Spec:
    """Utilisation of units and ports as a grid, the bottleneck in bold; parameter ``workload``."""
    names = _points(rows)
    base = (
        alt.Chart(_data(rows), height=_STEP * len(names))
        .add_params(_param("workload", workload))
        .transform_filter("datum.workload === workload")
        .encode(
            x=alt.X("unit:N", sort=None, title=None, axis=alt.Axis(labelAngle=0, orient="top", domain=False)),
            y=alt.Y("point:N", title=None, axis=alt.Axis(domain=False), scale=alt.Scale(domain=names)),
        )
    )
    cells = base.mark_rect(stroke="white").encode(
        color=alt.Color("share:Q", scale=alt.Scale(scheme="blues", domain=[0, 1.15]), legend=None),
        tooltip=[alt.Tooltip("point:N"), alt.Tooltip("unit:N"), alt.Tooltip("share:Q", format=".1%")],
    )
    texts = base.mark_text(fontSize=11).encode(
        text=alt.Text("share:Q", format=".0%"),
        color=alt.when("datum.share > 0.85").then(alt.value("white")).otherwise(alt.value("black")),
    )
    bold = base.transform_filter("datum.binds").mark_text(fontSize=11, fontWeight="bold")
    return _spec(
        cells
        + texts.transform_filter("!datum.binds")
        + bold.encode(text=alt.Text("share:Q", format=".0%"), color=texts.encoding.color)
    )


def _data(rows: Sequence[Row]) -> alt.InlineData:
    return alt.InlineData(values=list(rows), name="rows")


def _points(rows: Sequence[Row]) -> list[str]:
    """The points of all rows in their order, so that each keeps its place whatever is selected."""
    return list(dict.fromkeys(row["point"] for row in rows))


def _param(name: str, value: str) -> alt.Parameter:
    return alt.param(name=name, value=value)


def _cycle(colours: Sequence[str], count: int) -> list[str]:
    return [colours[position % len(colours)] for position in range(count)]


def _spec(chart: Any) -> Spec:
    """The specification with the style of all charts. Its width is its container's."""
    text = {"labelColor": INK, "titleColor": INK, "labelFontSize": 11.5, "titleFontSize": 12, "titleFontWeight": 600}
    styled = chart.properties(
        width="container", autosize=alt.AutoSizeParams(type="fit-x", contains="padding")
    ).configure(
        background="transparent",
        font=_FONT,
        axis={**text, "gridColor": INK, "gridOpacity": 0.13, "domainColor": INK, "tickColor": INK, "labelLimit": 260},
        axisQuantitative={"tickCount": 9, "labelFlush": False},
        legend={**text, "labelLimit": 260},
        view={"stroke": None},
    )
    return dict(styled.to_dict())
