"""Embree's calls, of a library in place of `libembree4`: filters, threads, and what it refuses."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from exact_rays import mesh_of, rays_of
from rays_library import compiled_library

from colonnade.design.generator import manifest_for
from colonnade.rays.scene import design_text

pytestmark = pytest.mark.matrix
INDICES, VERTICES, UINT3, FLOAT3 = 0, 1, 0x5003, 0x9003
INVALID_ARGUMENT, INVALID_OPERATION, NONE = 2, 3, 2**32 - 1
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
        """A mesh, whose arrays stay where they are; call `rtcCommitScene` after it."""
        geometry = self.call("rtcNewGeometry", self.device, 0)
        self.buffer(geometry, VERTICES, FLOAT3, vertices)
        self.buffer(geometry, INDICES, UINT3, faces)
        self.call("rtcAttachGeometry", self.scene, geometry)
        return geometry

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
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ctypes.CDLL]:
    folder = tmp_path_factory.mktemp("embree")
    output = compiled_library(folder)
    (folder / "design").write_text(design_text(manifest_for("edge", ()).manifest))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLONNADE_RAYS_DESIGN", str(folder / "design"))
        yield ctypes.CDLL(str(output))


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
    embree.call("rtcCommitScene", embree.scene)
    down = np.array([[0.7, 0.2, 3, 0, 0, 0, -1], [0.2, 0.7, 3, 0, 0, 0, -1]])
    hits = embree.hits(down)
    assert hits["mesh"].tolist() == [1, 1] and hits["tfar"].tolist() == [3, 3] and hits["primitive"].tolist() == [0, 1]
    assert seen == [(123, 2.0, 0, 1), (123, 2.0, 1, 1)]
    assert embree.hits(down, "rtcOccluded1")["tfar"].tolist() == [-np.inf, -np.inf]
    embree.call("rtcDetachGeometry", embree.scene, 1)
    embree.call("rtcCommitScene", embree.scene)
    assert embree.hits(down)["mesh"].tolist() == [NONE, NONE]
    assert embree.hits(down, "rtcOccluded1")["tfar"].tolist() == [np.inf, np.inf]


def test_a_packet_has_the_hits_of_its_rays(library: ctypes.CDLL) -> None:
    """Rays of two masks, in any order, and such without an interval."""
    embree, random = Embree(library), np.random.default_rng(3)
    above = SQUARE[0] + np.float32([0, 0, 1])
    for mask, vertices in ((1, SQUARE[0]), (2, above)):
        embree.call("rtcSetGeometryMask", embree.add(vertices, SQUARE[1]), mask)
    embree.call("rtcCommitScene", embree.scene)
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
        embree.call("rtcCommitScene", embree.scene)
        with ThreadPoolExecutor(4) as pool:
            for hits in pool.map(embree.packet_hits, [rays] * 4):
                np.testing.assert_allclose(hits["tfar"], 2, atol=1e-3)


def test_what_is_no_triangle_at_rest_is_refused(library: ctypes.CDLL) -> None:
    embree = Embree(library)
    geometry = embree.add(*SQUARE)
    assert embree.error() == 0
    embree.buffer(geometry, VERTICES, FLOAT3, SQUARE[0] + 1, slot=1)
    assert embree.error() == INVALID_OPERATION
    embree.buffer(geometry, INDICES, UINT3 + 1, np.zeros((1, 4), np.uint32))
    assert embree.error() == INVALID_ARGUMENT
    embree.call("rtcSetGeometryTimeStepCount", geometry, 2)
    assert embree.error() == INVALID_OPERATION
    assert embree.call("rtcNewGeometry", embree.device, 1) == 0 and embree.error() == INVALID_OPERATION
    assert embree.call("rtcGetGeometryBufferData", geometry, VERTICES, 0) == SQUARE[0].ctypes.data
    assert embree.call("rtcGetGeometry", embree.scene, 7) == 0
