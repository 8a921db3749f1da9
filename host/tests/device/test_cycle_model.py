"""The cycle model against recorded counters of the RTL, and what must hold whatever its constants."""

from __future__ import annotations

import json
import re
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from colonnade.common.errors import UserError
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.device.cycle_model import NotedFrame, bounce_cycles, design_values
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

ROOT = Path(__file__).parents[3]
#: Fields of a design that the cycle model takes: the least and the greatest value.
RANGES = {
    "array.rows": (1, 31),
    "array.columns": (1, 32),
    "array.contexts": (1, 16),
    "units.boxLanes": (1, 4),
    "units.triangleLanes": (1, 4),
    "units.triangleRows": (1, 16),
    "units.pathContexts": (1, 256),
    "units.marches": (1, 16),
    "columnBvhMemory.banks": (1, 4),
    "columnBvhMemory.recordBuffers": (1, 8),
    "columnBvhMemory.readLatency": (1, 16),
}
#: Largest error for the teapot; that of other frames is in docs/cycles.md.
BOUND = 0.01
SIZE = (160, 120)


def manifest_of(*overrides: str, config: str = "edge") -> Manifest:
    return manifest_for(config, overrides).manifest


@cache
def prepared(config: str, *overrides: str) -> DeviceScene:
    return DeviceScene.of(
        load_scene(ROOT / "scenes" / "object.toml").with_mesh("teapot"), manifest_of(*overrides, config=config)
    )


@cache
def noted(config: str = "edge", size: tuple[int, int] = SIZE) -> NotedFrame:
    scene = prepared(config)
    return NotedFrame.of(scene.manifest, scene.image, scene.registers(size))


def test_counters_without_time_are_those_of_the_model() -> None:
    """The simulated units count them themselves: every ray, node and triangle goes through a unit."""
    for config in ("edge", "small", "tiny"):
        scene, frame = prepared(config), noted(config, (64, 48))
        registers = scene.registers((64, 48))
        model = render_model(scene.manifest, scene.image, registers).counters
        counted = frame.model.cycles(design_values(scene.manifest, frame.record_bytes), 100, 1)
        assert frame.counters == model
        assert {name: counted[name] for name in ("raysInBox", "nodeReads", "triangleTests")} == {
            name: model[name] for name in ("raysInBox", "nodeReads", "triangleTests")
        }
        assert counted["busyBoxUnit"] == model["nodeReads"] * 4 // scene.manifest.config["units"]["boxLanes"]


@pytest.mark.parametrize("name", ["base", "rows=5", "columns=1", "contexts=6", "pathContexts=80", "banks=2"])
def test_cycles_are_those_of_the_rtl(name: str) -> None:
    """Of the teapot in the study of scaling, by each field alone."""
    study = json.loads((ROOT / "docs" / "data" / "scaling.json").read_text())["result"]
    (point,) = [point for point in study["points"] if point["name"] == name]
    found = noted(size=(320, 240)).cycles(manifest_of(*point["overrides"]))["cycles"]
    assert found == pytest.approx(point["workloads"]["teapot"]["cycles"], rel=BOUND)


def test_time_in_units_is_that_of_the_rtl() -> None:
    """Of the benchmark's teapot. No arbiter adds to it, so it is nearer than the cycles."""
    rtl = json.loads((ROOT / "docs" / "data" / "bench-edge.json").read_text())["result"]["meshes"]["teapot"]["counters"]
    found = noted(size=(640, 480)).cycles(manifest_of())
    for counter in ("contextsBox", "contextsTriangles", "contextsShading", "busyBoxUnit", "busyShader"):
        assert found[counter] == pytest.approx(rtl[counter], rel=0.003), counter


def test_the_same_frame_takes_the_same_cycles() -> None:
    assert noted().cycles(manifest_of()) == noted().cycles(manifest_of())


def test_more_of_anything_takes_no_more_cycles() -> None:
    """But for the noise of arbitration, some per cent."""
    frame = noted()
    rows = [frame.cycles(manifest_of(f"array.rows={rows}"))["cycles"] for rows in (2, 5, 10)]
    columns = [frame.cycles(manifest_of(f"array.columns={columns}"))["cycles"] for columns in (1, 2, 4)]
    latencies = [frame.cycles(manifest_of(), latency)["cycles"] for latency in (1000, 300, 100, 10)]
    for found in (rows, columns, latencies):
        assert all(more < 1.02 * fewer for fewer, more in pairwise(found)), found
    assert rows[0] > 2 * rows[2] and columns[0] > 3 * columns[2] and latencies[0] > 1.5 * latencies[3]


def test_dram_matters_only_behind_a_cache() -> None:
    own = manifest_of("columnBvhMemory.cache=null", "columnBvhMemory.depth=131072")
    counters = noted().cycles(own, 1000)
    assert counters == noted().cycles(own, 10) and "dramReads" not in counters


@pytest.mark.parametrize("config", ("edge", "tiny"))
def test_designs_at_both_ends_of_all_fields_count_the_same_work(config: str) -> None:
    """Each field alone, then all: no queue of the model is too short. `tools/sanitizers` has its assertions."""
    frame, manifest = noted(config, (40, 30)), prepared(config).manifest
    own = design_values(manifest, frame.record_bytes)
    ends = [{name: end} for name, both in RANGES.items() for end in both]
    ends += [{name: both[i] for name, both in RANGES.items()} for i in (0, 1)]
    for values in ends:
        counted = frame.model.cycles(own | values, 100, 1)
        for name in ("raysInBox", "nodeReads", "triangleTests"):
            assert counted[name] == frame.counters[name], (values, name)


def test_bounces_take_as_long_as_in_the_rtl() -> None:
    """The page has the latencies that `BounceUnitSpec` holds, of hits without a restart."""
    page = " ".join((ROOT / "docs" / "shading.md").read_text().split())
    pattern = (
        r"(\d+) for a mirror, (\d+) for a total reflection, (\d+) for glass from behind, (\d+) to \d+ from the front"
    )
    found = re.search(pattern, page)
    assert found is not None
    said = dict(zip(("mirror", "totalReflection", "behind", "front"), map(int, found.groups()), strict=True))
    derived = bounce_cycles(manifest_of(config="tiny"))
    assert derived == said
    # Longer roots and quotients make glass slower, but no mirror
    lean = bounce_cycles(manifest_of("precision=24b24s32d", config="tiny"))
    assert lean["mirror"] == derived["mirror"] and lean["behind"] < derived["behind"]


def test_columns_that_share_maps_wait_for_each_other() -> None:
    """Marches and directly seen pixels ask for cells; a copy of the maps answers one request a cycle."""
    room = load_scene(ROOT / "scenes" / "room.toml").with_samples(1)
    own = DeviceScene.of(room, manifest_of(), size=SIZE)
    frame = NotedFrame.of(own.manifest, own.image, own.registers(SIZE))
    busy = [
        frame.cycles(manifest_of(f"physicalAttributeMemory.columnsPerCopy={columns}"))["busyEnvironment"]
        for columns in (2, 8)
    ]
    assert 1.01 * busy[0] < busy[1]


def test_designs_that_are_not_modelled_are_one_line() -> None:
    with pytest.raises(UserError, match=r"array.rows = 64: the cycle model takes at most 31"):
        noted().cycles(manifest_of("array.rows=64"))
