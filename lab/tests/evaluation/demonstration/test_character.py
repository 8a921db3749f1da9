"""The character of the demonstration: its file, its size, and where its feet are."""

from __future__ import annotations

import numpy as np
import pytest
from colonnade.design.toolchain import project_root
from colonnade.mesh.load import load_mesh

from colonnade_lab.evaluation.demonstration import character

FILE = project_root() / "scenes" / "character.gltf"


def test_the_file_is_that_of_the_script() -> None:
    # tools/live --character writes it
    assert FILE.read_text(encoding="utf-8") == character.character()


@pytest.mark.parametrize("time", np.linspace(0.0, character.SECONDS, 23))
def test_one_foot_is_on_the_ground(time: float) -> None:
    mesh = load_mesh(FILE, animation=character.WALK)
    assert mesh.clip is not None and len(mesh.faces) <= 6000 and not mesh.notes
    pose = mesh.clip.pose(float(time))
    low, high = (limit(mesh.clip.vertices(pose.matrices, pose.weights), axis=0) for limit in (np.min, np.max))
    assert abs(low[1]) < 0.01 and 1.65 < high[1] < 1.8


def test_the_surface_faces_outwards_and_the_walk_repeats() -> None:
    mesh = load_mesh(FILE, animation=character.WALK)
    corners = mesh.vertices[mesh.faces]
    assert np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0
    assert mesh.clip is not None
    first, last = (mesh.clip.pose(at) for at in (0.0, float(character.SECONDS)))
    np.testing.assert_allclose(first.matrices, last.matrices, atol=1e-5)
