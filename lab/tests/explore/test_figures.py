"""Pareto front, RenderIndex and the search."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from colonnade.common.errors import UserError
from hypothesis import given
from hypothesis import strategies as st

from colonnade_lab.explore.figures import Column, area_figures, columns, front, point_figures
from colonnade_lab.explore.render_index import PRINTED, index_rows, indices, sensitivity
from colonnade_lab.explore.search import check_search, parse_condition, search_front
from colonnade_lab.explore.study import FieldValue
from colonnade_lab.explore.study_file import StudyFile, load_study

COST = Column("cost", "cost", "", "lower", ".1f", "")
GAIN = Column("gain", "gain", "", "higher", ".1f", "")


def points(values: Sequence[tuple[float | None, float]]) -> list[dict[str, Any]]:
    return [{"name": str(i), "figures": {"cost": cost, "gain": gain}} for i, (cost, gain) in enumerate(values)]


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=20))
def test_the_front_is_what_nothing_surpasses(values: list[tuple[float | None, float]]) -> None:
    names = front(points(values), ["cost", "gain"], [COST, GAIN])
    assert names
    for index, (cost, gain) in enumerate(values):
        assert cost is not None
        better = [v for v in values if v[0] is not None and v[0] <= cost and v[1] >= gain and v != (cost, gain)]
        assert (str(index) in names) == (not better)


def test_a_point_without_a_figure_is_not_on_the_front() -> None:
    assert front(points([(None, 9), (1, 1)]), ["cost", "gain"], [COST, GAIN]) == ["1"]


def measured(**figures: tuple[float, float, float]) -> list[dict[str, Any]]:
    """Points with a loss, an energy and an area; the power of a point is 1 mW, its DISTS to Embree the loss + 1 %."""
    return [
        {
            "name": name,
            "figures": {"dists_loss": loss, "nj.a": energy, "array_kge.a": area}
            | {"dists": 0.01 * (1 + loss), "nj_28nm.a": energy, "mw.a": 1.0},
        }
        for name, (loss, energy, area) in figures.items()
    ]


def test_render_index_of_the_baseline_is_one_and_a_loss_of_zero_does_not_win_by_itself() -> None:
    found = measured(wide=(0.0, 2.0, 100.0), exact=(0.0, 1.9, 99.0), lean=(0.5, 1.0, 60.0), coarse=(9.0, 0.8, 50.0))
    rows = {row["name"]: row for row in index_rows(found, "wide", ["a"])}
    assert rows["wide"]["index"] == 1.0
    assert rows["lean"]["index"] == pytest.approx(1.5 * 0.5 * 0.6)
    assert min(rows, key=lambda name: rows[name]["index"]) == "lean"
    rankings = {each["choice"]: each["ranking"] for each in sensitivity(found, "wide", ["a"])}
    assert rankings["energy × area alone"][0] == "coarse"
    assert rankings["shares of the ranges (a 0 wins)"][0] in ("wide", "exact", "coarse")
    assert rankings["1 + loss / 0.03 %"][-1] == "coarse"
    assert rankings[PRINTED][0] == "lean"
    # Where the baseline's pictures have an error of their own, a ratio to it is a norm: 1.5 × 0.5 × 0.6
    by_ratio = indices(found, "wide", "a")["DISTS to Embree in place of the loss"]
    assert by_ratio == pytest.approx({"wide": 1.0, "exact": 0.9405, "lean": 0.45, "coarse": 2.0})
    assert all(sorted(ranking) == sorted(rows) for ranking in rankings.values())


def test_render_index_needs_the_baseline_and_leaves_out_points_without_figures() -> None:
    found = measured(wide=(0.0, 2.0, 100.0), lean=(0.5, 1.0, 60.0))
    found[1]["figures"]["nj.a"] = None
    assert [row["name"] for row in index_rows(found, "wide", ["a"])] == ["wide"]
    assert index_rows(found, "lean", ["a"]) == []


def test_figures_of_a_point_are_missing_only_where_a_measurement_is() -> None:
    has = dict.fromkeys(("quality", "tests", "baseline", "cycles", "area", "power"), True)
    frame = {"psnr": 50.0, "dists": 0.01, "flip": 0.02, "dists_baseline": 0.004, "psnr_baseline": 60.0}
    frame |= {"rays_per_cycle_in_box": 2.0, "is_timed": True}
    frame |= {"counters": {"raysInBox": 10, "boxTests": 40, "triangleTests": 20}, "records": {"records": 300}}
    fewer = {"raysInBox": 10, "boxTests": 10, "triangleTests": 5}
    other = frame | {"counters": fewer, "psnr": 40.0, "dists_baseline": 0.006, "rays_per_cycle_in_box": 8.0}
    unit = {"traversal_unit_kge": 300.0, "array_kge": 24000.0, "mm2_28nm": 11.8, "slowest_path_fo4": 60.0}
    runs = {name: {"mw": mw, "nj_per_ray": mw / 4, "nj_per_ray_28nm": mw} for name, mw in (("a", 4.0), ("b", 8.0))}
    point = {"workloads": {"a": frame, "b": other}, "area": {"lib": unit}, "power": {"lib": runs}}
    found = point_figures(point, has, ["lib"])
    assert (found["psnr_min"], found["psnr_mean"]) == (40.0, 45.0)
    assert (found["dists_loss"], found["dists_loss_max"]) == (pytest.approx(0.5), pytest.approx(0.6))
    assert found["rays_per_cycle"] == pytest.approx(4.0)
    assert (found["box_tests"], found["triangle_tests"]) == (pytest.approx(2.0), pytest.approx(1.0))
    assert found["records"] == pytest.approx(300.0)
    assert (found["mw.lib"], found["nj.lib"], found["nj_28nm.lib"]) == (6.0, 1.5, 6.0)
    assert found["area_per_rate.lib"] == pytest.approx(6000.0)
    assert found["energy_area.lib"] == pytest.approx(9000.0)
    assert {column.key for column in columns(has, ["lib"])} == {*found, "render_index.lib"}
    point["power"]["lib"]["b"] = None
    found = point_figures(point, has, ["lib"])
    assert found["nj.lib"] is found["energy_area.lib"] is None
    assert found["area_per_rate.lib"] is not None


SEARCH = """title = "Search"
combine = "search"

[axes]
"array.rows" = [1, 2, 3, 4, 5, 6, 7, 8]
"array.columns" = [1, 2, 3, 4, 5, 6, 7, 8]
"array.contexts" = [1, 2, 3, 4, 5, 6, 7, 8]

[workload]
scenes = ["object.toml"]

[search]
budget = 60
objectives = ["psnr_min", "rays_per_cycle"]
constraints = ["psnr_min >= 3"]
batch = 10
seed = 2

[quality]
[cycles]
"""


def test_areas_are_without_scratchpads_and_with_caches() -> None:
    def array_kge(cache: dict[str, int] | None) -> float:
        report = {
            "config": {"array": {"columns": 8}, "columnBvhMemory": {"cache": cache}},
            "levels": {"array": {"kge": 1000.0, "logic_kge": 500.0}, "traversal_unit": {"kge": 10.0}},
            "memories": {"records": {"kge": 50.0}, "stack": {"kge": 5.0}},
            "units": {},
            "chip": {"um2_per_gate": 0.5},
            "slowest_path": {"ns": None, "fo4": None, "unit": None},
        }
        return float(area_figures(report)["array_kge"])

    assert array_kge(None) == 600.0
    assert array_kge({"lines": 256}) == 1000.0


HAS = {"quality": True, "tests": False, "baseline": False, "cycles": True, "area": False, "power": False}


@pytest.fixture
def file(tmp_path: Path) -> StudyFile:
    (tmp_path / "search.toml").write_text(SEARCH)
    return load_study(tmp_path / "search.toml")


def evaluated(file: StudyFile) -> dict[tuple[FieldValue, ...], Mapping[str, float | None] | None]:
    """All points of a search over a problem whose front is contexts = 8 with rows + columns constant."""
    found: dict[tuple[FieldValue, ...], Mapping[str, float | None] | None] = {}

    def evaluate(batch: Sequence[Mapping[str, FieldValue]]) -> list[Mapping[str, float | None] | None]:
        answers: list[Mapping[str, float | None] | None] = []
        for values in batch:
            rows, cols, contexts = (int(str(value)) for value in values.values())
            figures = {"psnr_min": float(rows + contexts), "rays_per_cycle": float(9 - rows + contexts - abs(cols - 4))}
            answers.append(None if (rows, cols) == (2, 2) else figures)
            assert tuple(values.values()) not in found
            found[tuple(values.values())] = answers[-1]
        return answers

    counts = list(search_front(file, columns(HAS, []), evaluate))
    assert counts[-1] == len(found) <= 60
    return found


def test_a_search_is_reproducible_and_beats_chance(file: StudyFile) -> None:
    found = evaluated(file)
    assert found == evaluated(file)
    assert next(iter(found)) == (1, 1, 1)
    best = [key for key in found if key[1:] == (4, 8)]
    share = len(best) / len(found)
    assert share > 4 * 8 / 512, "no better than chance: 1 of 64"
    assert math.prod((8, 8, 8)) > 8 * len(found)


def test_a_batch_is_no_larger_than_what_is_left_to_evaluate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "batch.toml").write_text(SEARCH.replace("batch = 10", "batch = 100_000"))
    assert len(evaluated(load_study(tmp_path / "batch.toml"))) <= 60
    assert capsys.readouterr().err.count("takes batches of 60 points, not 100,000: it has no more to evaluate") == 1


def test_a_search_begins_with_the_points_of_start(tmp_path: Path) -> None:
    start = 'start = [{ "array.rows" = 3 }, { "array.columns" = 5, "array.contexts" = 8 }]'
    (tmp_path / "start.toml").write_text(SEARCH.replace("seed = 2", f"seed = 2\n{start}"))
    assert list(evaluated(load_study(tmp_path / "start.toml")))[:3] == [(1, 1, 1), (3, 1, 1), (1, 5, 8)]


@pytest.mark.parametrize("start", ['{ "array.rows" = 9 }', '{ "array.lanes" = 1 }'])
def test_a_start_outside_the_axes_is_refused(tmp_path: Path, start: str) -> None:
    (tmp_path / "start.toml").write_text(SEARCH.replace("seed = 2", f"start = [{start}]"))
    with pytest.raises(UserError, match=r":17: search.start: array\.(rows = 9|lanes = 1) is not a value of the axes"):
        load_study(tmp_path / "start.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"psnr_min", "rays', '"psnr_max", "rays', ":14: no figure psnr_max; figures of this study: psnr_min"),
        ("psnr_min >= 3", "psnr_min > 3", ":15: psnr_min > 3 is not of the form figure >= number"),
        ("psnr_min >= 3", "cost >= 3", ":15: no figure cost"),
    ],
)
def test_unknown_figures_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "s.toml").write_text(SEARCH.replace(old, new))
    with pytest.raises(UserError) as error:
        check_search(load_study(tmp_path / "s.toml"), columns(HAS, []))
    assert message in str(error.value)


def test_conditions() -> None:
    assert parse_condition("nj.asap7 <= 1.5e-1") == ("nj.asap7", "<=", 0.15)
    assert parse_condition("psnr_min == 3") is None
