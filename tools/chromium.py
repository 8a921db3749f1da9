"""The system's Chromium, for programs that open pages."""

from __future__ import annotations

import shutil

from playwright.sync_api import Browser, Playwright


def launched(playwright: Playwright) -> Browser:
    """Start Chromium; without one on the path, the one that Playwright has installed."""
    found = filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome")))
    return playwright.chromium.launch(executable_path=next(found, None), args=["--no-sandbox"])
