"""Labels of a scatter plot: each beside its point, none over another, in order of rank; plots of chosen axes."""

from __future__ import annotations

import itertools
import json
import math
import random
from pathlib import Path
from typing import Any

import pytest
from study_example import study

from colonnade_lab.report.explorer.labels import placed
from colonnade_lab.report.explorer.plots import plots
from colonnade_lab.report.explorer.rows import scale_of

AREA, PADDING = (680.0, 540.0), (42.0, 26.0)


def row(name: str, x: float | None, y: float, rank: int = 2) -> dict[str, Any]:
    return {"name": name, "rank": rank, "numbers": {"x": x, "y": y}}


def boxes(rows: list[dict[str, Any]]) -> list[tuple[float, float, float]]:
    """Centre and half width of each label that has a place."""
    scales = [math.log if scale_of(rows, key)["type"] == "log" else float for key in "xy"]
    low = [scales[i](min(each["numbers"][key] for each in rows)) for i, key in enumerate("xy")]
    high = [scales[i](max(each["numbers"][key] for each in rows)) for i, key in enumerate("xy")]
    found = []
    for each in rows:
        share = [(scales[i](each["numbers"][key]) - low[i]) / (high[i] - low[i]) for i, key in enumerate("xy")]
        x = PADDING[0] + share[0] * (AREA[0] - 2 * PADDING[0]) + each["dx"]
        y = AREA[1] - PADDING[1] - share[1] * (AREA[1] - 2 * PADDING[1]) + each["dy"]
        if each["label"]:
            found.append((x, y, 3.1 * len(each["label"])))
    return found


@pytest.mark.parametrize("seed", range(5))
def test_labels_of_near_points_are_apart_and_inside(seed: int) -> None:
    draws = random.Random(seed)
    points = [row(f"{n}b24s64d", draws.gauss(0, 1), 10 ** draws.gauss(0, 1)) for n in range(40)]
    assert [scale_of(points, key)["type"] for key in "xy"] == ["linear", "log"]
    rows = placed(points, "x", "y", AREA, PADDING)
    found = boxes(rows)
    assert len(found) >= 25
    for one, other in itertools.combinations(found, 2):
        assert abs(one[0] - other[0]) >= one[2] + other[2] or abs(one[1] - other[1]) >= 11.9
    assert all(half <= x <= AREA[0] - half and 0 <= y <= AREA[1] for x, y, half in found)


def test_of_points_in_one_place_the_first_rank_has_the_label_above() -> None:
    crowd = [row(f"point {n}", 0.5, 0.5, 2 if n else 0) for n in range(12)]
    rows = placed([*crowd[::-1], row("a", 0.0, 0.0), row("b", 1.0, 1.0), row("c", None, 1.0)], "x", "y", AREA, PADDING)
    best = next(each for each in rows if each["name"] == "point 0")
    assert best["label"] == "point 0" and best["dx"] == 0.0 and best["dy"] < 0
    assert any(each["label"] == "" for each in rows)


def test_the_scale_of_an_axis_is_logarithmic_over_decades_of_positive_figures() -> None:
    for low, high, kind in [(1, 30, "log"), (1, 29, "linear"), (0, 30, "linear"), (-1, 30, "linear"), (2, 2, "linear")]:
        assert scale_of([row("a", low, 0), row("b", None, 0), row("c", high, 0)], "x")["type"] == kind
    assert scale_of([row("a", None, 0)], "x")["type"] == "linear"


def test_a_study_chooses_axes_of_plots(tmp_path: Path) -> None:
    study(tmp_path)
    content = json.loads((tmp_path / "study.json").read_text())
    before = {name for name, _ in plots(content)}
    content["plots"] = [["nj.asap7", "dists_loss"], ["psnr_min", "nj.asap7"], ["psnr_min", "unknown"]]
    found = {name: spec for name, spec in plots(content)}
    assert set(found) - before == {"pareto--nj.asap7--dists_loss", "pareto--psnr_min--nj.asap7"}
    assert found["pareto--psnr_min--nj.asap7"]["params"][0] == {"name": "x", "value": "psnr_min"}
