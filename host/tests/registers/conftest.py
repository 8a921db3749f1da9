"""Designs whose views a target computes."""

from __future__ import annotations

import pytest
from target_views import Design


@pytest.fixture(scope="module", params=["tiny", "lean", "edge"])
def design(request: pytest.FixtureRequest) -> Design:
    return Design.golden(request.param)


@pytest.fixture(scope="module")
def small_design() -> Design:
    return Design.golden("edge")
