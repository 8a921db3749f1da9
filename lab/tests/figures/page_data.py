"""A result for every data file of the pages."""

from __future__ import annotations

from typing import Any

from colonnade_lab.evaluation.bench import design_result, mesh_result
from colonnade_lab.explore.cycle_errors import PARTS
from colonnade_lab.figures.catalog import MARCHES, SAMPLES
from colonnade_lab.ppa.power.sums import KINDS

PATH = {"ns": 1.0, "fo4": 50.0, "from": "a", "to": "b", "gates": 9}
ENERGY = {"energy_per_ray_nj": 0.5, "at_28nm": {"energy_per_ray_nj": 2.0}}
POWER = dict.fromkeys((f"{kind}_mw" for kind in ("dynamic", "clock", "leakage", "memory", "total")), 2.5) | ENERGY


def area() -> dict[str, Any]:
    """A report of an array of two columns of three rows; its slowest path takes 0.7 ns, and it has twice the chip."""
    unit = {"count": 1, "kge": 30.0, "share": 1.0, "flops": 7, "paths": {"register_to_register": PATH}}
    level = {
        "kge": 60.0,
        "logic_kge": 40.0,
        "logic_um2": 5e6,
        "memory_bits": 9000,
        "logic_mm2_28nm": 0.5,
        "mm2_28nm": 11.06,
    }
    memory = {"unit": "BoxUnit", "count": 2, "depth": 128, "width": 80, "bits": 20_480, "um2": {"28 nm": 1e3}}
    return {
        "technology": {
            "liberty": ["cells"],
            "um2_per_gate": 0.5,
            "fo4_ns": 0.02,
            "fo4": "an inverter",
            "delay_target_ns": 1.2,
        },
        "chip": {"mm2": 5.53},
        "units": {
            "BoxUnit": unit
            | {"level": "traversal_unit", "energy_per_ray_nj_at_28nm": {"zero_delay": 1, "glitch_aware": 2}},
            "PathUnit": unit | {"level": "column"},
        },
        "memories": {"words": memory | {"level": "traversal_unit"}, "few": memory | {"level": "array", "bits": 10}},
        "levels": {
            "traversal_unit": level | {"of_the_level_below": 0},
            "column": level | {"of_the_level_below": 3},
            "array": level | {"of_the_level_below": 2},
        },
        "slowest_path": PATH | {"unit": "BoxUnit"},
        "traversal_unit_paths": {"register_to_register": PATH},
        "power": {
            "volts": 0.7,
            "clock_mhz": 200,
            "scene": {"mesh": "teapot", "size": [24, 18]},
            "window": {"cycles": 1000, "rays_in_box": 7, "rays_traced": 3},
            "scale_to_28nm": 4.79,
            "zero_delay": POWER,
            "glitch_aware": POWER,
        },
        "batches": [
            {"scene": {"kind": kind}, **{key: {"at_28nm": {"energy_per_any_ray_nj": 1.5}} for key in KINDS}}
            for kind in ("near", "from around, shuffled, hits")
        ],
    }


def study(axes: list[dict[str, Any]], rates: list[float], **more: Any) -> dict[str, Any]:
    """A study of a base of one in-box ray per cycle and of points."""

    def point(values: dict[str, Any], rate: float) -> dict[str, Any]:
        frame = {"rays_per_cycle_in_box": rate, "dists_baseline": 0.001, "psnr": 50.0}
        keys = (
            "dists",
            "dists_loss",
            "dists_loss_max",
            "psnr_min",
            "rays_per_cycle",
            "array_kge.asap7",
            "fo4.asap7",
            "mw.asap7",
            "nj_28nm.asap7",
        )
        figures = dict.fromkeys((*keys, "nj.asap7", "render_index.asap7", "area_per_rate.asap7"), rate)
        name = ", ".join(map(str, values.values())) or "base"
        return {
            "name": name,
            "values": values,
            "workloads": {mesh: frame for mesh in ("bunny", "teapot")},
            "figures": figures | {"energy_area.asap7": rate},
            "on_front": rate > 1,
        }

    points = [point({}, 1.0), *(point(values, rate) for values, rate in zip(axes, rates, strict=True))]
    return {"points": points, "libraries": ["asap7"], "baseline": "base", **more}


def room(name: str) -> dict[str, Any]:
    picture = {"psnr": 30.0, "ssim": 0.9, "flip": 0.05, "dists": 0.05}
    maps = {"bytes": {"albedo": 16384}, "ratio": {"albedo": 56.25}, "albedo": picture, "relit": picture}
    return maps | {"room": name, "normals": {"mean_degrees": 1.5}, "planes": {"mean_cm": 0.1, "p95_cm": 0.3}}


def maps(dists: float | None) -> dict[str, Any]:
    return {"dists": dists, "psnr": 30.0, "degrees": 1.25, "off": 0.005, "mirror": 0.9784}


def captured(noise: float | None) -> dict[str, Any]:
    return {
        "noise": noise,
        "estimated": 0.0048,
        "degrees": 7.8,
        "rays": 1234,
        "depth": 0.9,
        "planes": 0.95,
        "device": 0.94,
    }


def results(report: dict[str, Any]) -> dict[str, Any]:
    """By the name of the file, from a report of a frame."""
    meshes = {name: mesh_result(report) for name in ("bunny", "teapot")}
    in_dram = {name: mesh | {"per_ray": mesh["per_ray"] | {"dram_bytes": 77.0}} for name, mesh in meshes.items()}
    bench = design_result(report["config"], "c0", (15, 10), in_dram)
    fidelity = {"hit_disagreement": 1e-5, "triangle_disagreement": 0.001, "psnr": 50.0}
    reference = {"triangles": 12, "reference": fidelity}
    same = {"rtl": {"pixels": 0, "triangles": 1, "counters": 0}}
    kinds = [(contexts, snooping) for contexts in (4, 12) for snooping in (False, True)]
    keys = ("array.contexts", "columnBvhMemory.snooping", "columnBvhMemory.banks")
    index = {"rows": [{"name": "32b32s64d", "index": 0.5}]}
    with_maps = area()
    with_maps["units"] = {"ColumnEnvironment": {"kge": 12.5}}
    with_maps["memories"] = {"seeds": {"unit": "ColumnEnvironment", "bits": 16384}}
    counted = {"frames": [{"design": "edge", "name": "bunny", "model": 99, "rtl": 100}]}
    return {
        "cycles": dict.fromkeys(PARTS, counted),
        "area-small-asap7": with_maps,
        "bench-edge": bench | {"mirror": bench},
        "bench-fpga": bench | {"mirror": None},
        "bench-large": {part: bench for part in ("latency", "banks")},
        "area-edge-asap7": area(),
        "area-traversal-asap7": area(),
        "area-edge-sky130": area(),
        "quality-edge": {"meshes": {"bunny": reference}},
        "quality-lean": {"meshes": {"bunny": reference}},
        "equality-small": {"meshes": {"bunny": same, "teapot": same}},
        "rooms": {
            "size": [64, 48],
            "frames": [{"room": "r", "object": "o", "cycles": 100_000, "differing_pixels": 0}],
            "mean_cycles": 1e5,
        },
        "moved-rooms": {
            "size": [64, 48],
            "frames": [
                {"room": "r", "object": "o", "cycles": cycles, "marched": share, "differing_pixels": 0}
                for share, cycles in ((0.0, 10_000), (0.947, 200_000))
            ],
        },
        "gather": {
            "area": area() | {"levels": {"array": {"kge": area()["levels"]["array"]["kge"] + 6.0}}},
            "pass": {"counters": {"cycles": 50_000, "raysGather": 900}},
            "whole": {"counters": {"cycles": 90_000, "raysGather": 1900}},
            "compare": {"psnr": 48.0},
        },
        "light": {
            "frames": {
                "frames": {
                    "r-rough": compared("matt", "metal"),
                    "r-clear": compared("mirror"),
                    "r-blurred": compared("rough mirror"),
                }
            },
            "pass": {"cycles": 50_000, "rays": {"in_box": 1_000_000}},
            "two": {"cycles": 60_000, "rays": {"in_box": 1_100_000}},
        },
        "light-users": {
            "frames": {"frames": {"r-rough": compared("matt", "metal"), "r-clear": compared("mirror", "glass")}}
        },
        "light-defaults": {
            "frames": {
                f"photo alone: {room}-clear": {"objects": {"default": 20.0, "no filter": other}, "things": {}}
                for room, other in (("r", 19.0), ("q", 20.5))
            }
        },
        "room-lights": {
            "fits": {"r": {"ambient": 15.0, "lights": 20.0, "walls": None, "lamps": 20.0}},
            "choices": {"r: default lights": {"relit": 20.0, "mirror_device": 25.0, "mirror_right": 26.0}},
        },
        "assets": {
            "repository": "a/b",
            "revision": "c0ffee00" * 5,
            "files": {"Duck": {"pixels": 9, "psnr": 30.0, "flip": 0.125}},
        },
        "environments": {
            "accuracy": {
                "Room, device": {**{key: {"ok": 0.97} for key in ("mirror", "cosine", "glass")}, "mean_steps": 18.0}
            },
            "living": room("Room"),
        },
        "live-rooms": {
            "rooms": {"r": {"offline": maps(0.05), "live": maps(0.06), "first": 30.0, "milliseconds": 15.0}},
            "generated": {"seed 1": {"offline": maps(None), "live": maps(None)}},
        },
        "live-paths": {
            "seed 1": {"psnr": [30.0, 29.5], "degrees": [2.0, 2.25], "off": [0.02, 0.03], "lost": [0.125, -0.01]}
        },
        "moving-frames": {
            "0.1 m, 3.3°": {
                way: {"frame": 40.0, "object": 30.25, "shadow": None, "displacement": 1.5, "dists": 0.01}
                for way in ("fresh", "marched", "stale")
            }
        },
        "captures": {
            "r, own maps": captured(None),
            "r, phone": captured(0.005),
        },
        "samples": {str(number): {"psnr": 30.0 + number} for number in SAMPLES},
        "fpga": {
            "fmax_mhz": 50.5,
            "clock_mhz": 50.0,
            **{"luts": 43_000, "flip_flops": 22_000, "dsps": 81, "block_rams": 68},
            "available": {"luts": 83_640},
        },
        "bvh-tests": trees("BVH4", "BVH2"),
        "bvh-costs": trees("BVH4", "BVH2", "none"),
        "bvh-cycles": trees("BVH4", "BVH2", "none"),
        "bvh-power": {
            "libraries": ["asap7"],
            "points": [
                {"name": name, "figures": {"array_kge.asap7": 1e3, "mw.asap7": mw, "nj.asap7": nj}}
                for name, mw, nj in (("BVH4", 2.1, 0.5), ("none", 2.0, 5.0))
            ],
        },
        "room-mesh": {
            "r": {"triangles": 600_000, "mesh_bytes": 2_000_000, "plane_bytes": 12_288, "rays": 1000}
            | {"node_reads": 20.0, "triangle_tests": 3.0, "march_steps": 19.0, "dram_bytes": 900.0}
            | {"mesh_right": 1.0, "march_right": 0.975, "cycles": 2.5}
        },
        "cpu-baseline": {
            "bunny": {"processor": "Zuse Z4", "triangles": 69_451, "rays": 307_200, "in_box": 100_000}
            | {"plain_seconds": 240.0, "embree_seconds": 0.03072}
        },
        "paper-unit": {"bench": bench, "area": area()},
        "paper-maps": {
            "living": room("Room"),
            "area": with_maps,
            **{
                f"{encoding}, {frame}": {"psnr": 40.0, "dists": 0.01}
                for encoding in ("slic", "twoLevel")
                for frame in ("photo", "relit")
            },
        },
        "scaling": study([{"array.rows": 4}], [2.0]),
        "ablation": study([dict(zip(keys, (*kind, 1), strict=True)) for kind in kinds], [0.5, 0.75, 1.0, 1.25]),
        "mixed-precision": study([{"precision": "32b32s64d"}], [0.75], render_index=index),
        "features": study([{"frame.gather": False}], [1.5]),
        "marches": {
            **{str(count): {"size": [20, 10], "cycles": 8000 // count} for count in MARCHES},
            **{f"{count}, area": area() for count in MARCHES},
        },
        "energy-area": study([{"array.contexts": 8}], [1.1]),
        "vertices-contexts": study([{"geometry.vertexBits": 14}], [1.2]),
        "instances": {"points": [{"workloads": {"crowd": {"cycles": cycles}}} for cycles in (1000, 1066)]},
        "simulators": {
            "simulators": [{"by": "cocotb", "simulator": "Verilator 5", "cycles": 900, "cycles_per_second": 7489.8}],
            "sleep": {"cycles": 800, "asleep": 2000.4, "awake": 1500.0},
        },
        "view": {
            "samples": 16,
            "scenes": [{"scene": "a", "rate": 9.0, "processor": 0.05, "reload": 0.1, "start": 1.0, "rest": 2.0}],
        },
        "ray-suites": suite_tests(1000, "trimesh", "embree"),
        "ray-suites-device": suite_tests(100, "embree", "libigl"),
        "ray-device": {
            "rays": 1000,
            "kinds": [
                {"kind": kind, "node_reads": 2.0, "triangle_tests": 1.0, "rays_per_cycle": 3.5, "in_box": 3.25}
                for kind in ("near", "from around, shuffled, hits")
            ],
        },
        "ray-rates": {
            "rays": 1000,
            "kinds": [
                {"kind": "near", "hits": 900, "embree_hits": hits, "model": 2e6, "embree": hits}
                | {"node_reads": 2.0, "triangle_tests": 1.0, "dram_bytes": 50.4}
                for hits in (901, None)
            ],
        },
    }


def trees(*names: str) -> dict[str, Any]:
    """A study of points with and without a tree, over two frames of a mesh."""

    def point(number: int, name: str) -> dict[str, Any]:
        counters = {"raysInBox": 1_000_000, "boxTests": 0, "triangleTests": 90_000_000}
        if name != "none":
            counters |= {"boxTests": 4_000_000, "triangleTests": 2_000_000}
        records = {
            "records": 100 + 5 * (name != "none"),
            "bytes": 2_000_000,
            "nodes": 5,
            "triangles": 50,
            "attributes": 50,
        }
        frame = {"counters": counters, "records": records, "cycles": 10.0 * 3**number}
        area = {"traversal_unit_kge": 100.0 + number, "array_kge": 1e3 * (4 - number)}
        return {"name": name, "workloads": {f"bunny, {n}": frame for n in (50, 500)}, "area": {"asap7": area}}

    workloads = [{"name": f"bunny, {n}", "triangles": n - 2} for n in (50, 500)]
    points = [point(*each) for each in enumerate(names)]
    return {"points": points, "workloads": workloads, "baseline": "BVH4", "libraries": ["asap7"]}


def compared(*kinds: str) -> dict[str, Any]:
    """A frame in a known room."""
    parts = {name: 30.0 for name in ("frame", "object", "room")}
    own = {**parts, **{f"{name}_{key}": 0.125 for name in parts for key in ("flip", "dists")}, "brightness": 0.75}
    columns = (
        "no object",
        "probe, rasteriser",
        "ambient light",
        "1 pass, filtered",
        "1 pass, OIDN",
        "photo alone, no gathered light",
        "16 passes, filtered",
        "photo alone",
    )
    qualities = {column: {**own, "things": dict.fromkeys(kinds, 20.0 + index)} for index, column in enumerate(columns)}
    errors = {kind: {"rays": 9, "median": 1.25, "high": 3.0} for kind in ("probe", "colonnade")}
    return {"qualities": qualities, "mirrors": errors}


def suite_tests(count: int, *suites: str) -> dict[str, Any]:
    """Tests of other projects, of which one fails at 16 bits."""
    of = {"test": "a", "revision": "0123456789ab", "tests": count}
    rows = [
        {"suite": suite, **of, "vertexBits": bits, "passed": count - (bits == 16)}
        for suite in suites
        for bits in (16, 24)
    ]
    return {"suites": rows}
