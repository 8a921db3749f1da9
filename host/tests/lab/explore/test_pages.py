"""The generated tables of the pages that show studies."""

from __future__ import annotations

import json

import pytest

from colonnade.design.toolchain import project_root
from colonnade.lab.explore import pages

DOCS = project_root() / "docs"


@pytest.mark.parametrize("name", pages.PAGES)
def test_without_data_a_page_says_what_to_run(name: str) -> None:
    text = pages.page((DOCS / f"{name}.md").read_text(), name, None)
    assert text.count(f"Not measured: run `tools/studies {name}`.") == len(pages.PAGES[name])


@pytest.mark.parametrize("name", pages.PAGES)
def test_a_page_is_that_of_its_data(name: str) -> None:
    data = DOCS / "data" / f"{name}.json"
    if not data.is_file():
        pytest.skip(f"the study {name} is not in docs/data")
    text = (DOCS / f"{name}.md").read_text()
    assert pages.page(text, name, json.loads(data.read_text())) == text
