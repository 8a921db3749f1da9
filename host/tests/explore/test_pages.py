"""The generated tables of docs/mixed-precision.md."""

from __future__ import annotations

import json

import pytest

from colonnade.design.toolchain import project_root
from colonnade.explore import pages

DOCS = project_root() / "docs"
DATA = DOCS / "data" / f"{pages.STUDY}.json"


def test_without_data_the_page_says_what_to_run() -> None:
    text = pages.page((DOCS / pages.PAGE).read_text(), None)
    assert text.count("Not measured: run `tools/studies mixed-precision`.") == len(pages.TABLES)


@pytest.mark.skipif(not DATA.is_file(), reason="the study is not in docs/data")
def test_the_page_is_that_of_the_data() -> None:
    text = (DOCS / pages.PAGE).read_text()
    assert pages.page(text, json.loads(DATA.read_text())) == text
