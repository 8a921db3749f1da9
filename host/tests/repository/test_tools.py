"""Programs of tools/ that measure frames of the RTL run, and find them equal to the model's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

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
