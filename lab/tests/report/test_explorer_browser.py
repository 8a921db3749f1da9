"""The report of a study in a browser: Chromium opens the file and a test clicks through it."""

from __future__ import annotations

import itertools
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from patience import PATIENCE
from playwright.sync_api import Browser, Locator, Page, expect
from study_example import HOSTILE, cycles_only, hostile, study, without_area

from colonnade_lab.report.explorer import write_report


class Report:
    """An open report, and what it asked for or complained about."""

    def __init__(self, page: Page, path: Path) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.set_default_timeout(PATIENCE)
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda message: self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", lambda dialog: (self.complaints.append(dialog.message), dialog.dismiss()))
        self.url = path.as_uri()
        page.goto(self.url)

    def is_quiet(self) -> bool:
        """Whether the page loaded only itself and the console is empty."""
        outside = [url for url in self.requests if url != self.url and not url.startswith(("data:", "blob:"))]
        assert not outside
        assert not self.complaints
        return True

    def names(self) -> list[str]:
        """The shown points of the table, in their order."""
        return self.page.locator("#table tbody tr:visible .pick").all_text_contents()

    def chart(self, name: str) -> Locator:
        """The drawn chart."""
        return self.page.locator(f"#chart-{name} svg.marks")


@pytest.fixture
def open_report(browser: Browser, tmp_path: Path) -> Iterator[Any]:
    context = browser.new_context(viewport={"width": 1280, "height": 900}, offline=True)

    def opened(change: Any = None) -> Report:
        study(tmp_path, change)
        return Report(context.new_page(), write_report(tmp_path))

    yield opened
    context.close()


def test_table_sorts_filters_and_downloads(open_report: Any) -> None:
    report = open_report()
    page = report.page
    page.click("th[data-key='kge.asap7'] button")
    assert report.names()[0] == "16b16s32d"
    page.click("th[data-key='kge.asap7'] button")
    assert report.names()[0] == "64b64s64d"
    assert page.get_attribute("th[data-key='kge.asap7']", "aria-sort") == "descending"
    # The point without this figure is the last one in both directions.
    for _ in range(2):
        page.click("th[data-key='nj.sky130'] button")
        assert report.names()[-1] == "16b16s32d"
    page.fill("#filter", "24b s32")
    assert report.names() == ["24b24s32d"]
    expect(page.locator("#row-count")).to_have_text("1 of 7 points")
    page.fill("#filter", "")
    page.select_option("#limit-column", label="PSNR, lowest, dB")
    page.fill("#limit-value", "50")
    assert sorted(report.names()) == ["32b32s32d", "32b32s64d", "64b64s64d"]
    page.check("#front-only")
    assert report.names() == ["32b32s64d"]
    with page.expect_download() as download:
        page.click("#csv")
    lines = download.value.path().read_text().splitlines()
    assert lines[0].startswith('point,precision,geometry.triangleBits,"PSNR, lowest, dB"')
    assert len(lines) == 2
    assert lines[1].startswith("32b32s64d,32b32s64d,,56.88,")
    assert report.is_quiet()


def test_a_click_on_a_point_shows_it_beside(open_report: Any) -> None:
    report = open_report()
    page = report.page
    page.locator("#chart-scatter path[aria-label='24b24s64d']").click()
    expect(page.locator("#panel-name")).to_have_text("24b24s64d")
    expect(page.locator("#panel-body")).to_contain_text("precision=24b24s64d")
    expect(page.locator("#panel-body")).to_contain_text("33.82")
    assert page.locator("#panel-body img").evaluate("image => image.naturalWidth") == 96
    expect(page.locator("#table tr.selected .pick")).to_have_text("24b24s64d")
    expect(page.locator("#picture-right option:checked")).to_have_text("24b24s64d")
    # The other ways to select: the table, and a drop-down for the keyboard.
    page.locator("#table .pick", has_text="64b64s64d").press("Enter")
    expect(page.locator("#panel-name")).to_have_text("64b64s64d")
    page.select_option("#panel-point", "16b16s32d")
    expect(page.locator("#panel-body")).to_contain_text("the netlist's frame ran too long")
    assert report.is_quiet()


def test_axes_of_the_scatter_plot_can_be_chosen(open_report: Any) -> None:
    report = open_report()
    page = report.page
    expect(report.chart("scatter")).to_contain_text("DISTS loss, % (lower is better)")
    page.select_option("#scatter-x", label="energy per ray, sky130, nJ")
    expect(report.chart("scatter")).to_contain_text("energy per ray, sky130, nJ (lower is better)")
    expect(page.locator("#scatter-note")).to_have_text("1 of 7 points lack one of these figures.")
    assert page.locator("#chart-scatter .mark-symbol path[aria-label$='d']").count() == 6
    page.locator("#chart-scatter path[aria-label='32b32s64d']").hover()
    expect(page.locator("#vg-tooltip-element")).to_contain_text("geometry.triangleBits = –")
    assert report.is_quiet()


def decades(content: dict[str, Any]) -> None:
    """More points than labels have space for, whose energy spans three decades."""
    draws = random.Random(3)
    for number in range(60):
        point = json.loads(json.dumps(content["points"][number % 5]))
        point["name"] = f"point {number} of the grid"
        for key in point["figures"]:
            if isinstance(point["figures"][key], float):
                point["figures"][key] *= 10 ** draws.uniform(-1, 1)
        content["points"].append(point)


def test_labels_of_the_scatter_plot_are_apart_and_the_selected_point_has_one(open_report: Any) -> None:
    report = open_report(decades)
    page = report.page
    page.select_option("#panel-point", "point 17 of the grid")
    page.select_option("#scatter-y", label="energy per ray, sky130, nJ")
    labels = "#chart-scatter g.mark-text.role-mark text"
    expect(page.locator(labels).filter(has_text="point 17 of the grid")).to_have_attribute("opacity", "1")
    boxes = page.locator(labels).evaluate_all(
        """texts => texts.filter((text) => text.getAttribute("opacity") !== "0").map((text) => {
          const box = text.getBoundingClientRect();
          return [box.left, box.right, box.top + 2, box.bottom - 2];
        })"""
    )
    assert 20 <= len(boxes) < 60
    for one, other in itertools.combinations(boxes, 2):
        assert one[1] <= other[0] or other[1] <= one[0] or one[3] <= other[2] or other[3] <= one[2]
    ticks = page.locator("#chart-scatter .role-axis-label text").all_text_contents()
    assert any(float(tick) < 0.02 for tick in ticks if tick.replace(".", "").isdigit()), "a logarithmic axis"
    assert report.is_quiet()


def test_library_level_and_workload_can_be_chosen(open_report: Any) -> None:
    report = open_report()
    page = report.page
    before = report.chart("area").inner_html()
    page.select_option("select[data-chart=area][data-param=library]", "sky130")
    page.wait_for_function("before => document.querySelector('#chart-area svg.marks').innerHTML !== before", arg=before)
    page.select_option("select[data-chart=area][data-param=level]", "column")
    expect(report.chart("area")).to_contain_text("ColumnBvhController")
    expect(report.chart("area")).not_to_contain_text("TriangleUnit")
    expect(report.chart("utilisation")).to_contain_text("72%")
    page.select_option("select[data-chart=utilisation]", "dragon")
    expect(report.chart("utilisation")).to_contain_text("68%")
    before = report.chart("stalls").inner_html()
    page.select_option("select[data-chart=stalls]", "dragon")
    page.wait_for_function(
        "before => document.querySelector('#chart-stalls svg.marks').innerHTML !== before", arg=before
    )
    assert report.is_quiet()


def test_pictures_by_slider_and_difference(open_report: Any) -> None:
    report = open_report()
    page = report.page
    page.select_option("#picture-workload", "bunny")
    expect(page.locator("#beside-left")).to_have_attribute("alt", "bunny: reference (Embree)")
    expect(page.locator("#caption-right")).to_contain_text("PSNR")

    page.check("input[value=slider]")
    assert page.locator("#slider-left").evaluate("image => image.style.clipPath") == "inset(0px 50% 0px 0px)"
    page.locator("#divider").press("Home")
    assert page.locator("#slider-left").evaluate("image => image.style.clipPath") == "inset(0px 100% 0px 0px)"

    page.select_option("#picture-right", label="16b16s32d")
    page.check("input[value=difference]")
    expect(page.locator("#difference-note")).to_contain_text("reference (Embree) − 16b16s32d| × 8")
    pixels = page.locator("#difference").evaluate(
        'canvas => [...canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data]'
    )
    corner, centre = pixels[:4], pixels[4 * (36 * 96 + 40) :][:4]
    assert corner == [0, 0, 0, 255]
    assert any(centre[:3])
    page.locator("#gain").press("End")
    expect(page.locator("#gain-value")).to_have_text("128×")
    expect(page.locator("#difference-note")).to_contain_text("× 128")
    page.select_option("#picture-right", label="reference (Embree)")
    expect(page.locator("#difference-note")).to_contain_text(": 0 of 6,912 pixels differ (0.00 %), at most by 0")
    assert report.is_quiet()


def test_columns_can_be_hidden(open_report: Any) -> None:
    report = open_report()
    report.page.click(".columns summary")
    report.page.uncheck("#column-choice input >> nth=2")
    expect(report.page.locator("th[data-key=psnr_min]")).to_be_hidden()
    expect(report.page.locator("th[data-key=dists_loss]")).to_be_visible()
    assert report.is_quiet()


@pytest.mark.parametrize("change", [cycles_only, without_area])
def test_a_page_without_some_figures_works(open_report: Any, change: Any) -> None:
    report = open_report(change)
    expect(report.chart("stalls")).to_be_visible()
    expect(report.chart("scatter")).to_be_visible()
    expect(report.chart("area")).to_have_count(0)
    assert report.is_quiet()


def test_text_of_the_study_never_runs(open_report: Any) -> None:
    report = open_report(hostile)
    page = report.page
    expect(report.chart("utilisation")).to_be_visible()
    page.select_option("#panel-point", index=6)
    expect(page.locator("#panel-name")).to_contain_text("onerror=alert(1)")
    page.locator("#chart-scatter path[aria-label^='<script>']").hover()
    expect(page.locator("#vg-tooltip-element")).to_contain_text(HOSTILE[:8])
    page.select_option("#picture-workload", index=0)
    page.select_option("#picture-right", index=1)
    page.check("input[value=difference]")
    expect(page.locator("#difference-note")).to_contain_text("pixels differ")
    assert page.locator("script").count() == 3
    assert page.locator("img[onerror], img[src=x]").count() == 0
    assert report.is_quiet()
