"""The tables of the performance page follow from its data."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from colonnade.design import toolchain
from colonnade.lab.evaluation.bench import design_result, mesh_result
from colonnade.lab.report import performance_page

DOCS = toolchain.project_root() / "docs"


def test_the_page_matches_its_data() -> None:
    text = (DOCS / "performance.md").read_text()
    assert performance_page.page(text, DOCS) == text, "run tools/performance page"


@pytest.fixture
def docs(tmp_path: Path, rtl_report: Callable[[float], dict[str, Any]]) -> Path:
    """A folder with data of a benchmark, of a study of rows, and of an ablation with one point of the cycle model."""
    report = rtl_report(1.0)
    meshes = {name: mesh_result(report) for name in ("bunny", "cube")}
    benchmark = design_result(report["config"], "c0", (15, 10), meshes)

    def point(in_box: float, **values: Any) -> dict[str, Any]:
        array = benchmark["config"]["array"] | ({"rows": values["array.rows"]} if "array.rows" in values else {})
        return {
            "values": values,
            "config_values": {"array": array},
            "workloads": {name: {"rays_per_cycle_in_box": in_box} for name in ("bunny", "cube")},
            "figures": {"rays_per_cycle": in_box},
        }

    kinds = [(contexts, snooping) for contexts in (1, 4) for snooping in (False, True)]
    keys = ("array.contexts", "columnBvhMemory.snooping", "columnBvhMemory.banks")
    rates = dict(zip(kinds, (0.5, 0.75, 1.0, 1.25), strict=True))
    data = {
        "bench": benchmark | {"mirror": benchmark},
        "scaling": {"points": [point(1.0), point(2.0, **{"array.rows": 4})]},
        "ablation": {
            "points": [
                point(1.0),
                *(point(rates[kind], **dict(zip(keys, (*kind, 1), strict=True))) for kind in kinds),
            ],
        },
    }
    (tmp_path / "data").mkdir()
    shutil.copy(DOCS / "data" / "cycle-model.json", tmp_path / "data")
    for name, content in data.items():
        (tmp_path / "data" / f"{name}.json").write_text(json.dumps(content))
    return tmp_path


def table(docs: Path, name: str) -> str:
    before, after = "before\n", "\nafter"
    text = performance_page.page(f"{before}<!-- {name} -->\nold\n<!-- end -->{after}", docs)
    assert text.startswith(before)
    assert text.endswith(after)
    assert "old" not in text
    assert performance_page.page(text, docs) == text
    return text


@pytest.mark.parametrize("name", performance_page.TABLES)
def test_every_table_is_on_the_page_and_is_regular(docs: Path, name: str) -> None:
    assert f"<!-- {name} -->" in (DOCS / "performance.md").read_text()
    widths = {line.count("|") for line in table(docs, name).splitlines() if line.startswith("|")}
    assert len(widths) == 1


def test_figures_are_those_of_the_data(docs: Path) -> None:
    rates = table(docs, "rates")
    assert "| bunny | 12 | 100 | 50 | **1.00** | 2.00 | 1.25 | 2.00 | box unit, 80 % |" in rates
    assert "**4.8 times** the chip's 0.208" in rates
    assert "| rows (render units per column) | 4 | 2.000 | 2.000 | 0.1667 | 2.00 |" in table(docs, "scaling")


def test_ablation_stands_beside_the_model(docs: Path) -> None:
    rows = table(docs, "ablation")
    assert "| mesh | contexts | source | round-robin, 1 bank | snooping, 1 bank |" in rows
    assert "| bunny | 4 | RTL | **0.333** | **0.417** |\n|  |  | cycle model, 6/2 lanes | 0.090 | 0.165 |" in rows
    assert "|  |  | cycle model, 12/4 lanes | – | 0.190 |" in rows
    assert rows.count("| cube |") == 2


def test_a_table_without_data_names_the_command(tmp_path: Path) -> None:
    assert "Run `tools/performance scaling`." in table(tmp_path, "scaling")
