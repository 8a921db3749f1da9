"""The ray tests of other projects, where COLONNADE_RAY_SUITES has their checkouts."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from colonnade.design.toolchain import project_root

SUITES = Path(os.environ.get("COLONNADE_RAY_SUITES", "/nowhere"))


@pytest.mark.skipif(not SUITES.exists(), reason="no folder COLONNADE_RAY_SUITES with trimesh and three-mesh-bvh")
def test_tests_of_other_projects_pass_on_the_model() -> None:
    folders = [f"--{name}={SUITES / name}" for name in ("trimesh", "three-mesh-bvh")]
    done = subprocess.run([project_root() / "tools/ray-suites", *folders], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
