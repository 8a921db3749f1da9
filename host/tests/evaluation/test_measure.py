"""Measurements: results in order, and cached results only with `reuse`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root
from colonnade.device.verilator import Simulated
from colonnade.evaluation import measure as measuring
from colonnade.evaluation.measure import Conditions, Run, measure

RUNS = [Run("tiny", (), "cube"), Run("tiny", (), "tetrahedron")]


@pytest.fixture
def conditions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Conditions:
    """Small frames, two in parallel, with a cache of their own."""
    monkeypatch.setattr(measuring, "cache_directory", lambda _: tmp_path)
    return Conditions(project_root() / "scenes" / "object.toml", (16, 12), jobs=2)


@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
def test_a_cached_run_is_used_only_with_reuse(
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


def a_report(cycles: int) -> dict[str, Any]:
    return {"counters": {"cycles": cycles}, "cycles": cycles}


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Cycles of the rendered frames, without a simulator."""
    frames: list[int] = []

    def render(*_: object, **__: object) -> Simulated:
        frames.append(1)
        return Simulated([None], 1000.0)  # type: ignore[list-item]

    monkeypatch.setattr(measuring, "design_for", manifest_for)
    monkeypatch.setattr(measuring, "build_simulator", lambda *_: None)
    monkeypatch.setattr(measuring, "render_rtl", render)
    monkeypatch.setattr(measuring, "require_no_errors", lambda _: None)
    monkeypatch.setattr(measuring, "frame_report", lambda *_: SimpleNamespace(as_json=lambda: a_report(1234)))
    return frames


def kept_as(file: Path, **changes: object) -> None:
    file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))


def other_registers(file: Path) -> dict[str, Any]:
    key: dict[str, Any] = json.loads(file.read_text())["key"]
    return {**key, "registers": {**key["registers"], "shading.lights": 7}}


@pytest.mark.parametrize(
    "damage",
    [
        lambda file: file.write_bytes(file.read_bytes()[:100]),
        lambda file: kept_as(file, content={**json.loads(file.read_text())["content"], "cycles": 1}),
        lambda file: kept_as(file, key=other_registers(file)),
        lambda file: kept_as(file, key={**json.loads(file.read_text())["key"], "design": "0"}),
        lambda file: file.write_text(json.dumps(a_report(1))),
    ],
    ids=["truncated", "cycles", "registers", "design", "plain"],
)
def test_an_altered_measurement_is_repeated(
    damage: Callable[[Path], object],
    conditions: Conditions,
    rendered: list[int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    reusing = replace(conditions, reuse=True)
    assert [report["cycles"] for report in measure(RUNS[:1], reusing)] == [1234]
    (kept,) = (tmp_path / "measurements").iterdir()
    damage(kept)
    for _ in range(2):
        (again,) = measure(RUNS[:1], reusing)
        assert again["cycles"] == 1234
    assert len(rendered) == 2
    assert capsys.readouterr().err == (f"colonnade: the cached measurement {kept.name} was damaged and is made again\n")


def test_a_missing_mesh_is_named_before_any_frame(conditions: Conditions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "design_for", lambda *_: pytest.fail("a design is generated"))
    with pytest.raises(UserError, match="no-such-mesh"):
        measure([*RUNS, Run("tiny", (), "no-such-mesh")], conditions)


def test_a_mesh_that_does_not_fit_names_the_point(conditions: Conditions) -> None:
    with pytest.raises(UserError, match=r"columnBvhMemory\.depth=64: .*columnBvhMemory\.depth"):
        list(measure([Run("tiny", ("columnBvhMemory.depth=64",), "sphere:4")], conditions))
