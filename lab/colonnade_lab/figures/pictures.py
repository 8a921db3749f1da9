"""Draws the pictures of the pages that are plots of data files. Each holds the digest of the report that it shows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing
from colonnade.common.temporary import temporary_folder
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from colonnade_lab.figures.data import Data
from colonnade_lab.report.fields import plot_fields
from colonnade_lab.report.speed_up import plot_speed_up
from colonnade_lab.report.stages import plot_stages

#: The data file of each picture in ``docs/pictures``, and the function that draws its report.
PICTURES: Mapping[str, tuple[str, Callable[[Mapping[str, Any], Path], None]]] = {
    "bench.png": ("bench-edge", plot_stages),
    "scaling.png": ("scaling", plot_fields),
    "ablation.png": ("ablation", plot_fields),
    "speed-up.png": ("bvh-cycles", plot_speed_up),
}

#: The key of the digest among the texts of a PNG file.
_KEY = "Report"


def write(docs: Path) -> None:
    """Draw all pictures, and replace the ones that differ or have another digest."""
    for file, report, draw in _pictures(docs):
        with temporary_folder() as folder:
            draw(report, folder / file.name)
            with Image.open(folder / file.name) as drawing:
                new = drawing.copy()
        if _digest_of(file) == _digest(report) and _pixels_of(file) == new.tobytes():
            continue
        texts = PngInfo()
        texts.add_text(_KEY, _digest(report))
        file.parent.mkdir(exist_ok=True)
        with replacing(file) as stream:
            new.save(stream, format="png", pnginfo=texts)
        print(f"figures: drew {file.name}")


def problems(docs: Path) -> Iterator[str]:
    """One line for each picture that shows another report than its data file's."""
    for file, report, _ in _pictures(docs):
        if _digest_of(file) != _digest(report):
            yield f"pictures/{file.name} is not that of its data: run tools/figures pages"


def _pictures(docs: Path) -> Iterator[tuple[Path, Mapping[str, Any], Callable[[Mapping[str, Any], Path], None]]]:
    """Each picture whose data file is there, with its report and the function that draws it."""
    data = Data(docs)
    for name, (entry, draw) in PICTURES.items():
        content = data.get(entry)
        if content is not None:
            yield docs / "pictures" / name, {"config": content.get("config"), **content["result"]}, draw


def _digest(report: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(report, sort_keys=True).encode()).hexdigest()


def _digest_of(file: Path) -> str | None:
    """The digest that a picture holds; None without the file or the digest."""
    if not file.is_file():
        return None
    with Image.open(file) as picture:
        return picture.info.get(_KEY)


def _pixels_of(file: Path) -> bytes:
    with Image.open(file) as picture:
        return picture.tobytes()
