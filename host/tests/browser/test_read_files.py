"""The browser tab's readings of mesh files, beside the host's: the same packed images, in the same words."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from built_page import NEEDS_MODULE
from mesh_cases import CASES
from read_files import SUFFIXES, by_host, by_tab

pytestmark = NEEDS_MODULE

#: Folders of meshes to compare, separated by colons.
FOLDERS = "COLONNADE_FOREIGN_MESHES"


def test_the_tab_packs_and_refuses_as_the_host(tmp_path: Path) -> None:
    (tmp_path / "cases").mkdir()
    files = {name: case.write(tmp_path / "cases" / name.replace(".", "-"), name) for name, case in CASES.items()}
    for (name, file), reading in zip(files.items(), by_tab(list(files.values()), tmp_path), strict=True):
        assert reading == by_host(file, tmp_path), name
        assert (reading.refusal is None) == (CASES[name].says is None), name


def test_the_tab_packs_and_refuses_foreign_meshes_as_the_host(tmp_path: Path) -> None:
    """`tools/foreign-meshes` prints what differs."""
    folders = [Path(folder) for folder in os.environ.get(FOLDERS, "").split(os.pathsep) if folder]
    if not folders:
        pytest.skip(f"no folders in {FOLDERS}")
    files = sorted(file for folder in folders for file in folder.rglob("*") if file.suffix.lower() in SUFFIXES)
    for file, reading in zip(files, by_tab(files, tmp_path), strict=True):
        assert reading == by_host(file, tmp_path), file
