"""The claims of the source paper, each with a cheap form that is compared with the data of ``docs/paper.md``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from colonnade_lab.claims.bench import DISTS, SECOND, Bench, Differs, from_root
from colonnade_lab.claims.outcome import Figure
from colonnade_lab.common import paper
from colonnade_lab.explore.figures import per_ray

#: Units of the cheap form of Fig. 7(a): the most triangles of a mesh.
TRIANGLES = (50, 150)
#: Precisions of Fig. 8's, beside the baseline: the paper's first example, and its choice.
PRECISIONS = ("24b24s24d", paper.PRECISION)
_ROOM = "scenes/rooms/living"


@dataclass(frozen=True)
class Check:
    """A claim and its cheap form.

    Attributes:
        name: What it is called on the command line.
        claim: Where the paper has it, and what it says.
        paper: The paper's figure.
        measure: Runs the cheap form.
        needs: Meshes, libraries, `DISTS`.
        is_quick: It takes a minute of one core at most.
    """

    name: str
    claim: str
    paper: str
    measure: Callable[[Bench], list[Figure]]
    needs: tuple[str, ...] = (SECOND,)
    is_quick: bool = True


def _points(study: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    return {point["name"]: point for point in study["points"]}


def _equal_pictures(bench: Bench) -> list[Figure]:
    report = bench.run(
        *("colonnade", "verify", "--config", "tiny", "--size", "64x48", "--no-reference"),
        *(part for mesh in bench.meshes for part in ("--mesh", mesh)),
    )
    expected = bench.data.result("equality-small")["meshes"]
    return [
        Figure(f"{mesh}: pixels, hits, counters that differ", _differences(expected[mesh]), _differences(found))
        for mesh, found in report["meshes"].items()
    ]


def _differences(of_mesh: Mapping[str, Any]) -> str:
    return ", ".join(str(number) for number in of_mesh["rtl"].values())


def _array(bench: Bench) -> list[Figure]:
    shape = ("--set", "array.rows=3", "--set", "array.columns=5")
    bench.call("colonnade", "generate", "--config", "tiny", *shape, "--output", from_root(bench.folder / "3x5"))
    files = (bench.folder / "3x5" / "filelist.f").read_text(encoding="utf-8").split()
    return [Figure("a 3×5 array has Verilog", "yes", "yes" if "Colonnade.sv" in " ".join(files) else "no")]


def _tests(bench: Bench) -> list[Figure]:
    found, page = bench.study("bvh-tests", meshes=list(bench.meshes)), bench.data.result("bvh-tests")
    figures = []
    for mesh in bench.meshes:
        for name in _points(found):
            pair = [_points(study)[name]["workloads"][mesh] for study in (page, found)]
            figures.append(Figure(f"{mesh}, {name}: box, triangle tests a ray", *map(_per_ray, pair)))
        sizes = (_points(study)["BVH4"]["workloads"][mesh]["records"]["bytes"] for study in (page, found))
        figures.append(Figure(f"{mesh}: scene, bytes", *(f"{size:,}" for size in sizes)))
    return figures


def _per_ray(frame: Mapping[str, Any]) -> str:
    return ", ".join(f"{per_ray(frame, f'{kind}Tests') or 0.0:,.1f}" for kind in ("box", "triangle"))


def _records(bench: Bench) -> list[Figure]:
    found, page = bench.study("bvh-costs", sections=["area"], meshes=list(bench.meshes)), bench.data.result("bvh-costs")
    figures = []
    for mesh in bench.meshes:
        for name in _points(found):
            pair = [_points(study)[name]["workloads"][mesh] for study in (page, found)]
            texts = (f"{frame['records']['records']:,}; {_per_ray(frame)}" for frame in pair)
            figures.append(Figure(f"{mesh}, {name}: records; tests a ray", *texts))
    return [*figures, Figure("pictures with and without a tree are equal", "yes", "yes")]  # else the study fails


def _cycles(bench: Bench) -> list[Figure]:
    found = bench.study("bvh-cycles", meshes=list(bench.meshes), reduce=list(TRIANGLES))
    page = _points(bench.data.result("bvh-cycles"))
    figures = []
    for workload in found["workloads"]:
        frame, names = workload["name"], list(_points(found))
        both = ([points[name]["workloads"][frame]["cycles"] for name in names] for points in (page, _points(found)))
        texts = (f"{', '.join(f'{each:,}' for each in of)}: {of[-1] / of[0]:.1f} times" for of in both)
        figures.append(Figure(f"{frame} triangles: cycles of {', '.join(names)}", *texts))
    return figures


def _gates(bench: Bench) -> list[Figure]:
    from colonnade_lab.ppa.measure import traversal_unit

    page = _points(bench.data.result("bvh-costs"))
    units = bench.data.result("area-edge-asap7")["units"]
    figures = []
    for point, overrides in {"BVH4": (), "none": ("geometry.bvh=false",)}.items():
        print(f"paper: gates of a row of edge {' '.join(overrides)}", flush=True)
        found = traversal_unit("edge", overrides, ("asap7",))
        whole = page[point]["area"]["asap7"]["traversal_unit_kge"]
        figures.append(Figure(f"{point}: a traversal unit of edge, kGE", f"{whole:.1f}", f"{found.pop('all'):.1f}"))
        if point == "BVH4":
            known = (name for name in found if name in units)
            figures += [Figure(f"{name}, kGE", f"{units[name]['kge']:.1f}", f"{found[name]:.1f}") for name in known]
    return figures


def _power(bench: Bench) -> list[Figure]:
    found, page = bench.study("bvh-power"), bench.data.result("bvh-power")
    forms = {"array_kge": ("array, kGE", ",.0f"), "mw": ("mW", ".3f"), "nj": ("nJ a ray", ".3f")}
    return [
        Figure(
            f"{name}: {title}",
            *(format(_points(study)[name]["figures"][f"{key}.asap7"], form) for study in (page, found)),
        )
        for name in _points(found)
        for key, (title, form) in forms.items()
    ]


def _room_rays(bench: Bench) -> list[Figure]:
    found = bench.run("colonnade", "study", "rays", _ROOM)
    page = bench.data.result("environments")["accuracy"]
    pairs = {
        kind: (page["living, device"][kind]["ok"], found["living, device"][kind]["ok"])
        for kind in ("mirror", "cosine", "glass")
    }
    return [
        Figure(f"living, {kind} rays right, %", *(f"{100 * each:.2f}" for each in pair)) for kind, pair in pairs.items()
    ]


def _maps(bench: Bench) -> list[Figure]:
    page = {"slic": bench.data.result("paper-maps")["living"], "twoLevel": bench.data.result("environments")["living"]}
    figures = []
    for encoding, known in page.items():
        found = bench.run("colonnade", "inspect", "--background", _ROOM, "--encoding", encoding)
        texts = (
            f"{each['bytes']['albedo']:,} B, {each['ratio']['albedo']:.1f} times, {each['albedo']['psnr']:.1f} dB, "
            f"{each['normals']['mean_degrees']:.1f}°"
            for each in (known, found)
        )
        figures.append(Figure(f"living, {encoding}: albedo, normals", *texts))
    return figures


def _room_mesh(bench: Bench) -> list[Figure]:
    found, page = (
        bench.run("colonnade", "study", "room-mesh", _ROOM)["living"],
        bench.data.result("room-mesh")["living"],
    )
    forms = {"node_reads": ".1f", "triangle_tests": ".1f", "dram_bytes": ",.0f", "march_steps": ".1f"}
    return [
        Figure(f"living: {key.replace('_', ' ')} a ray", *(format(each[key], form) for each in (page, found)))
        for key, form in forms.items()
    ]


def _precision(bench: Bench) -> list[Figure]:
    names = [*PRECISIONS, "64b64s64d"]
    found = bench.study("mixed-precision", sections=["area", "power"], meshes=list(bench.meshes), precision=names)
    page = _points(bench.data.result("mixed-precision"))
    return [
        Figure(
            f"{mesh}, {name}: DISTS loss, %",
            *(f"{100 * points[name]['workloads'][mesh]['dists_baseline']:.4f}" for points in (page, _points(found))),
        )
        for name in names
        for mesh in bench.meshes
    ]


def _lid(bench: Bench) -> list[Figure]:
    from colonnade.design.toolchain import project_root
    from PIL import Image

    file = project_root() / "docs" / "pictures" / "precision.png"
    before = file.read_bytes()
    with Image.open(file) as picture:
        known = picture.convert("RGB").tobytes()
    try:
        bench.call("tools/pictures", "precision")
        with Image.open(file) as picture:
            is_equal = picture.convert("RGB").tobytes() == known
    finally:
        file.write_bytes(before)
    return [Figure("pixels of the page's picture are equal", "yes", "yes" if is_equal else "no")]


def _rays(bench: Bench) -> list[Figure]:
    found = bench.run("colonnade", "bench", "--config", "edge", "--mesh", "bunny", "--no-mirror")["meshes"]["bunny"]
    page = bench.data.result("bench-edge")["meshes"]["bunny"]
    texts = (f"{each['cycles']:,}, {each['rays_per_cycle_in_box']:.2f}" for each in (page, found))
    busiest = (f"{each['bottleneck']}, {100 * each['utilisation'][each['bottleneck']]:.1f} %" for each in (page, found))
    return [Figure("bunny on edge: cycles, in-box rays a cycle", *texts), Figure("busiest unit", *busiest)]


def _cpu(bench: Bench) -> list[Figure]:
    found = bench.run("colonnade", "study", "cpu", "bunny")["bunny"]
    hits = f"{found['embree_hits']:,} of {found['tested_rays']:,}"
    if found["hits"] != found["embree_hits"]:
        raise Differs(f"the plain program hits {found['hits']:,} rays, Embree {hits}")
    return [
        Figure("plain C++, every triangle for every ray: minutes a frame", "", f"{found['plain_seconds'] / 60:.1f}"),
        Figure("Embree: MRay/s of a core", "", f"{found['rays'] / found['embree_seconds'] / 1e6:.1f}"),
    ]


#: All claims with a cheap form, in the order of the page.
CHECKS: tuple[Check, ...] = (
    Check("rtl", "Eq. (1): the Verilog renders what the model does", "–", _equal_pictures, (SECOND,), False),
    Check("array", "Fig. 4(a): N×M units", "10×8", _array, ()),
    Check("tests", "III-A, Fig. 2(b): tests with a tree, size of the scene", "–", _tests),
    Check(
        "records", "IV-A, Fig. 7(b): memory of the tree; equal pictures", f"+{100 * paper.TREE_MEMORY:.1f} %", _records
    ),
    Check(
        "cycles",
        "IV-A, Fig. 7(a), 9(b): time with and without a tree",
        f"{paper.TREE_SPEED_UP:g} times",
        _cycles,
        (SECOND,),
        False,
    ),
    Check(
        "gates",
        "IV-A, Fig. 6(b), 7(b): gates with and without a tree",
        f"+{100 * paper.TREE_AREA:.1f} % area",
        _gates,
        ("asap7",),
        False,
    ),
    Check("power", "V, Fig. 9(c): power with and without a tree", "+5 %", _power, ("asap7",), False),
    Check("cpu", "III-A: a frame without a tree on a laptop", f"{paper.LAPTOP_HOURS:g} h", _cpu, ("bunny",)),
    Check("room-rays", "III-B, Fig. 5: rays in the rebuilt room", "–", _room_rays, (), False),
    Check("room-mesh", "III-B: the room as a mesh, and its march", "O(n log n)", _room_mesh, (), False),
    Check("maps", "III-B, IV-B: maps of 16 KB", f"{paper.MAP_RATIO} times", _maps, (DISTS,), False),
    Check("lid", "Fig. 2(e): low and high precision", "–", _lid, ()),
    Check("precision", "IV-C, Fig. 8(a): loss of mixed precision", "0.6 to 1.65 %", _precision, (SECOND, DISTS), False),
    Check(
        "rays", "IV-D, Fig. 6(c): rays of a 10×8 array", f"{paper.RAYS_PER_CYCLE:g} a cycle", _rays, ("bunny",), False
    ),
)
