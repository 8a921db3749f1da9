"""The points of a sweep, their figures and their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from colonnade.common.errors import UserError
from colonnade.evaluation import sweep as sweeping
from colonnade.evaluation.measure import Conditions, Run
from colonnade.evaluation.sweep import Variation, parse_variations, sweep
from colonnade.report.sweep import plot_sweep


def manifest_of(_: str, overrides: Sequence[str], *__: object) -> SimpleNamespace:
    values = {"rows": "2", "contexts": "4"} | dict(text.removeprefix("array.").split("=") for text in overrides)
    array = {"columns": 1, "rows": int(values["rows"]), "contexts": int(values["contexts"])}
    config = {"array": array, "units": {"triangleLanes": 1}, "columnBvhMemory": {"banks": 1}}
    return SimpleNamespace(manifest=SimpleNamespace(config=config, config_hash=str(sorted(array.items()))))


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch, rtl_report: Callable[[float], dict[str, Any]]) -> list[Run]:
    """All runs; the in-box rays per cycle of each equal the rows of its design."""
    made: list[Run] = []

    def measure(runs: Sequence[Run], *_: object) -> Iterator[dict[str, Any]]:
        for run in runs:
            made.append(run)
            manifest = manifest_of("", run.overrides).manifest
            rows = manifest.config["array"]["rows"]
            yield rtl_report(float(rows)) | {"config": manifest.config, "config_hash": manifest.config_hash}

    monkeypatch.setattr(sweeping, "measure", measure)
    monkeypatch.setattr(sweeping, "manifest_for", manifest_of)
    return made


def swept(*texts: str, one_by_one: bool = False, meshes: Sequence[str] = ("cube",)) -> dict[str, Any]:
    printed: list[Any] = []
    conditions = Conditions(Path("s.toml"))
    result = sweep("tiny", (), parse_variations(texts), meshes, conditions, one_by_one, finished=printed.append)
    assert printed == [result["base"], *result["points"]]
    return result


def test_cross_product_holds_every_combination_and_runs_none_twice(runs: list[Run]) -> None:
    result = swept("array.rows=1,2,4", "array.contexts=4,8", meshes=("cube", "torus"))
    values = [tuple(point["values"].values()) for point in result["points"]]
    assert values == [(1, 4), (1, 8), (2, 4), (2, 8), (4, 4), (4, 8)]
    assert result["base"]["values"] == {"array.rows": 2, "array.contexts": 4}
    assert len(runs) == 2 * len(values), "the base is one of the points"
    assert [point["ratio_to_base"] for point in result["points"]] == pytest.approx([0.5, 0.5, 1.0, 1.0, 2.0, 2.0])
    assert all(point["in_box_per_unit"] == pytest.approx(1.0) for point in result["points"])
    assert all(point["cycles"] == 200 for point in result["points"])


def test_one_by_one_leaves_the_others_as_in_the_base(runs: list[Run]) -> None:
    result = swept("array.rows=1,4", "array.contexts=8", one_by_one=True)
    assert [(point["varied"], *point["values"].values()) for point in result["points"]] == [
        ("array.rows", 1, 4),
        ("array.rows", 4, 4),
        ("array.contexts", 2, 8),
    ]
    assert len(runs) == 4


@pytest.mark.parametrize("text", ["array.rows", "array.rows=", "=1,2", "array.rows=1,,2"])
def test_malformed_variations_are_refused(text: str) -> None:
    with pytest.raises(UserError, match=r"key\.path=value"):
        parse_variations([text])


def test_variations_are_read() -> None:
    assert parse_variations(["a.b = 1, 2"]) == [Variation("a.b", ("1", "2"))]
    with pytest.raises(UserError, match="twice"):
        parse_variations(["a.b=1", "a.b=2"])
    with pytest.raises(UserError, match="twice"):
        parse_variations(["a.b=1,1"])


@pytest.mark.parametrize("one_by_one", [False, True])
def test_plot_is_a_picture(runs: list[Run], tmp_path: Path, one_by_one: bool) -> None:
    from PIL import Image

    plot_sweep(swept("array.rows=1,2,4", "array.contexts=4,8", one_by_one=one_by_one), tmp_path / "sweep.png")
    with Image.open(tmp_path / "sweep.png") as picture:
        assert picture.size[0] >= 500
