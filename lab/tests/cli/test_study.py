"""Commands of ``colonnade study``: each calls its study as the study is declared, and prints its table."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from unittest.mock import create_autospec

import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli

from colonnade_lab.cli import study


@pytest.mark.parametrize(
    "words",
    [
        ["rays", "room"],
        ["frames", "room", "--no-dists", "--output", "out"],
        ["occlusion", "--rooms", "0-1"],
        ["light", "room"],
        ["captures", "room"],
        ["generated", "0,3"],
        ["views", "0"],
        ["moved-frames", "0"],
        ["live", "room"],
        ["live", "--rooms", "0"],
        ["live-paths", "0"],
    ],
    ids=" ".join,
)
def test_a_command_calls_its_study(words: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def declared(name: str) -> object:
        module = create_autospec(import_module(name))
        for call in [call for name, call in vars(module).items() if name.startswith("study")]:
            call.return_value = {}
        for table in ("table", "tables", "path_table"):
            if hasattr(module, table):
                getattr(module, table).return_value = "the table"
        return module

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study, "import_module", declared)
    result = CliRunner().invoke(cli, ["study", *words, "--json", "report.json"])
    assert (result.exit_code, result.stdout) == (0, "the table\n"), result.output
    assert (tmp_path / "report.json").read_text() == "{}\n"
