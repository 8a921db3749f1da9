"""The commands of the starting pages run in order, as written, and print what the pages say."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from colonnade.device.simulator_build import build_environment

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted(path.stem for path in (ROOT / "docs" / "start").glob("*.md"))
#: The pages that continuous integration has time for; the matrix runs the others.
IN_EVERY_RUN = ("newcomer", "soc")

#: For the bench of the examples: soon compiled, slow.
QUICK = "-MAKEFLAGS OPT_FAST=-O0 -MAKEFLAGS OPT_GLOBAL=-O0 --output-split 0 --noassert"


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=() if page in IN_EVERY_RUN else pytest.mark.matrix) for page in PAGES]
)
def test_the_commands_of_a_starting_page_print_what_it_says(page: str) -> None:
    environment = {**os.environ, **build_environment(), "VERILATOR_FLAGS": QUICK}
    command = [ROOT / "tools" / "starting-pages", page]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
