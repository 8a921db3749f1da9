"""The examples of rays: their hits against double, and their pictures."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
from exact_rays import truth
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


def run(name: str, *arguments: str | Path) -> str:
    command = [sys.executable, FOLDER / f"{name}.py", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


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


def test_the_lidar_draws_its_points(tmp_path: Path) -> None:
    assert "rays hit, 3." in run("lidar", "--beams", "8", "--columns", "256", "--output", tmp_path / "points.png")
    with Image.open(tmp_path / "points.png") as picture:
        colours = picture.getcolors(1 << 20)
    assert colours is not None and 500 < sum(count for count, colour in colours if colour != (16, 18, 24)) < 8192
