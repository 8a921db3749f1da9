"""The commands of the tutorial run in order, as written."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PLACE = ROOT / "out" / "tutorial"
SHELL_BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.fixture
def no_outputs() -> Iterator[None]:
    """Remove the tutorial's output folder before and after."""
    shutil.rmtree(PLACE, ignore_errors=True)
    yield
    shutil.rmtree(PLACE, ignore_errors=True)


def test_every_command_of_the_tutorial_runs(no_outputs: None, tmp_path: Path) -> None:
    blocks = SHELL_BLOCK.findall((ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8"))
    assert len(blocks) >= 8
    script = tmp_path / "tutorial.sh"
    script.write_text("set -euxo pipefail\n" + "\n".join(blocks), encoding="utf-8")
    # Without settings and caches of the user
    environment = {**os.environ, "HOME": str(tmp_path), "COLONNADE_PROGRESS": "off"}
    done = subprocess.run(["bash", script], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr

    # The picture of the model equals that of the RTL, that of the float reference does not; the ray has all its states
    model, reference = re.findall(r"^differing pixels +(\d+)$", done.stdout, re.MULTILINE)
    assert int(model) == 0 < int(reference)
    states = re.findall(r"^cycle \d+: (\w+)$", done.stdout, re.MULTILINE)
    ray = ["raySetup", "traversing", "resolve"]
    assert states == ["idle", *ray, "shading", "shadowTest", *ray, "lit", "accumulating", "done", "idle"]
