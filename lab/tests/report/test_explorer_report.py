"""The report of a study: complete, self-contained, and harmless whatever the study holds."""

from __future__ import annotations

import base64
import io
import json
import re
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from colonnade.common.errors import UserError
from PIL import Image
from study_example import HOSTILE, LIBRARIES, PRECISIONS, cycles_only, hostile, study, without_area, write_picture

from colonnade_lab.report.explorer import pictures, write_plots, write_report

Change = Callable[[dict[str, Any]], None]
VARIANTS: dict[str, Change | None] = {
    "everything": None,
    "cycles-only": cycles_only,
    "without-area": without_area,
    "hostile": hostile,
}

#: Elements without an end tag.
VOID = {"meta", "link", "img", "input", "br"}


class Page(HTMLParser):
    """The elements of a page, its text, and the content of its scripts; checks that elements nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs), f"{tag} repeats an attribute"
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "script":
            self.scripts[-1] += data
        elif not self._open or self._open[-1] != "style":
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        """The attributes of all elements of a kind."""
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def data(self) -> dict[str, Any]:
        """What the page's script reads."""
        return json.loads(self.scripts[0])  # type: ignore[no-any-return]


@pytest.fixture(params=VARIANTS)
def variant(request: pytest.FixtureRequest) -> Change | None:
    return VARIANTS[request.param]


def report(folder: Path, change: Change | None = None) -> tuple[dict[str, Any], Page]:
    content = study(folder, change)
    path = write_report(folder)
    assert path == folder / "report.html"
    return content, Page(path.read_text())


def test_the_page_loads_nothing(tmp_path: Path, variant: Change | None) -> None:
    _, page = report(tmp_path, variant)
    for tag, attributes in page.elements:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            address = attributes.get(name) or "#"
            assert address.startswith(("#", "data:")), f"<{tag} {name}={address[:80]}>"
        assert not any(name.startswith("on") for name in attributes)
    style = (tmp_path / "report.html").read_text().partition("<style>")[2].partition("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style
    policy = next(each["content"] for each in page.all("meta") if each.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-eval" not in policy
    assert "http" not in policy


def test_every_point_and_column_is_on_the_page(tmp_path: Path, variant: Change | None) -> None:
    content, page = report(tmp_path, variant)
    names = [point["name"] for point in content["points"]]
    assert [row["data-point"] for row in page.all("tr") if "data-point" in row] == names
    keys = [column["key"] for column in content["columns"]]
    assert [cell["data-key"] for cell in page.all("th") if "data-key" in cell] == keys
    assert [point["name"] for point in page.data["points"]] == names
    for point in content["points"]:
        for failure in point["failures"]:
            assert failure["reason"] in page.text


def test_cells_hold_all_digits(tmp_path: Path) -> None:
    content, page = report(tmp_path)
    cells = iter([cell for cell in page.all("td") if "data-raw" in cell])
    for point in content["points"]:
        for _ in content["axes"]:
            next(cells)
        for column in content["columns"]:
            value = point["figures"][column["key"]]
            cell = next(cells)
            assert cell["data-raw"] == ("" if value is None else repr(value))
            assert ("data-number" in cell) == (value is not None)


def test_front_baseline_and_best_values_are_marked(tmp_path: Path) -> None:
    content, page = report(tmp_path)
    marked = [row["data-point"] for row in page.all("tr") if row.get("class") == "front"]
    assert marked == content["front"]["points"]
    best = [cell["data-raw"] for cell in page.all("td") if cell.get("class") == "best"]
    figures = [point["figures"] for point in content["points"]]
    assert repr(max(each["psnr_min"] for each in figures)) in best
    assert repr(min(each["kge.asap7"] for each in figures)) in best
    assert len(best) == sum(column["better"] is not None for column in content["columns"])
    assert page.data["charts"]["scatter"]["params"][0] == {"name": "x", "value": "dists_loss"}
    assert page.data["charts"]["scatter"]["params"][1] == {"name": "y", "value": "nj.asap7"}


def test_text_of_the_study_stays_text(tmp_path: Path) -> None:
    content, page = report(tmp_path, hostile)
    assert page.all("title") and page.text.count(HOSTILE) > 20
    # two scripts of the page, and its data
    assert len(page.scripts) == 3
    assert all("onerror" not in attributes for attributes in page.all("img"))
    assert page.data["title"] == HOSTILE
    assert page.data["points"][-1]["name"] == content["points"][-1]["name"]
    raw = (tmp_path / "report.html").read_text()
    assert "<script>alert" not in raw.replace("&lt;", "[")
    assert raw.count("</script>") == 3
    assert "{{ 7*7 }}" in page.text


def test_what_was_not_measured_is_said_in_one_line(tmp_path: Path) -> None:
    _, page = report(tmp_path, cycles_only)
    for section in ("RenderIndex", "area", "power", "no pictures"):
        assert re.search(f"Not measured: [^.]*{section}", page.text)
    assert "Not measured: cycles" not in page.text
    assert set(page.data["charts"]) == {"scatter", "stalls", "utilisation"}
    assert [each["value"] for each in page.data["charts"]["scatter"]["params"][:2]] == [
        "geometry.triangleBits",
        "rays_per_cycle",
    ]
    assert not page.data["pictures"]


def test_a_study_without_points_has_a_page(tmp_path: Path) -> None:
    def nothing(content: dict[str, Any]) -> None:
        content.update(points=[], front=None, render_index=None, search=None, columns=[])

    _, page = report(tmp_path, nothing)
    assert "0 of 0 points" in page.text


def test_an_infinite_figure_counts_as_missing(tmp_path: Path) -> None:
    study(tmp_path)
    text = (tmp_path / "study.json").read_text()
    (tmp_path / "study.json").write_text(re.sub(r'"psnr_min": [0-9.]+', '"psnr_min": Infinity', text, count=1))
    page = Page(write_report(tmp_path).read_text())
    assert page.data["points"][0]["figures"][0] == ["PSNR, lowest, dB", "–"]


def test_the_same_study_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = (tmp_path / name for name in "ab")
    for folder in (first, second):
        study(folder)
    assert write_report(first).read_bytes() == write_report(second).read_bytes()
    assert write_report(first).read_bytes() == (second / "report.html").read_bytes()


def decoded(uri: str) -> np.ndarray[Any, Any]:
    data = base64.b64decode(uri.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_pictures_are_exact_copies(tmp_path: Path) -> None:
    content, page = report(tmp_path)
    point, data = content["points"][2], page.data["points"][2]
    for name, figures in point["workloads"].items():
        picture = page.data["pictures"][data["workloads"][name]["picture"]]
        assert not picture["lossy"]
        original = np.asarray(Image.open(tmp_path / figures["picture"]))
        assert (decoded(picture["uri"]) == original).all()
        assert (picture["height"], picture["width"]) == original.shape[:2]


def size(encoded: dict[str, pictures.Encoded]) -> int:
    """Bytes of the different pictures."""
    return sum(map(len, {picture.data for picture in encoded.values()}))


def test_too_many_bytes_make_whole_workloads_lossy(tmp_path: Path) -> None:
    content = study(tmp_path)
    random = np.random.default_rng(1)
    for point in content["points"]:
        noise = random.integers(0, 256, (72, 96, 3), dtype=np.uint8)
        Image.fromarray(noise).save(tmp_path / point["workloads"]["bunny"]["picture"])
    exact = pictures.load(content, tmp_path)
    assert not any(picture.is_lossy for picture in exact.values())
    total = size(exact)
    smaller = pictures.load(content, tmp_path, max_bytes=total - 1)
    for path, picture in smaller.items():
        assert picture.is_lossy == path.endswith("--bunny.png")
    assert size(smaller) < total


def test_equal_pictures_are_stored_once(tmp_path: Path) -> None:
    _, page = report(tmp_path)
    # The precisions of 64 bits have the picture of the reference.
    keys = {point["workloads"]["teapot"]["picture"] for point in page.data["points"]}
    assert page.data["workloads"][0]["reference"] in keys
    assert len(page.data["pictures"]) == len(keys)


def test_a_missing_picture_is_named(tmp_path: Path) -> None:
    content = study(tmp_path)
    path = content["points"][0]["workloads"]["bunny"]["picture"]
    (tmp_path / path).unlink()
    with pytest.raises(UserError, match=path):
        write_report(tmp_path)


def test_a_picture_outside_of_the_study_is_refused(tmp_path: Path) -> None:
    write_picture(tmp_path / "secret.png", 32)
    content = study(tmp_path / "study")
    content["workloads"][0]["reference"] = "../secret.png"
    (tmp_path / "study" / "study.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match="outside"):
        write_report(tmp_path / "study")


@pytest.mark.parametrize(
    ("text", "reason"), [(None, "run colonnade explore"), ("{", "not JSON"), ('{"version": 2}', "version 1")]
)
def test_a_study_that_cannot_be_read_is_refused(tmp_path: Path, text: str | None, reason: str) -> None:
    if text is not None:
        (tmp_path / "study.json").write_text(text)
    with pytest.raises(UserError, match=reason):
        write_report(tmp_path)


def test_plots_are_written_for_each_choice(tmp_path: Path) -> None:
    study(tmp_path)
    paths = write_plots(tmp_path)
    assert "vl_convert" not in sys.modules, "JavaScript in this process would keep it from answering signals"
    names = {path.name for path in paths}
    assert {"pareto--dists_loss--nj.asap7.png", "pareto--nj.asap7--kge.asap7.svg", "index.svg"} <= names
    for library in LIBRARIES:
        assert {f"area--{library}--{level}.png" for level in ("traversal_unit", "column", "array")} <= names
    for path in paths:
        assert path.parent == tmp_path / "plots"
        if path.suffix == ".png":
            assert Image.open(path).width >= 1500
    scatter = (tmp_path / "plots" / "pareto--dists_loss--nj.asap7.svg").read_text()
    assert all(name in scatter for name in (PRECISIONS[0], PRECISIONS[-1], "DISTS loss, % (lower is better)"))


@pytest.mark.parametrize("change", [cycles_only, without_area, hostile])
def test_plots_of_any_study_have_names_of_their_own(tmp_path: Path, change: Change) -> None:
    study(tmp_path, change)
    paths = write_plots(tmp_path)
    assert paths
    assert len(set(paths)) == len(paths)
    assert all(re.fullmatch(r"[A-Za-z0-9=._-]+", path.name) and path.is_file() for path in paths)
