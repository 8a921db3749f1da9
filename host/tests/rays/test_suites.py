"""The ray tests of other projects, where the folder COLONNADE_RAY_SUITES has their checkouts."""

from __future__ import annotations

import os
import subprocess

import pytest

from colonnade.design.toolchain import project_root


@pytest.mark.skipif("COLONNADE_RAY_SUITES" not in os.environ, reason="COLONNADE_RAY_SUITES names no checkouts")
def test_tests_of_other_projects_pass_on_the_model() -> None:
    done = subprocess.run([project_root() / "tools/ray-suites"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
