"""Embree's calls, of a library in place of `libembree4`: what a program for Embree 4 gets, filters, threads."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from exact_rays import mesh_of, rays_of
from rays_library import compiled_library, compiled_program

from colonnade.cli.main import cli

pytestmark = pytest.mark.matrix
FOLDER = Path(__file__).parent
#: What Embree answers to each case of `embree_calls.c`.
ANSWERS: dict[str, list[str]] = json.loads((FOLDER / "embree_calls.json").read_text())
#: What the library answers in its place: geometries that it refuses, and cases in which Embree itself crashes.
HERE = {
    "detached": ["0 0 t 5 occluded 1 error 0", "-1 -1 t inf occluded 0 error 0"],
    "refused": ["quads 1 made: error 3", "motion: error 3", "transform: error 3"],
    "small_buffers": ["1 stride: error 2", "too small: error 2", "0 0 t 5 occluded 1 error 0"],
}
INDICES, VERTICES, UINT3, FLOAT3 = 0, 1, 0x5003, 0x9003
NONE = 2**32 - 1
QUERY = np.dtype(
    [
        *(("org", "f4", 3), ("tnear", "f4"), ("dir", "f4", 3), ("time", "f4"), ("tfar", "f4"), ("mask", "u4")),
        *(("id", "u4"), ("flags", "u4"), ("normal", "f4", 3), ("uv", "f4", 2), ("primitive", "u4"), ("mesh", "u4")),
        *(("instance", "u4"),),
    ]
)
SQUARE = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.uint32([[0, 1, 2], [0, 2, 3]])


class FilterArguments(ctypes.Structure):
    _fields_ = [
        ("valid", ctypes.POINTER(ctypes.c_int)),
        ("user", ctypes.c_void_p),
        ("context", ctypes.c_void_p),
        ("ray", ctypes.POINTER(ctypes.c_float)),
        ("hit", ctypes.POINTER(ctypes.c_uint32)),
        ("count", ctypes.c_uint),
    ]


FILTER = ctypes.CFUNCTYPE(None, ctypes.POINTER(FilterArguments))


class Embree:
    """A device with one scene; `call` has addresses as numbers."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self._geometries: list[int] = []
        self.device = self.call("rtcNewDevice", None)
        self.scene = self.call("rtcNewScene", self.device)

    def call(self, name: str, *arguments: object) -> int:
        function = getattr(self._library, name)
        function.restype = ctypes.c_void_p
        return int(function(*(ctypes.c_void_p(each) if isinstance(each, int) else each for each in arguments)) or 0)

    def error(self) -> int:
        return self.call("rtcGetDeviceError", self.device)

    def buffer(self, geometry: int, kind: int, form: int, array: np.ndarray, slot: int = 0) -> None:
        stride, count = array.strides[0], len(array)
        self.call("rtcSetSharedGeometryBuffer", geometry, kind, slot, form, array.ctypes.data, 0, stride, count)

    def add(self, vertices: np.ndarray, faces: np.ndarray) -> int:
        """A mesh, whose arrays stay where they are; `commit` after it."""
        geometry = self.call("rtcNewGeometry", self.device, 0)
        self.buffer(geometry, VERTICES, FLOAT3, vertices)
        self.buffer(geometry, INDICES, UINT3, faces)
        self.call("rtcAttachGeometry", self.scene, geometry)
        self._geometries.append(geometry)
        return geometry

    def commit(self) -> None:
        """Commit geometries and scene."""
        for geometry in self._geometries:
            self.call("rtcCommitGeometry", geometry)
        self.call("rtcCommitScene", self.scene)
        assert self.error() == 0

    def hits(self, rays: np.ndarray, call: str = "rtcIntersect1") -> np.ndarray:
        queries = queries_of(rays)
        for i in range(len(queries)):
            self.call(call, self.scene, queries[i : i + 1].ctypes.data, None)
        assert self.error() == 0
        return queries

    def packet_hits(self, rays: np.ndarray) -> np.ndarray:
        """Hits of rays, a multiple of 16."""
        words, valid = queries_of(rays).view(np.uint32).reshape(-1, 16, 20), np.full(16, -1, np.int32)
        for i in range(len(words)):
            packet = np.ascontiguousarray(words[i].T)
            self.call("rtcIntersect16", valid.ctypes.data, self.scene, packet.ctypes.data, None)
            words[i] = packet.T
        assert self.error() == 0
        return words.reshape(-1).view(QUERY)


def queries_of(rays: np.ndarray) -> np.ndarray:
    queries = np.zeros(len(rays), dtype=QUERY)
    queries["org"], queries["dir"], queries["tfar"], queries["mask"] = rays[:, :3], rays[:, 4:7], np.inf, NONE
    queries["mesh"] = NONE
    return queries


@pytest.fixture(scope="module")
def library_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled_library(tmp_path_factory.mktemp("embree"))


@pytest.fixture(scope="module")
def library(library_file: Path) -> ctypes.CDLL:
    return ctypes.CDLL(str(library_file))


@pytest.fixture(scope="module")
def program(library_file: Path) -> Path:
    return compiled_program(FOLDER / "embree_calls.c", library_file)


def answers_of(program: Path, *words: str, library: Path | None = None) -> list[str]:
    """Lines of a case of the program, by default of the library that it is linked with."""
    variables = os.environ | ({"LD_PRELOAD": str(library)} if library else {})
    done = subprocess.run([program, *words], env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_library_has_all_names_of_embree(library_file: Path, program: Path) -> None:
    """And no other ones with its prefix; none of them crashes on null handles."""
    names = (FOLDER / "embree_names.txt").read_text().split()
    table = subprocess.run(["nm", "-D", "--defined-only", library_file], capture_output=True, text=True, check=True)
    words = (line.split()[-1] for line in table.stdout.splitlines())
    assert sorted(word for word in words if word.startswith("rtc")) == sorted(names)
    assert answers_of(program, "nulls", *names) == ["done"]


@pytest.mark.parametrize("case", sorted(ANSWERS | HERE))
def test_a_program_gets_what_embree_gives(case: str, program: Path) -> None:
    assert answers_of(program, case) == HERE.get(case, ANSWERS.get(case))


@pytest.mark.skipif("COLONNADE_SANITIZER" in os.environ, reason="Embree is not compiled with the sanitizer")
@pytest.mark.parametrize("case", sorted(ANSWERS))
def test_embree_gives_what_is_recorded(case: str, program: Path) -> None:
    embreex = importlib.util.find_spec("embreex")
    found = [*Path(embreex.origin).parents[1].glob("embreex.libs/libembree4*")] if embreex and embreex.origin else []
    if not found:
        pytest.skip("embreex has no Embree of its own here")
    assert answers_of(program, case, library=found[0]) == ANSWERS[case]


def test_the_command_compiles_the_library(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["rays", "--library", str(tmp_path / "new")])
    file = tmp_path / "new" / "libembree4.so.4"
    assert done.stdout.splitlines() == [str(file), f"LD_PRELOAD={file} PROGRAM"]
    assert (tmp_path / "new" / "libembree4.so").resolve() == file
    assert ctypes.CDLL(str(file)).rtcNewDevice(None) != 0


def test_a_filter_refuses_hits_and_those_behind_them_count(library: ctypes.CDLL) -> None:
    embree, seen = Embree(library), []

    @FILTER
    def refuse(call: ctypes._Pointer[FilterArguments]) -> None:
        seen.append((call.contents.user, call.contents.ray[8], call.contents.hit[5], call.contents.count))
        call.contents.valid[0] = 0

    above = SQUARE[0] + np.float32([0, 0, 1])
    filtered = embree.add(above, SQUARE[1])
    embree.add(*SQUARE)
    embree.call("rtcSetGeometryUserData", filtered, 123)
    for name in ("rtcSetGeometryIntersectFilterFunction", "rtcSetGeometryOccludedFilterFunction"):
        embree.call(name, filtered, refuse)
    embree.commit()
    down = np.array([[0.7, 0.2, 3, 0, 0, 0, -1], [0.2, 0.7, 3, 0, 0, 0, -1]])
    hits = embree.hits(down)
    assert hits["mesh"].tolist() == [1, 1] and hits["tfar"].tolist() == [3, 3] and hits["primitive"].tolist() == [0, 1]
    assert seen == [(123, 2.0, 0, 1), (123, 2.0, 1, 1)]
    assert embree.hits(down, "rtcOccluded1")["tfar"].tolist() == [-np.inf, -np.inf]
    embree.call("rtcDetachGeometry", embree.scene, 1)
    embree.commit()
    assert embree.hits(down)["mesh"].tolist() == [NONE, NONE]
    assert embree.hits(down, "rtcOccluded1")["tfar"].tolist() == [np.inf, np.inf]


def test_a_packet_has_the_hits_of_its_rays(library: ctypes.CDLL) -> None:
    """Rays of two masks, in any order, and such without an interval."""
    embree, random = Embree(library), np.random.default_rng(3)
    above = SQUARE[0] + np.float32([0, 0, 1])
    for mask, vertices in ((1, SQUARE[0]), (2, above)):
        embree.call("rtcSetGeometryMask", embree.add(vertices, SQUARE[1]), mask)
    embree.commit()
    queries = queries_of(rays_of(random.uniform(-0.2, 1.2, (160, 3)) * [1, 1, 0] + [0, 0, 3], [[0, 0, -1]] * 160))
    queries["mask"] = random.choice([1, 2, 3], 160)
    queries["tfar"][::7] = -1
    for one, packet in (("rtcIntersect1", "rtcIntersect16"), ("rtcOccluded1", "rtcOccluded16")):
        wanted, words = queries.copy(), queries.copy().view(np.uint32).reshape(-1, 16, 20)
        for i in range(len(wanted)):
            embree.call(one, embree.scene, wanted[i : i + 1].ctypes.data, None)
        for i in range(len(words)):
            lanes = np.ascontiguousarray(words[i].T)
            embree.call(packet, np.full(16, -1, np.int32).ctypes.data, embree.scene, lanes.ctypes.data, None)
            words[i] = lanes.T
        assert words.tobytes() == wanted.tobytes()
        assert len(set(wanted["tfar"].tolist())) == (4 if one == "rtcIntersect1" else 3)


def test_rays_of_several_threads_have_their_own_hits(library: ctypes.CDLL) -> None:
    """Rays along vertices: which faces are neighbours is found out at the first of them."""
    vertices, faces = mesh_of("sphere:5")
    corners, triangles = vertices.astype(np.float32), faces.astype(np.uint32)
    rays = rays_of(3 * vertices[:1600], -vertices[:1600])
    for _ in range(8):
        embree = Embree(library)
        embree.add(corners, triangles)
        embree.commit()
        with ThreadPoolExecutor(4) as pool:
            for hits in pool.map(embree.packet_hits, [rays] * 4):
                np.testing.assert_allclose(hits["tfar"], 2, atol=1e-3)
