"""A window for the page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from patience import PATIENCE
from playwright.sync_api import Browser, BrowserContext


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    context = browser.new_context(viewport={"width": 800, "height": 240}, offline=True)
    context.set_default_timeout(PATIENCE)
    yield context
    context.close()
