"""The tables of ``docs/rays.md``: tests of other projects that pass, and rays a second of model, Embree and device."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from colonnade_lab.common.markdown import markdown
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.facts import AREA, MEGAHERTZ
from colonnade_lab.ppa.power.sums import KINDS

_TITLES = {
    "trimesh": "trimesh `test_ray.py`, `test_ray_upstream.py`, by ",
    "three-mesh-bvh": "three-mesh-bvh `RandomRaycasts`: every hit of every ray equal as floats",
    "embree": "Embree `embree_verify`: ",
    "libigl": "libigl `tests/include/igl/embree`: ",
    "vcglib": "vcglib `apps/embree`, parts that end on the bunny: ",
}


def suites(data: Data) -> str:
    """Tests of other projects: how many pass on the model and on the device, by bits of a coordinate."""
    heads: dict[str, list[str]] = {}
    passed: dict[tuple[str, str, int], str] = {}
    device = data.get("ray-suites-device")
    tests = {"model": data.result("ray-suites")["suites"], "device": device["result"]["suites"] if device else ()}
    for answering, found in tests.items():
        for each in found:
            title = _TITLES[each["suite"]] + (each["test"] and f"`{each['test']}`")
            heads.setdefault(title, [title, f"`{each['revision'][:10]}`"])
            passed[title, answering, each["vertexBits"]] = f"{each['passed']:,} of {each['tests']:,}"
    columns = [(answering, bits) for answering in tests for bits in (16, 24)]
    rows = [[*head, *(passed.get((title, *column), "–") for column in columns)] for title, head in heads.items()]
    return markdown(["suite", "commit", "model, 16 bits", "24 bits", "device, 16 bits", "24 bits"], rows)


def rates(data: Data) -> str:
    """Rays a second, and what one reads, by kind of rays."""
    result = data.result("ray-rates")
    rows = [
        [
            each["kind"],
            f"{each['hits']:,}, {_number(each['embree_hits'])}",
            _number(each["model"], 1000),
            _number(each["embree"], 1000),
            *(f"{each[name]:.1f}" for name in ("node_reads", "triangle_tests")),
            f"{each['dram_bytes']:,.0f}",
        ]
        for each in result["kinds"]
    ]
    titles = [f"rays, {result['rays']:,} of each kind", "hits: model, Embree", "model, 1,000 rays a second", "Embree"]
    return markdown([*titles, "nodes a ray", "triangles", "bytes of DRAM"], rows)


def device(data: Data) -> str:
    """Rays a cycle of the simulated `traversal` by kind, those a second for its area, and the energy of a ray."""
    result, area = data.result("ray-device"), data.result(AREA.format("traversal"))
    mm2, batches = area["levels"]["array"]["mm2_28nm"], {each["scene"]["kind"]: each for each in area["batches"]}
    rows = [
        [
            each["kind"],
            *(f"{each[name]:.1f}" for name in ("node_reads", "triangle_tests")),
            f"{each['rays_per_cycle']:.2f}",
            f"{each['rays_per_cycle'] * MEGAHERTZ:,.0f}",
            f"{each['rays_per_cycle'] * MEGAHERTZ / mm2:,.0f}",
            ", ".join(f"{batches[each['kind']][kind]['at_28nm']['energy_per_any_ray_nj']:.2f}" for kind in KINDS),
        ]
        for each in result["kinds"]
    ]
    titles = [f"rays, {result['rays']:,} of each kind", "nodes a ray", "triangles", "rays a cycle"]
    titles += [f"MRay/s at {MEGAHERTZ:g} MHz", f"a mm² at 28 nm, of {mm2:.2f}"]
    return markdown([*titles, "nJ a ray without glitches, with"], rows)


def _number(value: float | None, unit: int = 1) -> str:
    return "–" if value is None else f"{value / unit:,.0f}"


TABLES: Mapping[str, Callable[[Data], str]] = {"ray-suites": suites, "ray-rates": rates, "ray-device": device}
