"""The browser tab's reader of glTF, beside the host's, over `gltf_documents`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built_page import MODULE, NEEDS_MODULE, ROOT, run_node
from gltf_documents import READ, REFUSED

from colonnade.common.errors import UserError
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.files.formats import read_surface
from colonnade.mesh.load import load_mesh

pytestmark = NEEDS_MODULE


def by_the_tab(folder: Path, files: dict[str, bytes]) -> dict[str, Any]:
    """What site/meshes.js reads, by name: an error, or the arrays of corners."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    manifest = json.loads((ROOT / "configs" / "golden" / "small.json").read_text())
    run_node("meshes.mjs", folder, {"module": str(MODULE), "manifest": manifest})
    return dict(json.loads((folder / "result.json").read_text()))


def test_the_tab_and_the_host_refuse_the_same_files_in_the_same_words(tmp_path: Path) -> None:
    found = by_the_tab(tmp_path, {name: content for name, (_, content) in REFUSED.items()})
    for name, (says, _) in REFUSED.items():
        with pytest.raises(UserError) as caught:
            load_mesh(tmp_path / name)
        words = str(caught.value).replace(str(tmp_path / name), name)
        assert says in words, name
        assert found[name].get("error", "it was read") == words, name


def test_the_tab_and_the_host_read_the_same_triangles(tmp_path: Path) -> None:
    found = by_the_tab(tmp_path, READ)
    for name in READ:
        surface = read_surface(tmp_path / name).surface
        assert "error" not in found[name], found[name]
        corners = np.reshape(found[name]["corners"], (-1, 3, 3))
        np.testing.assert_allclose(corners, surface.vertices[surface.faces], rtol=1e-12, atol=1e-12, err_msg=name)
        for key, expected in (("normals", surface.normals), ("colours", surface.colours)):
            if expected is None:
                assert found[name][key] is None, name
                continue
            values = np.reshape(found[name][key], (-1, 3, 3))
            values = unit_vectors(values) if key == "normals" else values
            np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12, err_msg=name)
