"""Without an extra or the laboratory, a command that needs it says so in one line; frames need none of them."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import files, requires, version
from pathlib import Path

import pytest
from click.testing import CliRunner

from colonnade import __version__
from colonnade.cli.main import LABORATORY, cli
from colonnade.common.extras import EXTRAS
from colonnade.design.toolchain import project_root

#: Packages of the laboratory.
LIBRARIES = ["colonnade_lab", "matplotlib", "distributed", "dask", "optuna", "altair", "vl_convert", "jinja2"]

#: Renders in a process that can import no module of an extra and none of the laboratory.
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
            " (Linux on x86_64 and macOS), or make setup in a checkout",
        ),
        (
            ["compare", "scenes/rooms/living/albedo.png", "scenes/rooms/living/albedo.png"],
            "flip_evaluator",
            "no package flip_evaluator found, which a comparison of pictures needs: pip install 'colonnade[quality]'"
            " (Linux on x86_64 and macOS, Python up to 3.13), or make setup in a checkout",
        ),
        (
            ["inspect", "--background", "scenes/rooms/living"],
            "flip_evaluator",
            "no package flip_evaluator found, which inspect --background needs: pip install 'colonnade[quality]'"
            " (Linux on x86_64 and macOS, Python up to 3.13), or make setup in a checkout",
        ),
        (
            ["registers", "--config", "tiny", "--output", "OUT"],
            "peakrdl_html",
            "no package peakrdl_html found, which colonnade registers needs: pip install 'colonnade[integration]',"
            " or make setup in a checkout",
        ),
        (
            ["capture", "README.md", "--output", "OUT"],
            "lzfse",
            "no package lzfse found, which a Record3D capture needs: pip install 'colonnade[capture]',"
            " or make setup in a checkout",
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


def test_a_frame_needs_neither_extras_nor_laboratory(tmp_path: Path) -> None:
    picture = tmp_path / "picture.png"
    missing = [*LIBRARIES, *(module for modules in EXTRAS.values() for module in modules)]
    program = FRAME.format(missing=missing, picture=str(picture))
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=project_root(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert picture.is_file()


@pytest.mark.parametrize("name", LABORATORY)
def test_without_the_laboratory_its_commands_name_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [module for module in sys.modules if module.startswith("colonnade_lab")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "colonnade_lab", None)
    result = CliRunner().invoke(cli, [name, "--help"])
    line = f"colonnade: error: no colonnade-lab found, which colonnade {name} needs: "
    line += "pip install colonnade-lab, or make setup in a checkout\n"
    assert (result.exit_code, result.stderr) == (2, line)
    assert name in CliRunner().invoke(cli, ["--help"]).stdout


def test_both_distributions_have_one_version() -> None:
    assert version("colonnade") == version("colonnade-lab") == __version__
    (host,) = (one for one in requires("colonnade-lab") or () if one.startswith("colonnade["))
    assert host.endswith(f"=={__version__}")


def test_no_file_belongs_to_two_distributions() -> None:
    host, laboratory = (
        {str(file) for file in files(name) or () if str(file).startswith(("colonnade/", "colonnade_lab/"))}
        for name in ("colonnade", "colonnade-lab")
    )
    assert all(file.startswith("colonnade_lab/") for file in laboratory)
    assert not any(file.startswith("colonnade_lab/") for file in host)
    assert "colonnade_lab/report/explorer/page.html.jinja" in laboratory and "colonnade/cli/main.py" in host
