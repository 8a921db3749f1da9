"""Without a package of an extra, a command that needs it says so in one line; frames need none of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.common.extras import EXTRAS
from colonnade.design.toolchain import project_root

#: Renders and packs in a process that can import no module of an extra.
FRAME = """
import sys
sys.modules |= dict.fromkeys({missing!r})
from colonnade.cli.main import cli
cli.main(["render", "scenes/object.toml", "--mesh", "teapot:2", "--config", "tiny", "--backend", "model",
          "--size", "16x12", "--output", {picture!r}])
"""


@pytest.mark.parametrize(
    ("arguments", "module", "line"),
    [
        (
            ["render", "scenes/object.toml", "--backend", "reference", "--output", "OUT"],
            "embreex",
            "no package embreex found, which the reference backend needs: pip install 'colonnade[reference]'"
            " (Linux on x86_64 and macOS)",
        ),
        (
            ["compare", "scenes/rooms/living/albedo.png", "scenes/rooms/living/albedo.png"],
            "flip_evaluator",
            "no package flip_evaluator found, which a comparison of pictures needs: pip install 'colonnade[quality]'"
            " (Linux on x86_64 and macOS, Python up to 3.13)",
        ),
        (
            ["inspect", "--background", "scenes/rooms/living"],
            "flip_evaluator",
            "no package flip_evaluator found, which inspect --background needs: pip install 'colonnade[quality]'"
            " (Linux on x86_64 and macOS, Python up to 3.13)",
        ),
        (
            ["registers", "--config", "tiny", "--output", "OUT"],
            "peakrdl_html",
            "no package peakrdl_html found, which colonnade registers needs: pip install 'colonnade[integration]'",
        ),
    ],
)
def test_a_missing_package_is_one_line(
    arguments: list[str], module: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project_root())
    monkeypatch.setitem(sys.modules, module, None)
    output = tmp_path / "out"
    result = CliRunner().invoke(cli, [str(output) if one == "OUT" else one for one in arguments])
    assert (result.exit_code, result.stderr) == (2, f"colonnade: error: {line}\n")
    assert not output.exists()


def test_a_frame_needs_no_extra(tmp_path: Path) -> None:
    picture = tmp_path / "picture.png"
    program = FRAME.format(missing=[module for modules in EXTRAS.values() for module in modules], picture=str(picture))
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=project_root(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert picture.is_file()
