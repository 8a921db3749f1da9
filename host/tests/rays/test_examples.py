"""The examples of rays: their hits against double, and their pictures."""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh
from exact_rays import mesh_of, truth
from PIL import Image

from colonnade.design.toolchain import project_root
from colonnade.rays import Scene

FOLDER = project_root() / "examples" / "rays"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs an example with arguments; what it prints."""

    def run(name: str, *arguments: str | Path) -> str:
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        example(name).main()
        return capsys.readouterr().out

    return run


def test_ranges_of_the_lidar_are_within_a_unit_of_double() -> None:
    lidar = example("lidar")
    vertices, faces = lidar.street()
    rays = lidar.turn(8, 48)
    face, t = truth(vertices, faces, rays)
    scene = Scene(vertices, faces)
    hits = scene.closest(rays)
    both = (face >= 0) & (hits.face >= 0)
    assert both.sum() > 350 and ((face >= 0) == (hits.face >= 0)).all()
    assert np.abs(hits.t[both] - t[both]).max() < scene.unit


def test_the_lidar_draws_its_points(tmp_path: Path, run: Callable[..., str]) -> None:
    assert "rays hit, 3." in run("lidar", "--beams", "8", "--columns", "256", "--output", tmp_path / "points.png")
    with Image.open(tmp_path / "points.png") as picture:
        colours = picture.getcolors(1 << 20)
    assert colours is not None and 500 < sum(count for count, colour in colours if colour != (16, 18, 24)) < 8192


@pytest.mark.matrix
def test_the_lidar_sees_the_same_by_a_device_in_its_shell(tmp_path: Path, run: Callable[..., str]) -> None:
    pictures = []
    for backend in ("model", "simulated"):
        pictures.append(tmp_path / f"{backend}.png")
        run("lidar", "--beams", "8", "--columns", "256", "--backend", backend, "--output", pictures[-1])
    assert pictures[0].read_bytes() == pictures[1].read_bytes()


@pytest.mark.parametrize("mesh", ("torus:24", pytest.param("rock:20000", marks=pytest.mark.matrix)))
def test_baked_occlusion_is_that_of_embree(tmp_path: Path, run: Callable[..., str], mesh: str) -> None:
    pytest.importorskip("embreex")
    vertices, faces = mesh_of(mesh)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "mesh.glb")
    files = ["--output", tmp_path / "baked.png", "--gltf", tmp_path / "baked.glb"]
    text = run("occlusion", tmp_path / "mesh.glb", "--rays", "32", "--embree", "--traffic", *files)
    found = re.search(r"against Embree: (\d+\.\d) dB", text)
    assert found is not None and float(found[1]) >= 45
    sums = re.findall(r"(\d+\.\d) records, (\d+) B of DRAM", text)
    assert float(sums[0][0]) < float(sums[1][0])
    assert mesh != "rock:20000" or 5 * int(sums[0][1]) < int(sums[1][1])
    baked = trimesh.load_mesh(tmp_path / "baked.glb")
    assert len(np.unique(baked.visual.vertex_colors[:, 0])) > 10
    with Image.open(tmp_path / "baked.png") as picture:
        assert len(picture.getcolors(1 << 20) or ()) > 50
