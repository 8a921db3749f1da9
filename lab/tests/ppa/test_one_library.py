"""Liberty files that are joined form one library."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli
from colonnade.common.errors import UserError

from colonnade_lab.ppa import measure
from colonnade_lab.ppa.library.cells import Cell, Library
from colonnade_lab.ppa.library.one_library import library_files
from colonnade_lab.ppa.netlist.synthesis import Technology

LOGIC = ("INVx1_FF7_R", "NAND2x1_FF7_R", "BUFx2_FF7_R")
REGISTERS = ("DFFx1_FF7_R", "LATCHx1_FF7_R")
OTHER = ("big_hd__inv_1", "big_hd__nand2_1", "big_hd__dfxtp_1")


def write(folder: Path, name: str, cells: tuple[str, ...], **attributes: str) -> Path:
    """A liberty file with these cells."""
    given = {"nom_process": "1", "nom_voltage": "0.7", "nom_temperature": "25", "time_unit": '"1ps"'} | attributes
    text = "".join(f"  {key} : {value};\n" for key, value in given.items() if value)
    groups = "".join(f"  cell ({cell}) {{ area : 1; }}\n" for cell in cells)
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(
        f"library (l) {{ /* nom_voltage : 9; */\n{text}  capacitive_load_unit (1, ff);\n{groups}}}\n"
    )
    return folder / name


def refusal(folder: Path) -> str:
    with pytest.raises(UserError) as error:
        library_files([str(folder)])
    return str(error.value)


def test_the_files_of_one_library_go_together(tmp_path: Path) -> None:
    files = write(tmp_path, "a.lib", LOGIC), write(tmp_path, "b.lib", REGISTERS, nom_voltage="0.70", time_unit="1ps")
    # Cells of one kind only do not show how a library names its cells
    files += (write(tmp_path, "c.lib", ("TIEx1_FF7_R", "TIEx2_FF7_R")),)
    assert library_files([str(tmp_path)]) == files


@pytest.mark.parametrize(
    ("attributes", "difference"),
    [
        ({"nom_voltage": "1.8"}, "nom_voltage (1.8, not 0.7)"),
        ({"nom_process": "1.1"}, "nom_process (1.1, not 1)"),
        ({"nom_temperature": "-40"}, "nom_temperature (-40, not 25)"),
        ({"nom_temperature": ""}, "nom_temperature (none, not 25)"),
        ({"time_unit": '"1ns"'}, "time_unit (1ns, not 1ps)"),
        ({"leakage_power_unit": '"1pW"'}, "leakage_power_unit (1pw, not 1nw)"),
        ({"nom_voltage": "1.8", "time_unit": '"10ps"'}, "nom_voltage (1.8, not 0.7), time_unit (10ps, not 1ps)"),
    ],
)
def test_other_conditions_and_units_are_refused(tmp_path: Path, attributes: dict[str, str], difference: str) -> None:
    write(tmp_path, "a.lib", LOGIC)
    write(tmp_path, "b.lib", REGISTERS, **attributes)
    assert (
        refusal(tmp_path) == f"b.lib differs from a.lib in {difference}: name the files of one library and one corner"
    )


def test_other_names_of_cells_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "a.lib", LOGIC)
    write(tmp_path, "b.lib", OTHER)
    assert refusal(tmp_path).startswith("b.lib differs from a.lib in names of cells (big_hd__inv_1, not …_FF7_R): name")
    write(tmp_path, "b.lib", ("INV", "NAND", "DFF"))
    assert "b.lib differs from a.lib in names of cells (INV, not …_FF7_R)" in refusal(tmp_path)
    write(tmp_path, "b.lib", OTHER)
    write(tmp_path, "a.lib", tuple(cell.replace("_hd", "_hs") for cell in OTHER))
    assert "names of cells (big_hd__inv_1, not big_hs__…)" in refusal(tmp_path)


def test_a_cell_in_two_files_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "a.lib", LOGIC)
    write(tmp_path, "b.lib", (*REGISTERS, LOGIC[0]))
    assert refusal(tmp_path) == "the cell INVx1_FF7_R is in a.lib and again in b.lib: name one of them"


@pytest.mark.parametrize("command", ["ppa --no-power --liberty {}", "explore study.toml --output out --library x={}"])
def test_a_folder_of_two_libraries_is_refused(tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Yosys need not be installed to refuse a liberty
    monkeypatch.setattr(measure, "require_yosys", lambda: None)
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "both", "a.lib", LOGIC)
    write(tmp_path / "both", "b.lib", OTHER, nom_voltage="1.8")
    (tmp_path / "cube.toml").write_text('mesh.name = "cube"\n')
    (tmp_path / "study.toml").write_text(
        'title = "t"\nlibraries = ["x"]\naxes.precision = ["32b32s64d"]\nworkload.scenes = ["cube.toml"]\n[area]\n'
    )
    result = CliRunner().invoke(cli, command.format("both").split())
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert "b.lib differs from a.lib in nom_voltage (1.8, not 0.7), names of cells" in result.stderr
    assert not (tmp_path / "out").exists()


def test_the_report_counts_the_cells_of_each_file() -> None:
    files = Path("a-0.lib"), Path("b-1.lib")
    owners = {"INV": files[0], "NAND": files[0], "DFF": files[1]}
    library = Library(files, {name: Cell(name, 1.0, False, {}) for name in owners}, owners)
    tech = Technology(library, "", 1.0, (Path("x/a.lib.gz"), Path("x/b.lib")))
    netlists = {"A": {"cells": {str(i): {"type": "INV"} for i in range(3)}}, "B": {"cells": {"d": {"type": "DFF"}}}}
    assert measure.cells_of_files(tech, netlists) == [
        {"file": "a.lib.gz", "cells": 2, "used": 1, "instances": 3},
        {"file": "b.lib", "cells": 1, "used": 1, "instances": 1},
    ]
