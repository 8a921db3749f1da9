"""The common style of plots, and their output files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing

#: Colours of lines and bars, distinguishable without colour vision (Okabe and Ito).
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")

GREY = "#666666"

_STYLE = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": "black",
    "ytick.labelcolor": "black",
    "legend.frameon": False,
    "grid.color": "#dddddd",
    "axes.axisbelow": True,
}


@contextmanager
def figure(path: Path, width: float, height: float, rows: int = 1, columns: int = 1, **layout: Any) -> Iterator[Any]:
    """A context with an array of axes [rows, columns], which writes the figure to a PNG file at its end.

    Args:
        path: Output file, replaced atomically.
        width: Inches.
        height: Inches.
        rows: Rows of axes.
        columns: Columns of axes.
        layout: Keywords of matplotlib's ``subplots``.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with pyplot.rc_context(_STYLE):
        drawing, axes = pyplot.subplots(
            rows, columns, figsize=(width, height), squeeze=False, layout="constrained", **layout
        )
        try:
            yield axes
            with replacing(path) as stream:
                drawing.savefig(stream, format="png", dpi=150, facecolor="white")
        finally:
            pyplot.close(drawing)


def array_name(config: dict[str, Any]) -> str:
    """The size of an array, for titles."""
    array = config["array"]
    return f"{array['rows']}×{array['columns']} traversal units, {array['contexts']} contexts"
