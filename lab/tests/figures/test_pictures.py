"""The plots of the pages show the data."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from colonnade_lab.figures import pictures


def test_a_plot_of_other_data_is_reported_and_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def draw(report: Mapping[str, Any], path: Path) -> None:
        Image.new("RGB", (2, 2), report["colour"]).save(path)

    def measured(colour: str) -> None:
        content = json.dumps({"config": {}, "result": {"colour": colour}})
        (tmp_path / "data" / "scaling.json").write_text(content)

    def drawn() -> bytes:
        with Image.open(tmp_path / "pictures" / "plot.png") as picture:
            return picture.tobytes()

    monkeypatch.setattr(pictures, "PICTURES", {"plot.png": ("scaling", draw), "other.png": ("bench-edge", draw)})
    (tmp_path / "data").mkdir()
    differs = ["pictures/plot.png is not that of its data: run tools/figures pages"]
    for colour, pixel in (("red", b"\xff\0\0"), ("blue", b"\0\0\xff")):
        measured(colour)
        assert list(pictures.problems(tmp_path)) == differs
        pictures.write(tmp_path)
        assert list(pictures.problems(tmp_path)) == [] and drawn() == 4 * pixel
    Image.new("RGB", (2, 2)).save(tmp_path / "pictures" / "plot.png")
    assert list(pictures.problems(tmp_path)) == differs, "it does not say what it shows"
