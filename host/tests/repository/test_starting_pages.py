"""The commands of the starting pages run in order, as written, and print what the pages say."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from colonnade.device import simulator_build

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted(path.stem for path in (ROOT / "docs" / "start").glob("*.md"))

#: For the bench of the examples: soon compiled, slow.
QUICK = {
    "VERILATOR_FLAGS": "-MAKEFLAGS OPT_FAST=-O0 -MAKEFLAGS OPT_GLOBAL=-O0 --noassert "
    f"--output-split {simulator_build.QUICK.split}"
}


def run_page(page: str, *options: str, environment: Mapping[str, str]) -> None:
    command = [ROOT / "tools" / "starting-pages", *options, page]
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", ["newcomer", pytest.param("soc", marks=pytest.mark.matrix)])
def test_the_commands_of_a_starting_page_print_what_it_says(page: str) -> None:
    run_page(page, environment=simulator_build.build_environment() | QUICK)


@pytest.mark.matrix
@pytest.mark.parametrize("page", PAGES)
def test_a_starting_page_runs_from_its_setup_to_its_last_line(page: str) -> None:
    """In a clone of the last commit: some ten minutes each."""
    run_page(page, "--all", environment={})
