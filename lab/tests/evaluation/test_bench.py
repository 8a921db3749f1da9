"""The benchmark's figures from the reports of its frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from colonnade_lab.evaluation import bench, throughput
from colonnade_lab.report.stages import plot_stages

MakeReport = Callable[[float], dict[str, Any]]


def test_utilisation_is_averaged_over_instances(rtl_report: MakeReport) -> None:
    figures = throughput.figures(rtl_report(0.5))
    assert figures["utilisation"] == pytest.approx(
        {
            "path unit": 0.9,
            "ray set-up": 0.1,
            "box unit": 0.8,
            "triangle unit": 0.2,
            "shader": 0.01,
            "memory banks": 0.1,
            "pixel streams": 0.5,
        }
    )
    assert figures["bottleneck"] == "box unit"


def test_stalls_are_all_context_cycles(rtl_report: MakeReport) -> None:
    stalls = throughput.figures(rtl_report(0.5))["stalls"]
    assert stalls["box unit and stack"] == pytest.approx(0.5)
    assert stalls["completion"] == pytest.approx(0.05)
    assert sum(stalls.values()) == pytest.approx(1.0)


def test_records_are_own_reads_and_snoop_hits(rtl_report: MakeReport) -> None:
    figures = throughput.figures(rtl_report(0.5))
    assert figures["snoop_share"] == pytest.approx(180 / 240)
    assert figures["per_ray"] == pytest.approx(
        {
            "node_reads": 3.0,
            "box_tests": 10.0,
            "triangle_records": (240 - 150 - 20) / 50,
            "triangle_tests": 1.6,
            "records_taken": 4.8,
            "record_reads": 1.2,
        }
    )


def test_bytes_of_dram_are_those_of_whole_beats(rtl_report: MakeReport) -> None:
    report = rtl_report(0.5)
    report["counters"]["dramReads"] = 25
    assert throughput.figures(report | {"dram_line_bytes": 192})["per_ray"]["dram_bytes"] == 25 * 192 / 50


def test_bounds_assume_full_utilisation_of_the_busiest(rtl_report: MakeReport) -> None:
    assert throughput.figures(rtl_report(0.5))["bounds"] == pytest.approx(
        {"perfect_memory": 0.625, "perfect_units": 1.0}
    )


def test_limits_assume_full_utilisation_of_each(rtl_report: MakeReport) -> None:
    limits = throughput.figures(rtl_report(0.5))["limits"]
    assert limits["shader"] == pytest.approx(50.0)
    assert min(limits.values()) == limits["box unit"] == pytest.approx(0.625)


def test_a_frame_without_in_box_rays_has_no_unit_bounds(rtl_report: MakeReport) -> None:
    empty = rtl_report(0.0) | {
        "counters": dict.fromkeys(rtl_report(0.0)["counters"], 0) | {"raysPrimary": 300, "idleContexts": 2400}
    }
    figures = throughput.figures(empty)
    assert figures["bounds"] == {"perfect_memory": None, "perfect_units": 0.0}
    assert figures["stalls"]["idle"] == 1.0
    assert figures["bottleneck"] == "pixel streams"


def test_geometric_mean() -> None:
    assert bench.geometric_mean([1.0, 4.0]) == pytest.approx(2.0)
    assert bench.geometric_mean([1.0, 0.0]) == 0.0
    assert bench.geometric_mean([]) == 0.0


@pytest.fixture
def whole(rtl_report: MakeReport) -> dict[str, Any]:
    """A report over two meshes."""
    rates = {"cube": 1.0, "torus": 4.0}
    meshes = {name: bench.mesh_result(rtl_report(rate)) for name, rate in rates.items()}
    return bench.design_result(rtl_report(1.0)["config"], "c0", (15, 10), meshes)


def test_report_of_all_meshes(whole: dict[str, Any]) -> None:
    assert whole["geomean_rays_per_cycle_in_box"] == pytest.approx(2.0)
    assert whole["geomean_rays_per_cycle"] == pytest.approx(4.0)
    assert whole["ratio_to_paper"] == pytest.approx(2.0 / 0.208)
    assert whole["meshes"]["cube"]["bottleneck"] == "box unit"


def test_plot_is_a_picture(whole: dict[str, Any], tmp_path: Path) -> None:
    from PIL import Image

    plot_stages(whole, tmp_path / "stages.png")
    with Image.open(tmp_path / "stages.png") as picture:
        assert picture.size[0] >= 900
