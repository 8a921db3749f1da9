"""The measurement of a frame: cached by the content of Verilog, scene image and registers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root
from colonnade.device.verilator import Simulated
from colonnade.mesh.load import load_mesh
from colonnade.scene.parser import load_scene

from colonnade_lab.evaluation import measure as measuring
from colonnade_lab.evaluation.measure import measure_frame


def measured(name: str, *overrides: str, size: tuple[int, int] = (16, 12), reuse: bool = True) -> dict[str, Any]:
    """The report of a small frame."""
    scene = load_scene(project_root() / "scenes" / "object.toml")
    return measure_frame("tiny", overrides, scene, load_mesh(name), size, reuse=reuse)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a cache of its own."""
    monkeypatch.setattr(measuring, "cache_directory", lambda _: tmp_path)
    return tmp_path / "measurements"


@pytest.mark.verilator
def test_cached_counters_are_used_unless_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = measured("cube")
    assert first["mesh"]["name"] == "cube"
    assert first["counters"]["cycles"] == first["cycles"] > 0
    assert len(list(folder.iterdir())) == 1

    rendered: list[int] = []
    render = measuring.render_rtl
    monkeypatch.setattr(measuring, "render_rtl", lambda *a, **k: (rendered.append(1), render(*a, **k))[1])
    assert measured("cube") == first
    assert rendered == []
    assert measured("cube", size=(8, 8))["size"] == [8, 8]
    assert len(rendered) == 1
    assert measured("cube", reuse=False)["counters"] == first["counters"]
    assert len(rendered) == 2


def a_report(cycles: int) -> dict[str, Any]:
    return {"counters": {"cycles": cycles}, "cycles": cycles}


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Cycles of the rendered frames, without a simulator."""
    frames: list[int] = []

    def render(*_: object, **__: object) -> Simulated:
        frames.append(1)
        return Simulated([SimpleNamespace(errors=[])], 1000.0)  # type: ignore[list-item]

    monkeypatch.setattr(measuring, "design_for", manifest_for)
    monkeypatch.setattr(measuring, "build_simulator", lambda *_: None)
    monkeypatch.setattr(measuring, "render_rtl", render)
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
    damage: Callable[[Path], object], folder: Path, rendered: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert measured("cube")["cycles"] == 1234
    (kept,) = folder.iterdir()
    damage(kept)
    for _ in range(2):
        assert measured("cube")["cycles"] == 1234
    assert len(rendered) == 2
    assert capsys.readouterr().err == (f"colonnade: the cached measurement {kept.name} was damaged and is made again\n")


def test_a_mesh_that_does_not_fit_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "design_for", manifest_for)
    with pytest.raises(UserError, match=r"sphere:4 .*columnBvhMemory\.depth"):
        measured("sphere:4", "columnBvhMemory.depth=64")
