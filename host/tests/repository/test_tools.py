"""Programs of tools/ that measure frames of the RTL run, and find them equal to the model's; so does `make render`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[3]


@pytest.mark.matrix
@pytest.mark.verilator
@pytest.mark.parametrize(
    "command",
    [
        "room-frames small 32x24 --compare",
        "room-frames small 32x24 --compare --moved",
        "composited-frame scenes/room.toml small 32x24 8",
    ],
)
def test_the_frames_of_a_tool_are_the_models(command: str) -> None:
    program, *arguments = command.split()
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / program, *arguments], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.matrix
@pytest.mark.verilator
def test_make_render_gives_the_picture_of_the_readme() -> None:
    subprocess.run(["make", "render"], check=True, cwd=ROOT)
    found, expected = (np.asarray(Image.open(ROOT / name)) for name in ("out/render.png", "docs/pictures/room.png"))
    np.testing.assert_array_equal(found, expected)
