"""The library of rays in C on the simulated device, which the environment names."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from exact_rays import mesh_of, outside_rays
from rays_library import compiled_library, preloaded

from colonnade.design.generator import manifest_for
from colonnade.rays import Scene
from colonnade.rays.device import device_text, registers_text
from colonnade.rays.scene import ALL_MASKS, design_text

pytestmark = pytest.mark.matrix
DESIGN = "tiny", ('queries={"contexts":256}', "units.rayInterval=1")
HIT = np.dtype([("t", "f8"), ("uv", "f8", 2), ("mesh", "u4"), ("face", "u4"), ("flags", "u4"), ("ray", "u4")])

#: Two commits of a triangle, in a process that SIGPIPE would end; prints the statuses of its calls.
_COMMITS = """
import ctypes, signal, sys
signal.signal(signal.SIGPIPE, signal.SIG_DFL)
library, device, scene, mesh = ctypes.CDLL(sys.argv[1]), ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_uint32()
print(library.colonnade_rays_open_environment(ctypes.byref(device)))
if device:
    library.colonnade_rays_scene_new(device, ctypes.byref(scene))
    vertices, faces = (ctypes.c_double * 9)(0, 0, 0, 1, 0, 0, 0, 1, 0), (ctypes.c_uint32 * 3)(0, 1, 2)
    library.colonnade_rays_mesh_add(scene, vertices, ctypes.c_size_t(3), faces, ctypes.c_size_t(1), ctypes.byref(mesh))
    print(*(library.colonnade_rays_commit(scene) for _ in range(2)))
    library.colonnade_rays_scene_free(scene)
    library.colonnade_rays_close(device)
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled_library(tmp_path_factory.mktemp("library"))


def environment(folder: Path, device: str | None) -> dict[str, str]:
    """Variables that name the design's file, and a device's."""
    texts = {"DESIGN": design_text(manifest_for(*DESIGN).manifest)} | ({} if device is None else {"DEVICE": device})
    for name, text in texts.items():
        (folder / name).write_text(text)
    return {f"COLONNADE_RAYS_{name}": str(folder / name) for name in texts}


def test_hits_and_counters_of_the_device_are_those_of_the_model(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, faces = mesh_of("torus")
    rays = outside_rays(vertices, 300, seed=6)
    model = Scene(vertices, faces, *DESIGN)
    wanted = model.closest(rays)
    counted, is_occluded = model.counters(), model.occluded(rays)
    for name, value in environment(tmp_path, device_text(*DESIGN, ("--dram", "7", "--random", "20"))).items():
        monkeypatch.setenv(name, value)
    calls, device, scene, mesh = ctypes.CDLL(str(library)), ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_uint32()
    corners, triangles = np.ascontiguousarray(vertices), faces.astype(np.uint32)
    hits, found, sums = np.zeros(len(rays), HIT), np.zeros(len(rays), np.uint8), np.zeros(7, np.uint64)

    def of(array: np.ndarray) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    def call(name: str, *arguments: object) -> None:
        words = [ctypes.c_size_t(each) if isinstance(each, int) else each for each in arguments]
        assert getattr(calls, f"colonnade_rays_{name}")(*words) == 0

    call("open_environment", ctypes.byref(device))
    call("scene_new", device, ctypes.byref(scene))
    call("mesh_add", scene, of(corners), len(corners), of(triangles), len(triangles), ctypes.byref(mesh))
    for _ in range(2):
        call("commit", scene)
        call("closest", scene, of(rays), len(rays), 0, ALL_MASKS, of(hits))
        assert (hits["t"] == wanted.t).all() and (hits["face"].astype(np.int32) == wanted.face).all()
    calls.colonnade_rays_counters(device, of(sums))
    call("occluded", scene, of(rays), len(rays), 0, ALL_MASKS, of(found))
    assert (found == is_occluded).all() and 0 < found.sum() < len(found)
    calls.colonnade_rays_scene_free(scene)
    calls.colonnade_rays_close(device)
    assert sums[:2].tolist() == [2 * counted["rays"], 2 * counted["raysRefused"]]


@pytest.mark.parametrize(
    ("device", "statuses", "error"),
    (
        (None, ["0", "0 0"], ""),
        (
            "program {}\nregister a 0 1 0 rw\n",
            ["0", "7 7"],
            "rays: the device has no register bounds.high.x",
        ),
        ("program {}\n{registers}", ["0", "7 7"], "rays: the simulated hardware failed: harness: no power"),
        ("program {}.none\n", ["1"], "COLONNADE_RAYS_DEVICE: {}.none: No such file or directory"),
        ("register a 0 1 0 rw\n", ["1"], "COLONNADE_RAYS_DEVICE: its first line names no program"),
        ("", ["1"], "COLONNADE_RAYS_DEVICE: it is empty"),
        ("program {}\nregister a\n", ["1"], "COLONNADE_RAYS_DEVICE: this line is no register: register a"),
    ),
    ids=("model", "no register", "program that fails", "no program", "no program line", "nothing", "half a register"),
)
def test_a_failure_is_one_line(
    library: Path, tmp_path: Path, device: str | None, statuses: list[str], error: str
) -> None:
    program = tmp_path / "a program"
    program.write_text("#!/bin/sh\necho 'harness: no power' >&2\nexit 3\n")
    program.chmod(0o755)
    registers = registers_text(manifest_for(*DESIGN).manifest.registers)
    variables = environment(tmp_path, None if device is None else device.format(program, registers=registers))
    command = [sys.executable, "-c", _COMMITS, library]
    done = subprocess.run(command, env=variables | preloaded(), capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == statuses
    assert done.stderr == (f"colonnade: error: {error.format(program)}\n" if error else "")
