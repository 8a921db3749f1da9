"""The gain of the BVH in cycles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colonnade.lab.explore import tree_cycles
from colonnade.lab.explore.jobs import Job
from colonnade.lab.explore.tree_cycles import NO_TREE, REDUCED, reduced, tree_gain
from colonnade.mesh.load import load_mesh


def test_meshes_are_reduced_to_whole_faces() -> None:
    mesh = load_mesh("sphere:2000")
    vertices, faces = reduced(mesh, 200)
    assert 50 < len(faces) <= 200
    assert faces.max() < len(vertices)
    assert all(len(set(face)) == 3 for face in faces.tolist())
    assert np.abs(vertices).max() <= np.abs(mesh.vertices).max()


def test_the_gain_is_the_ratio_of_the_cycles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each mesh, whichever of its frames is rendered first."""

    def run(jobs: Sequence[Job], *_: object) -> list[dict[str, Any]]:
        assert len({job.key for job in jobs}) == 4, "frames of equal content are one job"
        cycles = [90 if NO_TREE in job.arguments["overrides"] else 30 for job in jobs]
        faces = [len(job.arguments["mesh"].faces) for job in jobs]
        return [{"cycles": c, "triangles": f, "rays": {"in_box": 5}} for c, f in zip(cycles, faces, strict=True)]

    monkeypatch.setattr(tree_cycles, "cache_directory", lambda _: tmp_path)
    monkeypatch.setattr(tree_cycles, "load_mesh", lambda name: load_mesh("sphere:2000" if name in REDUCED else name))
    monkeypatch.setattr(tree_cycles, "run_in_order", run)
    found = tree_gain("tiny", [50, 150], (8, 8))
    assert list(found["reductions"]) == ["50", "150"]
    assert list(found["reductions"]["50"]["meshes"]) == list(REDUCED)
    teapot = found["reductions"]["50"]["meshes"]["teapot"]
    assert 0 < teapot.pop("triangles") <= 50
    assert teapot == {"rays_in_box": 5, "cycles": {"tree": 30, "none": 90}, "gain": 3.0}
    assert found["reductions"]["150"]["geomean_gain"] == pytest.approx(3.0)
