"""Frames that are measured: in order, and none twice where that is wanted."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from colonnade import measure as measuring
from colonnade.errors import UserError
from colonnade.measure import Conditions, Run, measure
from colonnade.toolchain import project_root

RUNS = [Run("tiny", (), "cube"), Run("tiny", (), "tetrahedron")]


@pytest.fixture
def conditions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Conditions:
    """Small frames, two at a time, kept in a folder of this test."""
    monkeypatch.setattr(measuring, "cache_directory", lambda _: tmp_path)
    return Conditions(project_root() / "scenes" / "object.toml", (16, 12), jobs=2)


@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
def test_a_kept_run_is_taken_only_where_that_is_wanted(
    conditions: Conditions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = list(measure(RUNS, conditions))
    assert [report["mesh"]["name"] for report in first] == ["cube", "tetrahedron"]
    assert all(report["counters"]["cycles"] == report["cycles"] > 0 for report in first)
    assert len(list((tmp_path / "measurements").iterdir())) == 2

    rendered: list[int] = []
    render = measuring.render_rtl
    monkeypatch.setattr(measuring, "render_rtl", lambda *a, **k: (rendered.append(1), render(*a, **k))[1])
    reusing = replace(conditions, reuse=True)
    assert list(measure(RUNS, reusing)) == first
    assert rendered == []
    other_size = list(measure(RUNS[:1], replace(reusing, size=(8, 8))))
    assert other_size[0]["size"] == [8, 8]
    assert len(rendered) == 1
    again = list(measure(RUNS, conditions))
    assert [report["counters"] for report in again] == [report["counters"] for report in first]
    assert len(rendered) == 3


def test_a_missing_mesh_is_named_before_any_frame(conditions: Conditions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "design_for", lambda *_: pytest.fail("a design is generated"))
    with pytest.raises(UserError, match="no-such-mesh"):
        measure([*RUNS, Run("tiny", (), "no-such-mesh")], conditions)


def test_a_mesh_that_does_not_fit_names_the_point(conditions: Conditions) -> None:
    with pytest.raises(UserError, match=r"columnBvhMemory\.depth=64: .*columnBvhMemory\.depth"):
        list(measure([Run("tiny", ("columnBvhMemory.depth=64",), "sphere:4")], conditions))
