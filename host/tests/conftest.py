"""Common fixtures: a manifest of a small configuration that does not need the generator, and the report of an RTL
frame."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings
from one_generator import OneGenerator
from patience import PATIENCE

from colonnade.common import notes, processes
from colonnade.design.manifest import VERSION, Manifest
from colonnade.device import simulator_build

if TYPE_CHECKING:
    from playwright.sync_api import Browser

MakeManifest = Callable[..., Manifest]

# No property depends on the speed of the machine. Every run of `make test` has the same examples, `make verify` others.
settings.register_profile(
    "any machine",
    deadline=None,
    derandomize="COLONNADE_MATRIX" not in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("any machine")


def manifest_data(
    *,
    vertex_bits: int = 16,
    box_bits: int = 7,
    mac: int = 32,
    bvh: bool = True,
    depth: int = 131072,
    stack_depth: int = 48,
    max_width: int = 1920,
    max_height: int = 1080,
) -> dict[str, Any]:
    """The JSON object of a manifest, with numbers by docs/numbers.md."""
    address = (depth - 1).bit_length()
    coordinate = max(max_width, max_height).bit_length()
    numbers = {
        "vertexBits": vertex_bits,
        "boxBits": box_bits,
        "macBits": mac,
        "gridBits": mac,
        "gridFraction": mac - vertex_bits - 3,
        "sceneBits": mac + 8,
        "coordinateBits": coordinate,
        "boxPadLog": 2,
        "normalBits": 12,
        "normalFraction": 11,
        "colourBits": 12,
        "lightBits": 16,
        "lightFraction": 12,
        "mantissaBits": 32,
        "weightBits": min(32, mac - 1),
        "distanceDigits": min(32, mac),
        "etaFraction": 13,
    }
    layouts = _layouts(vertex_bits, box_bits, address)
    widest = max(sum(width for _, width, _ in fields) for fields in layouts.values())
    return {
        "version": VERSION,
        "config": {
            "array": {"rows": 1, "columns": 1, "contexts": 8},
            "units": {"pathContexts": 8, "marches": 1},
            "geometry": {
                "vertexBits": vertex_bits,
                "boxBits": box_bits,
                "bvh": bvh,
                "cornerColours": False,
                "textureBytes": 0,
            },
            "columnBvhMemory": {"depth": depth, "stackDepth": stack_depth, "readLatency": 1, "cache": None},
            "physicalAttributeMemory": None,
            "frame": {
                "maxWidth": max_width,
                "maxHeight": max_height,
                "materials": 2,
                "lights": 2,
                "maxBounces": 4,
                "emission": False,
            },
        },
        "numbers": numbers,
        "records": {"bits": -(-widest // 32) * 32, "layouts": {k: _placed(v) for k, v in layouts.items()}},
        "registers": {"dataBits": 32, "fields": _registers(vertex_bits, mac, address, coordinate)},
        "streams": {"pixel": [], "load": []},
        "memories": {"columnBvh": {"depth": depth, "bits": -(-widest // 32) * 32, "banks": 2}},
        "attributes": None,
        "formatHash": f"{vertex_bits:02x}{box_bits:02x}{mac:02x}{bvh:d}".ljust(64, "0"),
        "configHash": "0" * 64,
    }


FieldList = list[tuple[str, int, bool]]


def _vector(name: str, width: int, signed: bool = False) -> FieldList:
    return [(f"{name}.{axis}", width, signed) for axis in "xyz"]


def _layouts(vertex: int, box: int, address: int) -> dict[str, FieldList]:
    node: FieldList = [("nodes", 3, False), ("leaves", 3, False), ("first", address, False)]
    node += _vector("corner", vertex + 1)
    for child in reversed(range(4)):
        node += [*_vector(f"children[{child}].high", box), *_vector(f"children[{child}].low", box)]
    delta, axes, code = (156 - 3 * vertex) // 9, "xyz", "uv"
    head: FieldList = [("format", 2, False), ("isClear", 1, False), ("material", 8, False)]
    vertices = _bodies("vertices", 4, axes, vertex)
    far = _bodies("normals", 4, code, 10, True) + _bodies("deltas", 3, axes, delta) + vertices[-3:] + head
    near = _bodies("normals", 4, code, 10, True) + _bodies("deltas", 3, axes, delta, True) + vertices[-3:] + head
    return {
        "node": node,
        "nearPair": _bodies("lowBits", 4, code, 1) + near,
        "triangle": _bodies("normals", 3, code, 11, True) + vertices[-9:] + head,
        "flatPair": vertices + head,
        "farPair": _bodies("signs", 3, axes, 1) + far,
    }


def _bodies(name: str, count: int, components: str, width: int, signed: bool = False) -> FieldList:
    """The last one first, so that vertex 0 of all formats is in one place."""
    return [(f"body.{name}[{i}].{c}", width, signed) for i in reversed(range(count)) for c in components]


def _placed(fields: FieldList) -> list[dict[str, Any]]:
    """Fields with offsets, as the generator assigns them: the first field is the most significant."""
    placed, offset = [], 0
    for name, width, signed in reversed(fields):
        placed.append({"name": name, "offset": offset, "width": width, "signed": signed, "fraction": 0})
        offset += width
    return placed


def _registers(vertex: int, mac: int, address: int, coordinate: int) -> list[dict[str, Any]]:
    fields: FieldList = [(f"frame.{n}", coordinate, False) for n in ("width", "height")]
    fields += [(f"frame.objectRect.{n}", coordinate, False) for n in ("x0", "y0", "x1", "y1")]
    for edge in range(6):
        fields += [(f"frame.objectOutline[{edge}].{n}", 12, True) for n in ("x", "y")]
        fields += [(f"frame.objectOutline[{edge}].offset", coordinate + 13, True)]
    fields += [("frame.unitShift", 6, False), ("frame.watchdogCycles", 32, False)]
    for name in ("position", "direction", "stepX", "stepY"):
        fields += _vector(f"camera.{name}", mac, True)
    fields += [("camera.stepShift", 4, False)]
    for light in range(2):
        fields += _vector(f"lights[{light}].position", mac, True)
        fields += [(f"lights[{light}].colour.{c}", 16, False) for c in "rgb"]
        fields += [
            (f"lights[{light}].reachMantissa", 32, False),
            (f"lights[{light}].reachExponent", (2 * mac + 16).bit_length() + 1, True),
        ]
    fields += [("shading.flat", 1, False), ("shading.shadows", 1, False), ("shading.lights", 2, False)]
    fields += [
        ("shading.offset", mac - 2, False),
        ("shading.bounces", 3, False),
        ("shading.shadowTransmittance", 13, False),
    ]
    for name, width in (("ambient", 16), ("background", 12)):
        fields += [(f"{name}.{c}", width, False) for c in "rgb"]
    for i in range(2):
        fields += [(f"materials[{i}].albedo.{c}", 12, False) for c in "rgb"]
        fields += [(f"materials[{i}].{n}", w, False) for n, w in _SHINY]
    fields += _vector("bounds.low", vertex) + _vector("bounds.high", vertex)
    fields += [(f"scene.{n}", address + 1, False) for n in _SCENE]
    placed, word = [], 0
    for name, width, signed in fields:
        words = -(-width // 32)
        placed.append({"name": name, "address": word, "words": words, "width": width, "signed": signed, "access": "rw"})
        word += words
    return placed


_SHINY = (("kind", 2), ("etaFront", 16), ("etaBack", 16), ("reflectance", 13))
_SCENE = ("recordCount", "root")


#: A file with tests of a minute.
LONGEST = "test_starting_pages.py"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest file, so that no worker is left alone with it at the end; skip what needs Verilator.

    Tests of the matrix may take hours.
    """
    items.sort(key=lambda item: item.path.name != LONGEST)
    for item in items:
        if item.get_closest_marker("matrix"):
            item.add_marker(pytest.mark.timeout(0))
    if shutil.which("verilator") is None:
        for item in items:
            if item.get_closest_marker("verilator"):
                item.add_marker(pytest.mark.skip(reason="Verilator is not installed"))


@pytest.fixture
def told() -> Iterator[list[str]]:
    """The notes of a test, each once."""
    lines: list[str] = []
    with notes.opened(lines.append):
        yield lines


@pytest.fixture(autouse=True)
def quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Disable progress lines, which a slow machine would print between the expected lines."""
    monkeypatch.setenv("COLONNADE_PROGRESS", "off")


@pytest.fixture(autouse=True)
def quick_simulators(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Build simulators that are soon compiled, but for tests with the mark `matrix`."""
    if request.node.get_closest_marker("matrix") is None:
        monkeypatch.setenv("COLONNADE_QUICK_SIMULATORS", "1")


@pytest.fixture(autouse=True)
def checked_simulators(monkeypatch: pytest.MonkeyPatch) -> None:
    """Build simulators with the options of a sanitizer where tools/sanitizers names them."""
    if options := os.environ.get("COLONNADE_SIMULATOR_SANITIZER"):
        more = "-CFLAGS", options, "-LDFLAGS", options
        monkeypatch.setattr(simulator_build, "_VERILATOR_OPTIONS", (*simulator_build._VERILATOR_OPTIONS, *more))


@pytest.fixture(scope="session", autouse=True)
def one_generator() -> Iterator[None]:
    """Designs of this process are made by one Java."""
    run = OneGenerator(processes.run)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "run", run)
        yield
    run.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium, if the machine has one."""
    from playwright.sync_api import expect, sync_playwright

    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no Chromium: install it with `apt-get install chromium`")
    expect.set_options(timeout=PATIENCE)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"], timeout=PATIENCE)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def make_manifest() -> MakeManifest:
    """A function that makes a manifest; keywords as in `manifest_data`."""
    return lambda **changes: Manifest.from_dict(manifest_data(**changes))


@pytest.fixture(scope="session")
def manifest(make_manifest: MakeManifest) -> Manifest:
    """The manifest of a small configuration with the default widths."""
    return make_manifest()


@pytest.fixture
def manifest_json() -> dict[str, Any]:
    """The JSON object of the fixture `manifest`."""
    return manifest_data()


SMALL_ARRAY = {
    "array": {"rows": 2, "columns": 3, "contexts": 4},
    "units": {
        "boxLanes": 2,
        "triangleLanes": 1,
        "triangleRows": 1,
        "marches": 1,
        "pathContexts": 8,
        "rayInterval": 32,
        "shadeInterval": 128,
        "extraSlices": False,
    },
    "columnBvhMemory": {"banks": 2, "snooping": True, "readLatency": 1, "cache": None},
}

#: Counters of a frame of 100 cycles on `SMALL_ARRAY`: 600 unit, 300 path unit, 2,400 context, 600 bank and 300 stream
#: cycles.
COUNTERS = {
    "raysPrimary": 150,
    "raysInBox": 50,
    "nodeReads": 150,
    "boxTests": 500,
    "triangleTests": 80,
    "hits": 20,
    "recordReads": 60,
    "snoopHits": 180,
    "busyRaySetup": 30,
    "busyBoxUnit": 480,
    "busyTriangleUnit": 120,
    "busyShader": 3,
    "idleContexts": 240,
    "contextsRaySetup": 480,
    "waitRecord": 120,
    "waitUnit": 60,
    "contextsBox": 1200,
    "contextsTriangles": 120,
    "contextsShading": 60,
}


def frame_report(in_box: float) -> dict[str, Any]:
    """The report of an RTL frame with a given number of in-box rays per cycle."""
    return {
        "config": SMALL_ARRAY,
        "config_hash": "c0",
        "size": [15, 10],
        "mesh": {"triangles": 12},
        "cycles": 100,
        "rays": {"reflection": 7, "shadow": 5, "in_box": 50},
        "counters": COUNTERS,
        "rays_per_cycle": 2 * in_box,
        "rays_per_cycle_in_box": in_box,
        "cycles_per_second": 1000.0,
        "seconds": {"pack": 0.1, "run": 0.2},
    }


@pytest.fixture(scope="session")
def rtl_report() -> Callable[[float], dict[str, Any]]:
    """The function `frame_report`."""
    return frame_report


@pytest.fixture(scope="session")
def valid_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of `hostile.world`, created once."""
    import hostile

    folder = tmp_path_factory.mktemp("innocent")
    hostile.world(folder)
    return folder


@pytest.fixture
def folder(valid_files: Path, tmp_path: Path) -> Path:
    """A copy of the valid files for one test."""
    return Path(shutil.copytree(valid_files, tmp_path / "work"))
